"""Relations among the primitives of a program: how well its numbers are known, what may hold among them, what is worth saying."""
