"""Proofs that a program has the fewest primitives, and exact formulas."""
