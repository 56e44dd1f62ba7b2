"""Higher bending modes and torsion in the laboratory."""
