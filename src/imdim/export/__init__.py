"""A program in other languages and file formats: OpenSCAD, STEP (`step`), Python scripts, meshes, the report page, pictures."""
