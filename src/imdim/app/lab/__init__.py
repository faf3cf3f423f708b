"""The live lab: watch a program come about in a browser page, correct it, take it away. The page knows no geometry of its own."""
