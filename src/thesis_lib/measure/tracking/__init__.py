"""Videos to the tracks of markers.

From a video on: `tracks` reads its frames and writes centres to disk; `homography` finds the
structure in the first one; `follow` goes on from frame to frame by a table of grey levels; where
that fails, `tracker` searches the resampled structure and fits each disc.
"""
