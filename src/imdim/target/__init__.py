"""What is to be reconstructed: mesh and cloud files are read here (`readers`, `target.load_target`), repaired, split into bodies."""
