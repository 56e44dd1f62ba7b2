"""Planned cameras, and the thesis's layouts."""

from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.figure_sets.planner.parameters import Planner

FIGURE_SETS = [
    FigureSet(
        request=Planner,
        chapter="beyond",
        module=f"{__package__}.compute",
        rooms=("planning",),
        kept=True,
    )
]
