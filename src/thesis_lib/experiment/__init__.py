"""The laboratory: render, record, calibrate, synchronise, track, reconstruct (thesis 5, D–F)."""
