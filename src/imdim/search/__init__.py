"""Layer 2: the structure search that composes candidates into a short program."""
