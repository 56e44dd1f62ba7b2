"""Questions about where cameras should stand."""
