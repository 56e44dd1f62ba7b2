"""The parameters of the figure set ``planner``: standard questions to the planner."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.readings import reading
from thesis_lib.facts.setups import Setting
from thesis_lib.planning.places import at
from thesis_lib.planning.request import Count, PlanRequest
from thesis_lib.studies.request import Study, refuse
from thesis_lib.studies.vocabulary import Positive, Resolution, field

THESIS = {"beam": "beam: as free as the thesis", "plate": "plate: as free as the thesis"}
BEHIND = (90.0, 270.0, -90.0, 90.0)  # a sector: what a wall leaves
BESIDE = (250.0, 5000.0, -5000.0, 5000.0, -5000.0, 5000.0)  # a box: what a machine takes


def _reach(body: str) -> float:
    """Half the diagonal of beam or plate in mm."""
    given = setups.beam() if body == "beam" else setups.plate()
    return 500 * float(np.hypot(*given.extent))


def room(body: str) -> tuple[float, float]:
    """Distances in mm, from half a step of 50 mm or more beyond the structure on.

    Examples
    --------
    >>> room("beam"), room("plate")
    ((350.0, 1500.0), (450.0, 1500.0))
    """
    return 50.0 * float(np.ceil(_reach(body) / 50 + 0.5)), 1500.0


class Planner(Study):
    """Planned layouts of beam and plate beside those of the thesis, and what limits cost."""

    name = "planner"
    title = "Planned cameras"
    subject = "design"
    section = "sections 1.2, 3.4, 4.3"
    study = "planner"
    varied = "n_cameras"
    varied_label = "cameras"

    counts: list[Count] = field(
        lambda: [2, 4, 8, 12],
        "numbers of cameras",
        "a list of different whole numbers from 2 to 24",
        min_length=1,
        max_length=8,
    )
    resolutions_px: list[Resolution] = field(
        lambda: [(320, 180), (640, 360), (1280, 720)],
        "cameras to choose from: width and height of their pictures",
        "a list of different [width, height] of one proportion, whole numbers from 2 to 20000",
        min_length=1,
        max_length=8,
    )
    focal_length_mm: Positive = field(
        reading("beam")["focal_length_mm"],
        "focal length of the lenses",
        "a number above 0, at most 100000",
    )
    sensor_width_mm: Positive = field(
        reading("beam")["sensor_width_mm"],
        "width of the sensors",
        "a number above 0, at most 100000",
    )
    beam_amplitude_mm: Positive = field(
        reading("beam")["amplitude_mm"],
        "peak of the beam's deflection in every mode",
        "a number above 0, at most 100000",
    )
    plate_amplitude_mm: Positive = field(
        reading("plate")["amplitude_mm"],
        "peak of the plate's deflection in every mode",
        "a number above 0, at most 100000",
    )
    elevation_deg: Annotated[float, Field(ge=0, lt=90)] = field(
        5.0, "lowest elevation of a camera", "a number from 0, below 90"
    )
    tilt_deg: Annotated[float, Field(gt=0, le=90)] = field(
        75.0,
        "largest angle to a marker's normal at which it is read, where that is asked",
        "a number above 0, at most 90",
    )
    separation_mm: Annotated[float, Field(ge=0, le=1e5)] = field(
        50.0, "least distance between two cameras", "a number from 0 to 100000"
    )
    target_percent: Positive = field(
        5.0,
        "wanted error of the worst mode, for which the cheapest layout is sought",
        "a number above 0, at most 100000",
    )
    step_deg: Annotated[float, Field(ge=2, le=45)] = field(
        10.0, "step of the grid on which the search begins", "a number from 2 to 45"
    )
    starts: int = field(
        2,
        "random layouts to begin with, for each number of cameras",
        "a whole number from 0 to 100",
        ge=0,
        le=100,
    )
    trials: int = field(
        200,
        "random shifts of the pixel grids in each simulation",
        "a whole number from 2 to 10000",
        ge=2,
        le=10_000,
    )

    def settings(self) -> list[Setting]:
        """None: layouts are found, not given."""
        return []

    @property
    def questions(self) -> dict[str, PlanRequest]:
        """What the planner is asked, by name."""
        near = {body: float(setups.table(body, "arrays")["distance_mm"]) for body in THESIS}
        asked: dict[str, tuple[str, dict[str, Any]]] = {}
        for body, name in THESIS.items():
            fixed = (near[body], near[body])
            asked[name] = body, {"distances_mm": fixed, "tilt_deg": 90.0}
            asked[f"{body}: markers that can be read"] = body, {"distances_mm": fixed}
            asked[f"{body}: nearer or farther, too"] = body, {"distances_mm": room(body)}
        asked["beam: a wall behind it"] = "beam", {
            "distances_mm": room("beam"), "forbidden_sectors_deg": [BEHIND]}  # fmt: skip
        asked["plate: a machine beside it"] = "plate", {
            "distances_mm": room("plate"), "forbidden_boxes_mm": [BESIDE]}  # fmt: skip
        return {name: self._question(body, more) for name, (body, more) in asked.items()}

    def thesis_layouts(self, body: str) -> dict[tuple[str, int], NDArray[np.float64]]:
        """Places of the thesis's growing arrays, by case and number of cameras."""
        order, near = reading(body)["pair_order"], setups.table(body, "arrays")["distance_mm"]
        grown = setups.array_settings(list(setups.pairs()), order, {}, near, self.resolutions_px[0])
        focal = self.focal_length_mm / self.sensor_width_mm
        return {
            (one.case, len(one.directions_deg)):
                at(np.radians(one.directions_deg), one.distance_mm / 1000, focal)
            for one in grown
        }  # fmt: skip

    def _question(self, body: str, more: dict[str, Any]) -> PlanRequest:
        amplitude = self.beam_amplitude_mm if body == "beam" else self.plate_amplitude_mm
        common: dict[str, Any] = {
            "body": body, "amplitude_mm": amplitude, "target_percent": None,
            "focal_lengths_mm": [self.focal_length_mm],
            "elevations_deg": (self.elevation_deg, 90.0),
            **{key: getattr(self, key) for key in (
                "counts", "resolutions_px", "sensor_width_mm", "tilt_deg", "separation_mm",
                "step_deg", "starts", "trials", "seed")},
        }  # fmt: skip
        return PlanRequest(**{**common, **more})

    @model_validator(mode="after")
    def _check_together(self) -> Planner:
        (width, height), *rest = self.resolutions_px
        if any(w * height != h * width for w, h in rest):
            self.refuse("resolutions_px")
        for body, peak in (("beam", self.beam_amplitude_mm), ("plate", self.plate_amplitude_mm)):
            left = room(body)[0] - _reach(body)
            if peak >= left:
                refuse(f"{body}_amplitude_mm", peak, f"allowed: a number below {left:.4g} mm, "
                       "the room before the nearest camera")  # fmt: skip
        return self
