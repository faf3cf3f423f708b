"""Exact search over the candidates of an arrangement: bounds that prove a program minimal, and CSG-Stump by binary programming."""
