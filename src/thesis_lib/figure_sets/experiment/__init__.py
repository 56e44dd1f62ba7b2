"""The experiment of chapter 5 with rendered recordings."""
