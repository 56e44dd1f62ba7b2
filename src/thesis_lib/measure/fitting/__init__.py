"""Tracks to points in space, to deflection shapes.

From tracks on: `reconstruction` finds the structure's frame at rest; `frequency` the frequency and
the cameras' clocks; `harmonics` fits the images' harmonics and triangulates them to amplitudes;
`errors` tells how far these may be off; `result` puts all of it together, beside the modes of the
structure's model.
"""
