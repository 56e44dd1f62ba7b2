"""Beyond chapter 5: higher modes and torsion of the beam in the laboratory."""

from thesis_lib.figure_sets.figure_set import FigureSet, Inputs, Product
from thesis_lib.figure_sets.lab_modes.parameters import LabModes

RECORDINGS = Product(module=f"{__package__}.recordings", recorded=True)


def needs(asked: LabModes) -> Inputs:
    """The recordings."""
    return {"data": (RECORDINGS, asked.recordings)}


FIGURE_SETS = [
    FigureSet(
        request=LabModes,
        chapter="lab",
        module=f"{__package__}.compute",
        needs=needs,
        figure=f"{__package__}.figures:modes_figure",
    )
]
