"""Evolution of CSG trees: a population scored in one batched call, a front of error against size."""
