"""Several modes at once: frequencies, damping and complex shapes from the tracks of all cameras."""
