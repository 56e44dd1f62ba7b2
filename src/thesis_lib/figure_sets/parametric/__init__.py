"""Beam, plate, sound and shapes: one camera parameter is varied."""
