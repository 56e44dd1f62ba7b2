"""The parameters of a rendered rig."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.readings import reading
from thesis_lib.laboratory.filming import EDGE, IN_VIEW, off_centre
from thesis_lib.studies.refusals import permitted, refuse
from thesis_lib.studies.request import beyond
from thesis_lib.studies.vocabulary import (
    BeamDistance,
    Distortion,
    Exposure,
    Fields,
    FocalLength,
    ReadNoise,
    RigAzimuth,
    RigRate,
    SensorWidth,
    ShotNoise,
    TipPeak,
    field,
)

NAMES = "ABCD"
RIG = setups.table("experiment", "rig") | reading("experiment")


class Rig(Fields):
    """Parameters of what is rendered, and with what."""

    focal_length_mm: FocalLength = RIG["focal_length_mm"]
    sensor_width_mm: SensorWidth = RIG["sensor_width_mm"]
    distance_mm: BeamDistance = RIG["distance_mm"]
    azimuth_deg: RigAzimuth = RIG["azimuth_deg"]
    elevation_deg: Annotated[float, Field(ge=15, le=60)] = field(
        RIG["elevation_deg"], "elevation of the cameras"
    )
    lens_k1: Distortion = RIG["lens_k1"]
    frequency_hz: Annotated[float, Field(ge=1)] = field(
        RIG["frequency_hz"],
        "frequency of the vibration",
        "a number from 1 to 0.4 of the frame rate",
    )
    amplitude_mm: TipPeak = RIG["amplitude_mm"]
    frame_rate_hz: RigRate = RIG["frame_rate_hz"]
    exposure_ms: Exposure = RIG["exposure_ms"]
    shot_noise: ShotNoise = RIG["shot_noise"]
    read_noise: ReadNoise = RIG["read_noise"]
    audio_noise_db: Annotated[float, Field(ge=0, le=120)] = field(
        RIG["audio_noise_db"], "force over noise on the audio tracks"
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
            refuse("distance_mm", self.distance_mm, beyond(reach))
        extent, lift, far = setups.beam().extent, self.amplitude_mm / 1000, self.distance_mm / 1000
        cameras = self.directions_deg.values()
        if max(off_centre(self, extent, lift, each, far) for each in cameras) > EDGE:
            refuse("distance_mm", self.distance_mm, IN_VIEW)
        return self

    @property
    def directions_deg(self) -> dict[str, tuple[float, float]]:
        """Azimuth and elevation of each camera."""
        a = self.azimuth_deg
        azimuths = (a, -a, 180 + a, 180 - a)
        return {name: (b, self.elevation_deg) for name, b in zip(NAMES, azimuths, strict=True)}
