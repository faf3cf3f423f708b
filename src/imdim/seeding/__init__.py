"""Layer 2: surfaces found in the target, and the candidate solids that they bound."""
