"""Planned camera positions for standard questions."""
