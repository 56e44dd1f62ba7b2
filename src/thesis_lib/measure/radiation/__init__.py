"""Sound radiation of a measured structure, with its uncertainty."""
