"""Repeated parts: rows, grids, circles and mirror images, detected and edited."""
