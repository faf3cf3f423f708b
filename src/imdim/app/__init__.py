"""Layer 4: what a person starts: the command line."""
