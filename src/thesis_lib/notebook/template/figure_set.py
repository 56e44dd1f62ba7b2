"""The figure set footprint."""

from thesis_lib.figure_sets.figure_set import FigureSet

from .parameters import Footprint

FIGURE_SETS = [FigureSet(request=Footprint, chapter="", module=f"{__package__}.compute")]
