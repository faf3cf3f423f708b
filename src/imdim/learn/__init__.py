"""Policies that write signed sequences, how they are trained and how they are decoded."""
