"""Typed requests and their labelled cubes."""
