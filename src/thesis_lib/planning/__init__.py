"""Where cameras should stand, and how many of which kind."""
