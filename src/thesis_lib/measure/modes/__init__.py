"""Modal identification: frequencies, damping and complex shapes from the tracks of all cameras."""
