"""IMDIM: a mesh or a point cloud becomes a short, editable CSG program.

Read `program.tree`, `geometry.sdf`, `pipeline` and `evaluate`, in this order, and you know the house.
"""
