"""The parameters of chapter 5: the laboratory, and what is studied on its recordings."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Annotated, Literal

from pydantic import BaseModel, Field, model_validator

from thesis_lib import setups
from thesis_lib.camera_study import (
    Positive,
    Study,
    Width,
    field,
    permitted,
    refuse,
)
from thesis_lib.experiment.filming import EDGE, Noise, off_centre
from thesis_lib.setups import Setting

RIG = setups.table("experiment", "rig") | setups.reading("experiment")
NAMES = "ABCD"
TRIED_PX = 320  # the thesis tried this width, and gave it up
METHODS = ("matched", "literal", "aligned", "harmonic")
Method = Literal["matched", "literal", "aligned", "harmonic"]
FilmedWidth = Annotated[int, Field(ge=160, le=1920)]
POSITIVE = "a number above 0, at most 100000"


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


class Laboratory(Rig, Study):
    """One set of recordings, measured once for all studies that use it."""

    name = "laboratory"
    title = "Experiment: the recordings"
    subject = "experiment"
    study = "laboratory"
    varied = "width_px"
    varied_label = "resolution"

    widths_px: list[Width]

    def settings(self) -> list[Setting]:
        """Nothing is varied."""
        return []


class Experiment(Rig, Study):
    """Parameters that the studies of chapter 5 share."""

    subject = "experiment"
    first = "the chain's result"
    predicts = "noise of the centres"
    draws = "starts, clocks and noise"

    trials: int = field(
        200,
        "further runs, with centre noise, clocks and starts drawn at random",
        "a whole number from 0 to 10000",
        ge=0,
        le=10_000,
    )
    seed: int = field(0, "seed of all noise", "a whole number from 0 to 2^63 - 1", ge=0, lt=2**63)

    @property
    def recordings(self) -> Laboratory:
        """What has to be filmed and followed."""
        raise NotImplementedError

    @property
    def modes(self) -> list[int]:
        """The one mode that chapter 5 measures."""
        return [1]

    def laboratory(self, widths_px: list[int]) -> Laboratory:
        """The recordings that the study needs, followed at all of these widths."""
        widths = sorted({TRIED_PX, *setups.table("experiment", "resolution")["widths_px"],
                         *widths_px})  # fmt: skip
        fields = {name: getattr(self, name) for name in Rig.model_fields}
        return Laboratory(**fields, seed=self.seed, trials=0, widths_px=widths)

    def _setting(self, case: str, value: float, label: str, names: str, width: int) -> Setting:
        directions = tuple(self.directions_deg[name] for name in names)
        size = (width, round(width * 9 / 16))
        return Setting(case, value, label, self.distance_mm, directions, size)


class ExperimentResolution(Experiment):
    """All four cameras with growing resolution (section 5.2.1)."""

    name = "experiment-resolution"
    title = "Experiment: resolution of the cameras"
    study = "resolution"
    varied = "width_px"
    varied_label = "resolution"

    cases: list[Method] = field(
        lambda: list(METHODS),
        "cases to run",
        "a list of different ones of matched, literal, aligned, harmonic",
        min_length=1,
    )
    widths_px: list[FilmedWidth] = field(
        setups.table("experiment", "resolution")["widths_px"],
        "widths of the reduced frames; heights are 9/16 of them",
        "a list of different whole numbers from 160 to 1920",
        min_length=1,
    )

    def settings(self) -> list[Setting]:
        """One setting per method and width."""
        return [
            self._setting(case, width, f"{width}×{round(width * 9 / 16)}", NAMES, width)
            for case in self.cases
            for width in self.widths_px
        ]

    @property
    def recordings(self) -> Laboratory:
        """What has to be filmed and followed."""
        return self.laboratory(self.widths_px)


class ExperimentCameras(Experiment):
    """Two to four cameras (section 5.2.2), and all sets of them (section 5.3)."""

    name = "experiment-cameras"
    title = "Experiment: number of cameras"
    study = "cameras"
    varied = "n_cameras"
    varied_label = "cameras"

    cases: list[Method | Literal["literal-all", "harmonic-all"]] = field(
        lambda: [*METHODS, "literal-all", "harmonic-all"],
        "cases to run",
        "a list of different ones of matched, literal, aligned, harmonic, literal-all, "
        "harmonic-all",
        min_length=1,
    )
    width_px: FilmedWidth = field(
        setups.table("experiment", "cameras")["width_px"],
        "width of the frames; the height is 9/16 of it",
        "a whole number from 160 to 1920",
    )

    def settings(self) -> list[Setting]:
        """A–B, A–B–C, A–B–C–D, or all eleven sets, for each method."""
        every = ["".join(names) for n in (2, 3, 4) for names in combinations(NAMES, n)]
        growing = [NAMES[:n] for n in (2, 3, 4)]
        return [
            self._setting(case, len(names), "–".join(names), names, self.width_px)
            for case in self.cases
            for names in (every if case.endswith("-all") else growing)
        ]

    @property
    def recordings(self) -> Laboratory:
        """What has to be filmed and followed."""
        return self.laboratory([self.width_px])


def method_of(case: str) -> str:
    """The method of a case: matched, literal, aligned or harmonic.

    Examples
    --------
    >>> method_of("harmonic-all")
    'harmonic'
    """
    return case.removesuffix("-all")
