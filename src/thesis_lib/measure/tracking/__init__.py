"""Marker tracks from videos.

`tracks` reads a video's frames and writes the markers' centres to disk; `homography` finds the
structure in the first frame; `follow` tracks from frame to frame by linear grey-level models; where
that fails, `tracker` searches the resampled structure and fits each disc.
"""
