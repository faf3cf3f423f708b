"""Layer 0, standard library only: what a CSG program is, and the forms it can take."""
