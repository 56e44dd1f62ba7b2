"""What a measured structure radiates, and how certain that is."""
