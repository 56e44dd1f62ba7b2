"""Where the cameras of the experiment should stand."""
