"""Requests to executed notebooks, cubes and pages; nothing twice."""
