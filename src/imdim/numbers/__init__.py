"""The numbers of a program of known structure: refined on the target, and rounded to what a designer types (`snap`, `design_values`)."""
