"""More than one mode in the laboratory."""
