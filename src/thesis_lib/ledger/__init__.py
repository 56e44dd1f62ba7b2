"""Comparison of the thesis's claims with cubes, by fixed rules."""
