"""Positions for the cameras of the experiment."""
