"""Images of a board to cameras.

From images on: `corners` finds the board's corners; `zhang` calibrates each camera by itself; `rig`
orders the corners alike for all cameras, and `bundle_adjustment` adjusts these together;
`uncertainty` tells how exact they are. `reused` has cameras from elsewhere.
"""
