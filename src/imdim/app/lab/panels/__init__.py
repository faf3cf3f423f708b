"""The panels of the page, one per file: each makes its inputs, calls the session, and shows what the session says."""
