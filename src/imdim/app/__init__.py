"""What a person starts: the command line, batches of parts, and the live lab in a browser."""
