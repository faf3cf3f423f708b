"""Geometric theories: control points, constraints between them, and a solver that makes them exact."""
