"""The law of rounding, applied to placing cameras: the parameters of ``design-law``."""

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.arrays import Array, NDArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.studies import fields, request
from thesis_lib.vision.cone_law import cone_directions, equal_pixel_rate

MIN_WIDTH_PX = 16  # width of a sensor
MAX_FRAMES = 4000  # of a recording
FULL_HD = (1920, 1080)  # of the two cameras whose pixels per second are shared
Count = Annotated[fields.Whole, Field(ge=2, le=100)]


class DesignLaw(request.Study):
    """The law of rounding, its closed forms, the thesis's findings and its central claim."""

    name = "design-law"
    title = "The law of rounding, for design"
    subject = "design"
    section = "sections 1.2, 3.4, 4.3"
    study = "law"
    varied = "n_cameras"
    varied_label = "cameras"

    focal_length_mm: fields.FocalLength = setups.assumed_values("beam")["focal_length_mm"]
    sensor_width_mm: fields.SensorWidth = setups.assumed_values("beam")["sensor_width_mm"]
    resolution_px: fields.Resolution = tuple(
        setups.setup_table("beam", "distance")["resolution_px"]
    )
    """width and height of the sensors, of the cone and where numbers are compared"""
    cone_distance_mm: fields.Positive = 1000.0
    """distance of cameras on a cone"""
    cone_deg: fields.Angle = 55.0
    """angle of the cone, from the normal"""
    cone_cameras: Annotated[fields.Whole, Field(ge=3, le=100)] = 6
    """cameras where the angle of the cone varies"""
    amplitude_mm: fields.Positive = setups.assumed_values("beam")["amplitude_mm"]
    """peak of the beam's vibration at equal pixel rates"""
    small_amplitude_mm: fields.Positive = 0.02
    """peak of a vibration far below a pixel"""
    pixels_per_second: Annotated[fields.Real, Field(ge=1e4, le=1e13)] = float(
        2 * math.prod(FULL_HD) * setups.setup_table("experiment", "rig")["frame_rate_hz"]
    )
    """pixels per second of all cameras together; the default is two cameras of chapter 5"""
    counts: fields.Several[Count] = [2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64]
    """numbers of cameras that share the pixels"""
    frame_rates_hz: fields.Several[fields.Positive] = [60.0, 240.0, 960.0]
    """frames per second that each of them takes"""
    frequency_hz: fields.Positive = 7.3
    """frequency of the vibration that is fitted, at most 0.4 of the lowest frame rate"""
    duration_s: Annotated[fields.Real, Field(gt=0, le=10)] = 1.0
    """duration of the recording"""
    trials: fields.Shifts = 200

    @property
    def shared(self) -> tuple[NDArray[np.int_], NDArray[np.int_], Array]:
        """Widths, heights and frame rates (counts, rates) of cameras that share the pixels."""
        counts = np.array(self.counts)[:, None]
        return equal_pixel_rate(self.pixels_per_second, counts, self.frame_rates_hz)

    def settings(self) -> list[setups.Setting]:
        """Return cameras that share the pixels: for each number of them, each frame rate."""
        width, height, rate = self.shared
        made = []
        for i, k in np.ndindex(width.shape):
            count = self.counts[i]
            angles = np.degrees(cone_directions(np.radians(self.cone_deg), count)).T.tolist()
            directions = tuple((azimuth, elevation) for azimuth, elevation in angles)
            label, far = f"{count} cameras", self.cone_distance_mm
            size = int(width[i, k]), int(height[i, k])
            case = f"{rate[i, k]:.4g} Hz"
            made.append(setups.Setting(case, count, label, far, directions, size))
        return made

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        peak = max(self.amplitude_mm, self.small_amplitude_mm)
        bodies = setups.thesis_beam(), setups.thesis_plate()
        farther = max(1000 * math.hypot(*body.extent) / 2 for body in bodies) + peak
        if self.cone_distance_mm <= farther:
            self.refuse("cone_distance_mm", request.distance_limit(farther))
        width = self.shared[0]
        if width.min() < MIN_WIDTH_PX or width.max() > 20_000:
            why = f"allowed: rates that leave each camera a sensor {MIN_WIDTH_PX} to 20000 px wide"
            self.refuse("frame_rates_hz", why)
        if self.duration_s * max(self.frame_rates_hz) > MAX_FRAMES:
            self.refuse("duration_s", f"allowed: at most {MAX_FRAMES} frames")
        low, high = 1 / self.duration_s, 0.4 * min(self.frame_rates_hz)
        if not low <= self.frequency_hz <= high:
            why = "from one over the duration to 0.4 of the lowest frame rate"
            self.refuse("frequency_hz", f"allowed: {low:.4g} to {high:.4g} Hz, {why}")
        return self


FIGURE_SETS = [
    FigureSet(
        request=DesignLaw,
        chapter="beyond",
        module=f"{__package__}.compute",
        rooms=("figure_sets/parametric",),
        kept=True,
    )
]
