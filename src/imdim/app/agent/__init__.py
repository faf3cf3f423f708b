"""A server through which language-model agents open, fit, edit and export parts."""
