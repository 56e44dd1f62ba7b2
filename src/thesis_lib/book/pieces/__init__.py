"""Pieces of pages that are written from cubes and facts."""
