"""Images of a board to cameras.

From images on: `corners` finds the board's corners; `rig` calibrates each camera by itself and
orders the corners alike for all cameras, and `bundle_adjustment` adjusts these together;
`uncertainty` estimates how far they are off. Cameras from elsewhere are read by
:mod:`thesis_lib.measure.exchange.cameras`.
"""
