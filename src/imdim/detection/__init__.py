"""Surfaces of a mesh or a cloud: planes, spheres, cylinders, cones and tori are detected here."""
