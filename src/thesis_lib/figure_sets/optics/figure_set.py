"""Chapter 2 and appendices A and B: cameras and lenses."""

from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.figure_sets.optics.parameters import Cameras

FIGURE_SETS = [FigureSet(request=Cameras, chapter="ch2", module=f"{__package__}.compute")]
