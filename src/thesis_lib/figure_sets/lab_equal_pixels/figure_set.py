"""Beyond chapter 5: the central claim of the thesis, through the laboratory."""

from thesis_lib.figure_sets.figure_set import filmed
from thesis_lib.figure_sets.lab_equal_pixels.parameters import LabEqualPixels

FIGURE_SETS = [
    filmed(
        __package__,
        request=LabEqualPixels,
        chapter="lab",
        figure=f"{__package__}.figures:case_figure",
    )
]
