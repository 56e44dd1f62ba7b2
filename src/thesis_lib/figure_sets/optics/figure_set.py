"""Chapter 2, appendices A and B: parameters of single cameras, lenses and parallel pairs."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.studies import fields, request

MAX_DISTANCE_RATIO = 4  # curves end at this multiple of the largest distance
PictureWidth = Literal[1280, 640, 320, 256, 160, 128, 80, 64, 32, 16]


class Cameras(request.Study):
    """Lenses, sensors, pixels, projections and a parallel pair (chapter 2, Appendices A–C)."""

    name = "cameras"
    title = "Cameras and lenses"
    subject = "cameras"
    section = "chapter 2, appendices A, B"
    study = "optics"
    varied = "distance_mm"
    varied_label = "distance d"

    sensors_mm: dict[fields.Name, tuple[fields.Positive, fields.Positive]] = Field(
        {
            "full frame": (36.0, 24.0),
            "APS-C": (23.6, 15.6),
            "four thirds": (17.3, 13.0),
            "1 inch": (13.2, 8.8),
            "2/3 inch": (8.8, 6.6),
        },
        min_length=1,
    )
    """sensors by name, each with width and height, such as {"full frame": [36, 24]}"""
    focal_lengths_mm: fields.Several[fields.Positive] = [
        8.0, 12.0, 16.0, 24.0, 35.0, 50.0, 85.0, 135.0
    ]  # fmt: skip
    """focal lengths of which angles of view are computed"""
    format_widths_px: fields.Several[fields.Width] = [800, 1024, 1280, 1600]
    """widths of images in the formats 4:3 and 3:2"""
    focal_length_mm: fields.Positive = setups.assumed_values("beam")["focal_length_mm"]
    """focal length of the lens everywhere else"""
    sensor_width_mm: fields.Positive = setups.assumed_values("beam")["sensor_width_mm"]
    """width of the sensor everywhere else"""
    resolution_px: fields.Resolution = tuple(
        setups.setup_table("beam", "distance")["resolution_px"]
    )
    """width and height of the images that are not drawn"""
    distances_mm: fields.Several[fields.Positive] = [
        float(d) for d in setups.setup_table("beam", "distance")["distances_mm"]
    ]
    """distances in the tables; curves go from the least to four times the largest"""
    azimuth_deg: fields.Azimuth = float(setups.setup_table("beam", "distance")["azimuth_deg"])
    """azimuth of the camera that looks at the beam"""
    elevation_deg: fields.Elevation = float(setups.setup_table("beam", "distance")["elevation_deg"])
    """its elevation"""
    widths_px: fields.Several[PictureWidth] = [640, 320, 160, 80]
    """widths of the drawn images of the beam, from the nearest distance"""
    marker_mm: Annotated[fields.Real, Field(gt=0, le=25)] = 5.0
    """diameter of the drawn markers"""
    bayer_pattern: Literal["RGGB", "BGGR", "GRBG", "GBRG"] = "RGGB"
    """colour filters of the top-left two by two pixels, row by row"""
    f_numbers: fields.Several[fields.Positive] = [2.8, 5.6, 11.0]
    """focal length over diameter of the lens, for the depth of field"""
    circle_mm: fields.Positive = 0.03
    """largest circle of confusion on the sensor that counts as sharp"""
    baselines_mm: fields.Several[fields.Positive] = [50.0, 150.0, 450.0]
    """distances between two parallel cameras"""
    disparity_error_px: fields.Positive = 0.1
    """error of a disparity that is not rounded"""
    trials: fields.Shifts = 200
    """random shifts of the pixel grids of the parallel pair"""

    def settings(self) -> list[setups.Setting]:
        """Return one setting per distance: the camera that looks at the beam."""
        direction = ((self.azimuth_deg, self.elevation_deg),)
        return [
            setups.Setting("beam", d, f"{d:g} mm", d, direction, self.resolution_px)
            for d in self.distances_mm
        ]

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        reach = 1000 * math.hypot(*self.structure.extent) / 2
        for distance in self.distances_mm:
            if distance <= reach:
                fields.refuse_value("distances_mm", distance, request.distance_limit(reach))
        if self.focal_length_mm >= min(self.distances_mm):
            self.refuse("focal_length_mm", "allowed: less than the nearest of distances_mm")
        return self


FIGURE_SETS = [FigureSet(request=Cameras, chapter="ch2", module=f"{__package__}.compute")]
