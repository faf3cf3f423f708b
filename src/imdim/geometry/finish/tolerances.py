"""What counts as nothing, as one place and as one direction while cutters and bosses are made neat."""

ALIGNED = 1e-9  # by which the cosine between two directions may lack of 1
TOUCH = 1e-6  # of a size, the part's largest by default: two places, or two sizes, are one
NOTHING = 1e-6  # of a volume: what rounding errors of the booleans leave
