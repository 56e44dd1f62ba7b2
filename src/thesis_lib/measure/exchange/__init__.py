"""Measurements and calibrations as files that other programs open."""
