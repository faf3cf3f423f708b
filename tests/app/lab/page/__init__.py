"""A package, so that one server, one browser and two clients serve all tests in it, and end with the last."""
