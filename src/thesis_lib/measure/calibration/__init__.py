"""Images of a board to cameras."""
