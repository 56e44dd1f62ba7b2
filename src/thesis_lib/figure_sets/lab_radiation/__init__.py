"""From video to sound: measured and true radiation of rendered structures."""
