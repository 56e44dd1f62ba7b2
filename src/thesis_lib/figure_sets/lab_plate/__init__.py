"""A plate and its sound in the laboratory."""
