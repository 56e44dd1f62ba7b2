"""Estimate the delays of cameras from their sound tracks."""
