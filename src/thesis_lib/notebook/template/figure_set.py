"""The figure set footprint and its parameters."""

from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.studies.fields import Positive, SensorWidth, Several
from thesis_lib.studies.request import Study


class Footprint(Study):
    """A request: each field with its bounds, its meaning and, by the end of its name, its unit."""

    name = "footprint"
    title = "Footprint of a pixel"
    subject = study = "footprint"
    varied, varied_label = "distance_mm", "distance d"

    distances_mm: Several[Positive] = [500.0, 1000.0, 2000.0]
    """distances of the camera"""
    focal_length_mm: Positive = 24.0
    """focal length of the lens"""
    sensor_width_mm: SensorWidth = 36.0
    """width of the sensor"""


FIGURE_SETS = [FigureSet(request=Footprint, chapter="", module=f"{__package__}.compute")]
