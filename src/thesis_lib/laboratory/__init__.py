"""Recordings that are rendered, with known truth."""
