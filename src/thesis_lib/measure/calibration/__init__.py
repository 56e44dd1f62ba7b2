"""Pictures of a board to cameras."""
