"""Beyond chapter 5: what cameras tell of the sound of a structure, through the laboratory."""

from thesis_lib.figure_sets.figure_set import filmed
from thesis_lib.figure_sets.lab_radiation.parameters import LabRadiation

FIGURE_SETS = [filmed(__package__, request=LabRadiation, chapter="lab")]
