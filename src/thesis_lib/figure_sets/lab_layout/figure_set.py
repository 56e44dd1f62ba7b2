"""Beyond chapter 5: elevations and layouts of the cameras in the laboratory."""

from thesis_lib.figure_sets.figure_set import FigureSet, Inputs, Product
from thesis_lib.figure_sets.lab_layout.parameters import LabElevation, LabLayout, Layouts

RECORDINGS = Product(module=f"{__package__}.recordings", recorded=True)


def needs(asked: Layouts) -> Inputs:
    """The recordings, of as many cameras as are ever used together."""
    return {"data": (RECORDINGS, asked.film_request)}


FIGURE_SETS = [
    FigureSet(
        request=request,
        chapter="lab",
        module=f"{__package__}.compute",
        needs=needs,
        figure=f"{__package__}.figures:figure",
    )
    for request in (LabElevation, LabLayout)
]
