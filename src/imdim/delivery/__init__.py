"""From a program to a folder: finished, checked against the target, written with all exports (`export.step` writes STEP)."""
