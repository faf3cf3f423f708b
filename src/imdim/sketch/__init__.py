"""Solver for geometric constraints between control points, in the plane and in space."""
