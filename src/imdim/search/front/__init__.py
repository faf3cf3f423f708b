"""Scores of whole programs, and the front from crude to exact."""
