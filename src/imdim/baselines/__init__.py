"""Other methods of the literature that reconstruct the same targets: CSG-Stump, optimised and learned."""
