"""Layer 1: the leaf table and its folds, point sets, exact solids, clouds, meshes and metrics."""
