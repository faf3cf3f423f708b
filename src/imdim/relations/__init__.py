"""Relations between the numbers of a program: found, chosen by description length, and held exactly."""
