"""The law of rounding, for design."""

from thesis_lib.figure_sets.design_law.parameters import DesignLaw
from thesis_lib.figure_sets.figure_set import FigureSet

FIGURE_SETS = [
    FigureSet(
        request=DesignLaw,
        chapter="beyond",
        module=f"{__package__}.compute",
        rooms=("figure_sets/parametric",),
        kept=True,
    )
]
