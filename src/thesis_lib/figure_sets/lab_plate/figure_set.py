"""Beyond chapter 5: the plate and its sound in the laboratory."""

from thesis_lib.figure_sets.figure_set import filmed
from thesis_lib.figure_sets.lab_plate.parameters import LabPlate

FIGURE_SETS = [
    filmed(
        __package__,
        request=LabPlate,
        chapter="lab",
        figure=f"{__package__}.figures:filmed_plate_figure",
    )
]
