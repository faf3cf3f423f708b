"""The live lab: watch a program being built in a browser page, correct it, export it. The page knows no geometry of its own."""
