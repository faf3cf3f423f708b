"""Cutters and bosses made neat without a change of the solid: ends extended, parts commuted, outliers of patterns mended."""
