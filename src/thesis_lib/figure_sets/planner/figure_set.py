"""Planned cameras, and the thesis's layouts: standard questions to the planner."""

from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.planning.positions import combine_positions
from thesis_lib.planning.request import Count, PlanRequest, Tilt
from thesis_lib.studies import fields, request

THESIS_QUESTIONS = {"beam": "beam: as free as the thesis", "plate": "plate: as free as the thesis"}
# The question on the plate is planned for its sound, too
READABLE_QUESTIONS = {body: f"{body}: markers that can be read" for body in THESIS_QUESTIONS}
FREE_QUESTIONS = {body: f"{body}: nearer or farther, too" for body in THESIS_QUESTIONS}
WALL_SECTOR_DEG = (90.0, 270.0, -90.0, 90.0)  # the sector that a wall blocks
BLOCKED_QUESTIONS = {"beam: a wall behind it": "wall", "plate: a machine beside it": "machine"}
MACHINE_BOX_MM = (250.0, 5000.0, -5000.0, 5000.0, -5000.0, 5000.0)  # the box of a machine


def _reach(body: str) -> float:
    """Return half the diagonal of beam or plate in mm."""
    given = setups.thesis_beam() if body == "beam" else setups.thesis_plate()
    return 500 * float(np.hypot(*given.extent))


def free_room(body: str) -> tuple[float, float]:
    """Return the range of distances in mm, from a multiple of 50, 25 or more beyond the structure.

    Examples
    --------
    >>> free_room("beam"), free_room("plate")
    ((350.0, 1500.0), (450.0, 1500.0))
    """
    return 50.0 * float(np.ceil(_reach(body) / 50 + 0.5)), 1500.0


class Planner(request.Study):
    """Planned layouts of beam and plate against those of the thesis, and the cost of limits."""

    name = "planner"
    title = "Planned cameras"
    subject = "design"
    section = "sections 1.2, 3.4, 4.3"
    study = "planner"
    varied = "n_cameras"
    varied_label = "cameras"

    counts: fields.Several[Count] = Field([2, 4, 8, 12], max_length=8)
    """numbers of cameras"""
    resolutions_px: fields.Several[fields.Resolution] = Field(
        [(320, 180), (640, 360), (1280, 720)], max_length=8
    )
    """cameras to choose from: width and height of their images"""
    focal_length_mm: fields.FocalLength = setups.assumed_values("beam")["focal_length_mm"]
    sensor_width_mm: fields.SensorWidth = setups.assumed_values("beam")["sensor_width_mm"]
    beam_amplitude_mm: fields.Positive = setups.assumed_values("beam")["amplitude_mm"]
    """peak of the beam's deflection in every mode"""
    plate_amplitude_mm: fields.Positive = setups.assumed_values("plate")["amplitude_mm"]
    """peak of the plate's deflection in every mode"""
    elevation_deg: Annotated[fields.Real, Field(ge=0, lt=90)] = 5.0
    """lowest elevation of a camera"""
    tilt_deg: Tilt = 75.0
    """largest angle to a marker's normal at which it is read, where it is limited"""
    separation_mm: fields.Separation = 50.0
    target_percent: fields.Positive = 5.0
    """wanted error of the worst mode, for which the cheapest layout is sought"""
    step_deg: fields.Step = 10.0
    starts: fields.Starts = 2
    trials: fields.Shifts = 200
    """random shifts of the pixel grids in each simulation"""

    @property
    def questions(self) -> dict[str, PlanRequest]:
        """Return the requests to the planner, by name."""
        asked: dict[str, dict[str, Any]] = {}
        for body, name in THESIS_QUESTIONS.items():
            near = float(setups.setup_table(body, "arrays")["distance_mm"])
            asked[name] = {"distances_mm": (near, near), "tilt_deg": 90.0}
            asked[READABLE_QUESTIONS[body]] = {"distances_mm": (near, near)}
            asked[FREE_QUESTIONS[body]] = {}
        wall, machine = BLOCKED_QUESTIONS
        asked[wall] = {"forbidden_sectors_deg": [WALL_SECTOR_DEG]}
        asked[machine] = {"forbidden_boxes_mm": [MACHINE_BOX_MM]}
        made = {}
        for name, more in asked.items():
            body = name.partition(":")[0]
            common: dict[str, Any] = {
                "body": body,
                "amplitude_mm": getattr(self, f"{body}_amplitude_mm"),
                "target_percent": None,
                "focal_lengths_mm": [self.focal_length_mm],
                "distances_mm": free_room(body),
                "elevations_deg": (self.elevation_deg, 90.0),
            }
            same = set(type(self).model_fields) & set(PlanRequest.model_fields) - {*common, "cube"}
            common |= {key: getattr(self, key) for key in same}
            made[name] = PlanRequest(**common | more)
        return made

    def thesis_layouts(self, body: str) -> dict[tuple[str, int], Array]:
        """Return places of the thesis's growing arrays, by case and number of cameras."""
        order = setups.assumed_values(body)["pair_order"]
        near = setups.setup_table(body, "arrays")["distance_mm"]
        cases = list(setups.camera_pairs())
        grown = setups.array_settings(cases, order, {}, near, self.resolutions_px[0])
        focal = self.focal_length_mm / self.sensor_width_mm
        return {
            (one.case, len(one.directions_deg)): combine_positions(
                np.radians(one.directions_deg), one.distance_mm / 1000, focal
            )
            for one in grown
        }

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        (width, height), *rest = self.resolutions_px
        if any(w * height != h * width for w, h in rest):
            self.refuse("resolutions_px", "allowed: images of one proportion")
        for body, peak in (("beam", self.beam_amplitude_mm), ("plate", self.plate_amplitude_mm)):
            left = free_room(body)[0] - _reach(body)
            if peak >= left:
                allowed = f"a number below {left:.4g} mm, the room before the nearest camera"
                fields.refuse_value(f"{body}_amplitude_mm", peak, f"allowed: {allowed}")
        return self


FIGURE_SETS = [
    FigureSet(
        request=Planner,
        chapter="beyond",
        module=f"{__package__}.compute",
        rooms=("planning",),
        kept=True,
    )
]
