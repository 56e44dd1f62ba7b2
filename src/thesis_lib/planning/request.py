"""Parameters of the planner: structure, cameras to choose from, limits, required accuracy."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.acoustics.planes import PlateSound
from thesis_lib.facts import setups
from thesis_lib.planning.positions import Body, Rules, Scene, build_body
from thesis_lib.studies import fields
from thesis_lib.studies.request import Study, distance_limit, peaks_m, validate_values
from thesis_lib.vibration.structure import Structure

Coordinate = Annotated[fields.Real, Field(ge=-1e5, le=1e5)]
Rise = Annotated[fields.Real, Field(ge=-90, le=90)]
Tilt = Annotated[fields.Real, Field(gt=0, le=90)]
MAX_CAMERAS = 24
Count = Annotated[fields.Whole, Field(ge=2, le=MAX_CAMERAS)]
Box = tuple[Coordinate, Coordinate, Coordinate, Coordinate, Coordinate, Coordinate]
Sphere = tuple[Coordinate, Coordinate, Coordinate, fields.Positive]
Sector = tuple[fields.Azimuth, fields.Azimuth, Rise, Rise]
MIN_FRAMES_PER_PERIOD = 2.5
AUDIBLE_TARGET = "plate", 1.0, "mean"  # body, in_view and objective of plans for sound
SOUND_ONLY = 'allowed: "shape", or for the plate, with in_view 1 and objective "mean", a sound'


class PlanRequest(Study):
    """Parameters of a camera plan; the strings below fields are their descriptions for users."""

    name = "plan"
    title = "Where cameras should stand"
    subject = "design"
    section = "sections 1.2, 3.4, 4.3"
    study = "plan"
    varied = "n_cameras"
    varied_label = "cameras"

    body: Literal["beam", "plate"] = "beam"
    """structure to measure, unless a file describes it"""
    plate_mm: tuple[fields.Positive, fields.Positive, fields.Positive] | None = None
    """length, width and thickness of the plate, whose material, support and numbers of markers are
    those of the thesis; null: the thesis's plate"""
    modes: fields.Several[fields.Mode] = [1, 2, 3]
    """modes to measure"""
    amplitude_mm: fields.Positive | list[fields.Positive] = 5.0
    """peak of the deflection over the structure"""
    target_percent: fields.Positive | None = 5.0
    """largest error allowed in any mode, in % of the largest deflection of its markers; null: find
    the least error only"""
    goal: Literal["shape", "sound", "sound-plane", "sound-point", "sound-power"] = "shape"
    """quantity whose error is minimised: the deflection shape, or the sound that the plate
    radiates: its field on two planes or on one, the pressure at a point, or the power"""
    plane: Literal["XZ", "YZ"] = "XZ"
    """plane through the centre for goal "sound-plane": along the plate, or across it"""
    point_mm: tuple[Coordinate, Coordinate, fields.Positive] | None = None
    """point of the pressure for goal "sound-point": X, Y from the centre, Z above it"""
    objective: Literal["mean", "worst"] = "mean"
    """error of a mode that is minimised: the mean (rms) over its markers, or the worst marker's"""
    counts: fields.Several[Count] = [2, 3, 4, 6, 8]
    """numbers of cameras to consider"""
    resolutions_px: fields.Several[fields.Resolution] = Field(
        [(320, 180), (640, 360), (1280, 720), (1920, 1080)], max_length=20
    )
    """cameras to choose from: width and height of their images"""
    prices: list[fields.Positive] = []
    """price of each of resolutions_px; empty: a layout costs its pixels per second"""
    frame_rates_hz: fields.Several[fields.Positive] = Field(
        [30.0, 60.0, 120.0, 240.0, 500.0, 1000.0, 2000.0, 4000.0],
        description="frame rates that the cameras have; the plan uses the lowest that is "
        f"{MIN_FRAMES_PER_PERIOD:g} times the highest mode's frequency",
    )
    focal_lengths_mm: fields.Several[fields.Positive] = Field([24.0], max_length=6)
    """focal lengths to choose from, camera by camera"""
    sensor_width_mm: fields.SensorWidth = 36.0
    distances_mm: tuple[fields.Positive, fields.Positive] = (500.0, 1500.0)
    """least and largest distance of a camera from the structure's centre"""
    azimuths_deg: tuple[fields.Azimuth, fields.Azimuth] = (-180.0, 180.0)
    """least and largest azimuth of a camera, from +Y towards +X"""
    elevations_deg: tuple[Rise, Rise] = (5.0, 90.0)
    """least and largest elevation of a camera over the XY plane"""
    forbidden_boxes_mm: fields.Distinct[Box] = Field([], max_length=50)
    """boxes in which no camera may stand, in the structure's frame: [x least, x largest, y least, y
    largest, z least, z largest]"""
    forbidden_spheres_mm: fields.Distinct[Sphere] = Field([], max_length=50)
    """spheres in which no camera may stand, in the structure's frame: [x, y, z, radius]"""
    forbidden_sectors_deg: fields.Distinct[Sector] = Field([], max_length=50)
    """directions in which no camera may stand: [azimuth least, largest, elevation least, largest]
    """
    tilt_deg: Tilt = 75.0
    """largest angle between a marker's normal and the line of sight at which it is detected"""
    in_view: Annotated[fields.Real, Field(gt=0, le=1)] = 1.0
    """fraction of the markers that each camera must detect; it measures those alone"""
    separation_mm: fields.Separation = 100.0
    estimator: fields.Estimator = "least-squares"
    """how the simulation estimates points; predictions assume least squares"""
    step_deg: fields.Step = 10.0
    starts: fields.Starts = 3

    @property
    def structure(self) -> Structure:
        """The beam or the plate of the thesis, or a plate of another size."""
        if self.body == "beam":
            return setups.thesis_beam()
        plate = setups.thesis_plate()
        if self.plate_mm is None:
            return plate
        length, width, thickness = (side / 1000 for side in self.plate_mm)
        x, y = plate.force_position
        return replace(
            plate,
            length=length,
            width=width,
            thickness=thickness,
            force_position=(x * length / plate.length, y * width / plate.width),
        )

    @property
    def measured(self) -> Body:
        """Return the body with the requested modes."""
        return build_body(self.structure, self.body, self.modes)

    @property
    def sounds(self) -> tuple[PlateSound, ...]:
        """Return the sound that the plate radiates in these modes."""
        from thesis_lib.planning.sound import compute_sounds

        goal: Any = self.goal
        return compute_sounds(tuple(self.modes), self.peaks_m, goal, self.plane, self.point_mm)

    @property
    def peaks_m(self) -> tuple[float, ...]:
        """Return the peak deflection of each mode in m."""
        return tuple(peaks_m(self.structure, self.modes, self.amplitude_mm))

    def scene(self, body: Body | None = None, kind: int = 0) -> Scene:
        """Return the body, peaks and rules, with the aspect ratio of the resolution `kind`."""
        least, most = self.distances_mm
        low, high = np.radians(self.azimuths_deg).tolist()
        bottom, top = np.radians(self.elevations_deg).tolist()
        rules = Rules(
            distances=(least / 1000, most / 1000),
            azimuths=(low, high),
            elevations=(bottom, top),
            tilt=math.radians(self.tilt_deg),
            in_view=self.in_view,
            separation=self.separation_mm / 1000,
            boxes=np.array(self.forbidden_boxes_mm, float).reshape(-1, 3, 2) / 1000,
            spheres=np.array(self.forbidden_spheres_mm, float).reshape(-1, 4) / 1000,
            sectors=np.radians(np.array(self.forbidden_sectors_deg, float).reshape(-1, 4)),
        )
        width, height = self.resolutions_px[kind]
        focals = tuple(f / self.sensor_width_mm for f in self.focal_lengths_mm)
        return Scene(body or self.measured, self.peaks_m, rules, focals, height / width)

    def frame_rate(self, body: Body) -> float:
        """Return the lowest frame rate in Hz that the highest mode allows."""
        needed = MIN_FRAMES_PER_PERIOD * float(body.frequencies.max())
        enough = [rate for rate in self.frame_rates_hz if rate >= needed * (1 - 1e-9)]
        if not enough:
            highest = int(np.argmax(body.frequencies))
            mode = f"mode {body.modes[highest]} has {body.frequencies[highest]:.4g} Hz"
            least = fields.format_limit(needed, upper=False)
            allowed = f"one of {least} Hz or more, since {mode}"
            fields.refuse_value("frame_rates_hz", self.frame_rates_hz, f"allowed: {allowed}")
        return min(enough)

    def check_with(self, body: Body) -> None:
        """Refuse distances, amplitudes, frame rates or a goal that do not fit a body."""
        if isinstance(self.amplitude_mm, list) and len(self.amplitude_mm) != len(self.modes):
            self.refuse("amplitude_mm", "allowed: a number, or a list with one for each mode")
        reach = 1000 * (body.reach + max(self.peaks_m))
        if self.distances_mm[0] <= reach:
            fields.refuse_value("distances_mm", list(self.distances_mm), distance_limit(reach))
        self.frame_rate(body)
        if self.goal != "shape" and body.name != self.body:
            self.refuse("goal", SOUND_ONLY)
        if self.goal != "shape":
            _ = self.sounds  # refuses silent modes

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        turn, ordered = "at most 360° apart", "allowed: the least before the largest"
        for name in ("distances_mm", "azimuths_deg", "elevations_deg"):
            low, high = getattr(self, name)
            if low > high or (name == "azimuths_deg" and high > low + 360):
                apart = f", {turn}" if name == "azimuths_deg" else ""
                self.refuse(name, f"allowed: [least, largest]{apart}")
        for box in self.forbidden_boxes_mm:
            if not (box[0] < box[1] and box[2] < box[3] and box[4] < box[5]):
                self.refuse("forbidden_boxes_mm", ordered)
        for west, east, bottom, top in self.forbidden_sectors_deg:
            if not (west <= east <= west + 360 and bottom <= top):
                self.refuse("forbidden_sectors_deg", f"{ordered}, azimuths {turn}")
        if self.goal != "shape" and (self.body, self.in_view, self.objective) != AUDIBLE_TARGET:
            self.refuse("goal", SOUND_ONLY)
        if (self.point_mm is not None) != (self.goal == "sound-point"):
            self.refuse("point_mm", 'allowed: null, or with goal "sound-point" [X, Y, Z]')
        if self.plane != "XZ" and self.goal != "sound-plane":
            self.refuse("plane", 'allowed: "XZ", or with goal "sound-plane" "YZ"')
        if self.plate_mm and (self.body, self.goal) != ("plate", "shape"):
            self.refuse("plate_mm", 'allowed with body "plate" and goal "shape", else null')
        if self.prices and len(self.prices) != len(self.resolutions_px):
            self.refuse("prices", "allowed: none, or one for each of resolutions_px")
        return self


def plan_request(values: Mapping[str, Any]) -> PlanRequest:
    """Validate parameters of ``thesis plan``."""
    return validate_values(PlanRequest, values)
