"""CSG-Stump Net (Ren et al. 2021): primitives and the matrices that connect them, learnt from occupancy and fitted per shape."""
