"""Layer 1: a program written as OpenSCAD, STEP, Python, mesh files and pictures."""
