"""Sound tracks to the delays of cameras."""
