"""One's own recordings, from a folder to deflection shapes and a report."""
