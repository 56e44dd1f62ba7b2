"""Beyond chapter 5: higher modes and torsion of the beam in the laboratory."""

from thesis_lib.figure_sets.figure_set import filmed
from thesis_lib.figure_sets.lab_modes.parameters import LabModes

FIGURE_SETS = [
    filmed(
        __package__,
        request=LabModes,
        chapter="lab",
        figure=f"{__package__}.figures:modes_figure",
    )
]
