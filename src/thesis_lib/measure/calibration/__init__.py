"""Camera calibration from images of a calibration board.

`corners` finds the board's corners; `rig` calibrates each camera separately and puts the corners
of all cameras in the same order; `bundle_adjustment` adjusts all cameras together; `uncertainty`
estimates the calibration's uncertainty. Calibrations of other programs are read by
:mod:`thesis_lib.measure.exchange.cameras`.
"""
