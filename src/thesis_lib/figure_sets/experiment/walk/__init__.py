"""The pictures and numbers that walk through one experiment."""
