"""Recordings that share no code with the library: another renderer, other writers."""
