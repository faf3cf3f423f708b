"""Layer 2: the numbers of a program of known structure, fitted and snapped."""
