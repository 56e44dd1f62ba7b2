"""The parameters of ``cameras``: what is computed of single cameras and parallel pairs."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.readings import reading
from thesis_lib.facts.setups import Setting
from thesis_lib.studies.refusals import refuse
from thesis_lib.studies.request import Study
from thesis_lib.studies.vocabulary import (
    Azimuth,
    Elevation,
    Name,
    Positive,
    SensorSize,
    Several,
    Shifts,
    Width,
    field,
)

FARTHEST = 4  # of the largest of the distances, to which curves go
PictureWidth = Literal[1280, 640, 320, 256, 160, 128, 80, 64, 32, 16]


class Cameras(Study):
    """Lenses, sensors, pixels, projections and a parallel pair (chapter 2, Appendices A–C)."""

    name = "cameras"
    title = "Cameras and lenses"
    subject = "cameras"
    section = "chapter 2, appendices A, B"
    study = "optics"
    varied = "distance_mm"
    varied_label = "distance d"

    sensors_mm: dict[Name, tuple[Positive, Positive]] = field(
        lambda: {
            "full frame": (36.0, 24.0),
            "APS-C": (23.6, 15.6),
            "four thirds": (17.3, 13.0),
            "1 inch": (13.2, 8.8),
            "2/3 inch": (8.8, 6.6),
        },
        "sensors by name, each with width and height",
        'an object such as {"full frame": [36, 24]}: names of 1 to 40 characters to two numbers '
        "above 0, at most 100000",
        min_length=1,
    )
    focal_lengths_mm: Several[Positive] = field(
        lambda: [8.0, 12.0, 16.0, 24.0, 35.0, 50.0, 85.0, 135.0],
        "focal lengths of which angles of view are computed",
    )
    format_widths_px: Several[Width] = field(
        lambda: [800, 1024, 1280, 1600], "widths of pictures in the formats 4:3 and 3:2"
    )
    focal_length_mm: Positive = field(
        reading("beam")["focal_length_mm"],
        "focal length of the lens everywhere else",
        "a number above 0, less than the nearest of the distances",
    )
    sensor_width_mm: Positive = field(
        reading("beam")["sensor_width_mm"], "width of the sensor everywhere else"
    )
    resolution_px: SensorSize = field(
        lambda: tuple(setups.table("beam", "distance")["resolution_px"]),
        "width and height of the pictures that are not drawn",
    )
    distances_mm: Several[Positive] = field(
        lambda: [float(d) for d in setups.table("beam", "distance")["distances_mm"]],
        "distances in the tables; curves go from the least to four times the largest",
        "a list of different numbers above the beam's reach, at most 100000",
    )
    azimuth_deg: Azimuth = field(
        float(setups.table("beam", "distance")["azimuth_deg"]),
        "azimuth of the camera that looks at the beam",
    )
    elevation_deg: Elevation = field(
        float(setups.table("beam", "distance")["elevation_deg"]), "its elevation"
    )
    widths_px: Several[PictureWidth] = field(
        lambda: [640, 320, 160, 80],
        "widths of the drawn pictures of the beam, from the nearest distance",
    )
    marker_mm: Annotated[float, Field(gt=0, le=25)] = field(5.0, "diameter of the drawn markers")
    bayer_pattern: Literal["RGGB", "BGGR", "GRBG", "GBRG"] = field(
        "RGGB",
        "colour filters of the top-left two by two pixels, row by row",
        "RGGB, BGGR, GRBG or GBRG",
    )
    f_numbers: Several[Positive] = field(
        lambda: [2.8, 5.6, 11.0], "focal length over diameter of the lens, for the depth of field"
    )
    circle_mm: Positive = field(
        0.03, "largest circle of confusion on the sensor that counts as sharp"
    )
    baselines_mm: Several[Positive] = field(
        lambda: [50.0, 150.0, 450.0], "distances between two parallel cameras"
    )
    disparity_error_px: Positive = field(0.1, "error of a disparity that is not rounded")
    trials: Shifts = field(200, "random shifts of the pixel grids of the parallel pair")

    def settings(self) -> list[Setting]:
        """One setting per distance: the camera that looks at the beam."""
        direction = ((self.azimuth_deg, self.elevation_deg),)
        return [
            Setting("beam", d, f"{d:g} mm", d, direction, self.resolution_px)
            for d in self.distances_mm
        ]

    @model_validator(mode="after")
    def _check_together(self) -> Cameras:
        reach = 1000 * math.hypot(*self.structure.extent) / 2
        for distance in self.distances_mm:
            if distance <= reach:
                allowed = f"more than {reach:.4g} mm, the reach of the beam"
                refuse("distances_mm", distance, f"allowed: {allowed}")
        if self.focal_length_mm >= min(self.distances_mm):
            self.refuse("focal_length_mm")
        return self
