"""Evolution of whole programs: operators, populations, seeds."""
