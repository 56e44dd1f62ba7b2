"""Estimate the receptance of a structure from its motion and a recorded force."""
