"""Beyond chapter 5: elevations and layouts of the cameras in the laboratory."""

from thesis_lib.figure_sets.figure_set import filmed
from thesis_lib.figure_sets.lab_layout.parameters import LabElevation, LabLayout

FIGURE_SETS = [
    filmed(
        __package__,
        request=request,
        chapter="lab",
        figure=f"{__package__}.figures:figure",
    )
    for request in (LabElevation, LabLayout)
]
