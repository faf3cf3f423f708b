"""Solids as signed distances, meshes and points; poses, surfaces, sampling."""
