"""Structure search for noisy clouds: the program with the shortest description of the points (minimum description length)."""
