"""Beyond chapter 5: the plate and its sound in the laboratory."""

from thesis_lib.figure_sets.figure_set import FigureSet, Inputs, Product
from thesis_lib.figure_sets.lab_plate.parameters import LabPlate

RECORDINGS = Product(module=f"{__package__}.recordings", recorded=True)


def needs(asked: LabPlate) -> Inputs:
    """The recordings."""
    return {"data": (RECORDINGS, asked.recordings)}


FIGURE_SETS = [
    FigureSet(
        request=LabPlate,
        chapter="lab",
        module=f"{__package__}.compute",
        needs=needs,
        figure=f"{__package__}.figures:filmed_plate_figure",
    )
]
