"""CSG programs as values: the tree, its codec, constraints and repeats."""
