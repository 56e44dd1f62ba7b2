"""The parameters of a rendered rig."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.readings import reading
from thesis_lib.laboratory.filming import EDGE, Noise, off_centre
from thesis_lib.studies.request import permitted, refuse
from thesis_lib.studies.vocabulary import Positive, field

NAMES = "ABCD"
POSITIVE = "a number above 0, at most 100000"

RIG = setups.table("experiment", "rig") | reading("experiment")


class Rig(BaseModel):
    """Parameters of what is filmed, and with what."""

    focal_length_mm: Positive = field(
        RIG["focal_length_mm"], "focal length of the lenses", POSITIVE
    )
    sensor_width_mm: Positive = field(RIG["sensor_width_mm"], "width of the sensors", POSITIVE)
    distance_mm: Positive = field(
        RIG["distance_mm"],
        "distance of the cameras from the beam's centre",
        "a number above the beam's reach, at most 100000",
    )
    azimuth_deg: Annotated[float, Field(gt=0, lt=90)] = field(
        RIG["azimuth_deg"],
        "A and B stand at plus and minus this azimuth, C and D opposite",
        "a number above 0 and below 90",
    )
    elevation_deg: Annotated[float, Field(ge=15, le=60)] = field(
        RIG["elevation_deg"], "elevation of the cameras", "a number from 15 to 60"
    )
    lens_k1: Annotated[float, Field(ge=-0.3, le=0.3)] = field(
        RIG["lens_k1"], "first coefficient of the lens distortion", "a number from -0.3 to 0.3"
    )
    frequency_hz: Annotated[float, Field(ge=1)] = field(
        RIG["frequency_hz"],
        "frequency of the vibration",
        "a number from 1 to 0.4 of the frame rate",
    )
    amplitude_mm: Annotated[float, Field(gt=0, le=6)] = field(
        RIG["amplitude_mm"], "deflection of the beam's tip", "a number above 0, at most 6"
    )
    frame_rate_hz: Annotated[float, Field(ge=10, le=240)] = field(
        RIG["frame_rate_hz"], "frames per second", "a number from 10 to 240"
    )
    exposure_ms: Positive = field(
        RIG["exposure_ms"],
        "exposure time of a frame",
        "a number above 0, at most the time between frames",
    )
    shot_noise: Noise = field(
        RIG["shot_noise"], "variance of the noise over the grey level", "a number from 0 to 50"
    )
    read_noise: Noise = field(
        RIG["read_noise"],
        "standard deviation of the dark noise in grey levels",
        "a number from 0 to 50",
    )
    audio_noise_db: Annotated[float, Field(ge=0, le=120)] = field(
        RIG["audio_noise_db"], "force over noise on the audio tracks", "a number from 0 to 120"
    )
    codec: Literal["lossless", "h264"] = field(
        "lossless",
        "how the videos are kept; H.264 swallows part of motions well below a pixel",
        '"lossless" or "h264" (at crf 23)',
    )

    @model_validator(mode="after")
    def _check_rig(self) -> Rig:
        if self.frequency_hz > 0.4 * self.frame_rate_hz:
            refuse("frequency_hz", self.frequency_hz, permitted(type(self), "frequency_hz"))
        if self.exposure_ms > 1000 / self.frame_rate_hz:
            refuse("exposure_ms", self.exposure_ms, permitted(type(self), "exposure_ms"))
        reach = 1000 * math.hypot(*setups.beam().extent) / 2 + self.amplitude_mm
        if self.distance_mm <= reach:
            refuse("distance_mm", self.distance_mm, f"allowed: more than {reach:.4g} mm, the reach "
                   "of the structure and its deflection")  # fmt: skip
        extent, lift = setups.beam().extent, self.amplitude_mm / 1000
        directions = self.directions_deg.values()
        if (
            max(off_centre(self, extent, lift, d, self.distance_mm / 1000) for d in directions)
            > EDGE
        ):
            refuse("distance_mm", self.distance_mm, "allowed: so far, or with a focal length so "
                   "short against the sensor, that all cameras see the whole beam")  # fmt: skip
        return self

    @property
    def directions_deg(self) -> dict[str, tuple[float, float]]:
        """Azimuth and elevation of each camera."""
        azimuths = (self.azimuth_deg, -self.azimuth_deg, 180 + self.azimuth_deg,
                    180 - self.azimuth_deg)  # fmt: skip
        return {
            name: (azimuth, self.elevation_deg)
            for name, azimuth in zip(NAMES, azimuths, strict=True)
        }
