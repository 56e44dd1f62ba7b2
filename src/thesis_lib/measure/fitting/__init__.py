"""Tracks to points in space, to deflection shapes."""
