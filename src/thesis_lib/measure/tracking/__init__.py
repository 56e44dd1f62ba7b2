"""Videos to the tracks of markers."""
