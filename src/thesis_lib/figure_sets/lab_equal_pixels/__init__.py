"""Many coarse cameras against few sharp ones, through the laboratory."""
