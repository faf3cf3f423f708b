"""Structure search: which primitives, in which order, added or cut. For meshes and calm clouds `structure`, for noisy ones `mdl`."""
