"""The search for what explains the stated values of chapter 3 that are missed."""

from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.figure_sets.misses.parameters import Misses

FIGURE_SETS = [FigureSet(request=Misses, chapter="", module=f"{__package__}.compute", kept=True)]
