"""Recordings to deflection shapes: calibrate, synchronise, track, fit, report."""
