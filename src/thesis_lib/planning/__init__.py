"""Planning of camera layouts: positions, number and kind of the cameras."""
