"""Synthetic programs with their clouds, batched in torch, and the npz files that hold them."""
