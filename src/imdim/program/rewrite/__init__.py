"""Shorter programs of the same solid: rules that `containment` proves."""
