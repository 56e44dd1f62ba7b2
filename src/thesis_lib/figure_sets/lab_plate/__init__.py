"""A plate in the laboratory."""
