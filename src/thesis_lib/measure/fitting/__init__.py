"""Compute deflection shapes from marker tracks.

`reconstruction` fits the structure's frame at rest, `frequency` estimates the frequency and the
cameras' clocks, `harmonics` fits the image harmonics and triangulates them to amplitudes, `errors`
estimates their uncertainty, and `result` combines all of it and compares the shape with the modes
of the structure's model.
"""
