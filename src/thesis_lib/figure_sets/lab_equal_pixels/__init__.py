"""Many coarse cameras against few sharp ones, in rendered recordings."""
