"""The parameters of ``lab-elevation`` and ``lab-layout``: where cameras are put, and what it costs.

Both film the beam of chapter 5 in its first mode, with calibration and clocks known, from other
places than the laboratory of the thesis had room for (sections 3.4, 5.3 and 7.1).
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.setups import Direction, Setting
from thesis_lib.laboratory.filming import EDGE, IN_VIEW, Repeated, off_centre
from thesis_lib.laboratory.parameters import RIG
from thesis_lib.studies.refusals import permitted, refuse
from thesis_lib.studies.request import Study, beyond
from thesis_lib.studies.vocabulary import (
    Angle,
    Azimuth,
    BeamDistance,
    Distortion,
    Exposure,
    FilmedWidth,
    FocalLength,
    HalfAperture,
    NoiseSeed,
    Positive,
    ReadNoise,
    RigAzimuth,
    RigRate,
    Runs,
    SensorWidth,
    Several,
    ShotNoise,
    TipPeak,
    field,
)
from thesis_lib.vision.pinhole import hemisphere_directions

LEAST_FRAMES = 8  # in a period
NAMES = "ABCDEFGH"
TriedElevation = Annotated[float, Field(ge=1, le=80)]


class Layouts(Repeated, Study):
    """What both studies render, and with what."""

    subject = "lab"
    section = "section 5.3"
    varied_label = "layout"
    first = "rendered run"
    predicts = "law, centres equally exact"
    draws = "noise of the centres"

    focal_length_mm: FocalLength = RIG["focal_length_mm"]
    sensor_width_mm: SensorWidth = RIG["sensor_width_mm"]
    lens_k1: Distortion = RIG["lens_k1"]
    frequency_hz: Annotated[float, Field(ge=1)] = field(
        RIG["frequency_hz"],
        "frequency of the vibration",
        "a number from 1 to an eighth of the frame rate",
    )
    amplitude_mm: TipPeak = RIG["amplitude_mm"]
    frame_rate_hz: RigRate = RIG["frame_rate_hz"]
    periods: Annotated[int, Field(ge=1, le=20)] = field(
        1, "periods of the steady vibration that are rendered"
    )
    exposure_ms: Exposure = 1.0
    shot_noise: ShotNoise = RIG["shot_noise"]
    read_noise: ReadNoise = RIG["read_noise"]
    distance_mm: BeamDistance = RIG["distance_mm"]
    width_px: FilmedWidth = field(1920, "width of the frames; the height is 9/16 of it")
    trials: Runs = field(200, "further runs, with noise of the centres drawn at random")
    seed: NoiseSeed = 0

    @property
    def modes(self) -> list[int]:
        """The one mode that is rendered."""
        return [1]

    @property
    def recordings(self) -> Study:
        """The same without trials and file: what has to be rendered."""
        return self.model_copy(update={"trials": 0, "repeats": "kept", "cube": ""})

    def recorded(self, setting: Setting) -> Setting:
        """The recording that holds a setting's cameras: its own, if it shares none."""
        return setting

    def filmed_settings(self) -> list[Setting]:
        """What has to be rendered, each once."""
        return list(dict.fromkeys(map(self.recorded, self.settings())))

    def blamed(self, case: str) -> str:
        """The parameter that decides whether the cameras of a case see the whole beam."""
        return "distance_mm"

    def varied_of(self, case: str) -> str:
        """What varies in a case."""
        return self.varied

    @model_validator(mode="after")
    def _check_layouts(self) -> Layouts:
        kind, rate = type(self), self.frame_rate_hz
        if self.frequency_hz > rate / LEAST_FRAMES:
            refuse("frequency_hz", self.frequency_hz, permitted(kind, "frequency_hz"))
        if self.exposure_ms > 1000 / rate:
            refuse("exposure_ms", self.exposure_ms, permitted(kind, "exposure_ms"))
        extent, lift = setups.beam().extent, self.amplitude_mm / 1000
        reach = 1000 * math.hypot(*extent) / 2 + self.amplitude_mm
        for recording in self.filmed_settings():
            name, given = self.blamed(recording.case), recording.distance_mm
            if given <= reach:
                refuse(name, given, beyond(reach))
            far = recording.distance_mm / 1000
            if max(off_centre(self, extent, lift, d, far) for d in recording.directions_deg) > EDGE:
                refuse(name, given, f"{IN_VIEW} (case {recording.case}, {recording.label})")
        return self


def _size(width: int) -> tuple[int, int]:
    return width, round(width * 9 / 16)


class LabElevation(Layouts):
    """Four cameras at growing elevation: sensitivity against localisation (section 3.4)."""

    name = "lab-elevation"
    title = "Laboratory: elevation of the cameras"
    study = "elevation"
    varied = "elevation_deg"
    varied_label = "elevation φ"

    cases: Several[Literal["three-rows", "middle-row", "coarse"]] = field(
        lambda: ["three-rows", "middle-row", "coarse"], "cases to run"
    )
    elevations_deg: Several[TriedElevation] = field(
        lambda: [3.0, 5.0, 7.0, 9.0, 12.0, 16.0, 22.0, 35.0, 60.0], "elevations of the cameras"
    )
    azimuth_deg: RigAzimuth = RIG["azimuth_deg"]
    coarse_width_px: FilmedWidth = field(
        1280, "width of the frames in case coarse; the height is 9/16 of it"
    )

    def settings(self) -> list[Setting]:
        """One setting per case and elevation."""
        a = self.azimuth_deg
        azimuths = (a, -a, 180 + a, 180 - a)

        def setting(case: str, elevation: float) -> Setting:
            size = _size(self.coarse_width_px if case == "coarse" else self.width_px)
            directions = tuple((azimuth, elevation) for azimuth in azimuths)
            label = f"{elevation:g}°"
            return Setting(case, elevation, label, self.distance_mm, directions, size)

        return [setting(case, phi) for case in self.cases for phi in self.elevations_deg]


class LabLayout(Layouts):
    """Distance, aperture and number of cameras, rendered (sections 5.3 and 7.1)."""

    name = "lab-layout"
    title = "Laboratory: layout of the cameras"
    study = "layout"
    varied = "layout"

    cases: Several[Literal["distance", "aperture", "subsets"]] = field(
        lambda: ["distance", "aperture", "subsets"], "cases to run"
    )
    distances_mm: Several[Positive] = field(
        lambda: [550.0, 750.0, 1000.0, 1500.0],
        "distances of a pair from the beam's centre, case distance",
        "a list of different numbers above the beam's reach, at most 100000",
    )
    azimuth_deg: Angle = field(
        30.0, "the pair of case distance stands at plus and minus this azimuth"
    )
    half_apertures_deg: Several[HalfAperture] = field(
        lambda: [8.0, 30.0, 55.0, 80.0],
        "half of the azimuths between the cameras of a pair, case aperture",
    )
    distance_mm: BeamDistance = field(
        RIG["distance_mm"],
        "distance of the cameras from the beam's centre, cases aperture and subsets",
    )
    elevation_deg: TriedElevation = field(
        RIG["elevation_deg"], "elevation of the pairs of cases distance and aperture"
    )
    directions_deg: list[tuple[Azimuth, TriedElevation]] = field(
        lambda: (
            [(azimuth, 22.0) for azimuth in (10.0, -10.0, 190.0, 170.0, 60.0, -60.0)]
            + [(225.0, 40.0), (135.0, 40.0)]
        ),
        "[azimuth, elevation] of cameras A, B … of case subsets",
        "a list of 2 to 8 different [azimuth, elevation], azimuth -360 to 360, elevation 1 to 80",
        min_length=2,
        max_length=8,
    )

    @model_validator(mode="after")
    def _check_places(self) -> LabLayout:
        azimuth, elevation = np.radians(self.directions_deg).T
        places = hemisphere_directions(azimuth, elevation)
        apart = np.linalg.norm(places[:, None] - places, axis=2)
        if np.any(apart[np.triu_indices(len(places), k=1)] < 1e-6):
            self.refuse("directions_deg")
        return self

    def settings(self) -> list[Setting]:
        """A pair at each distance, a pair of each aperture, every set of the cameras."""
        size, phi, far = _size(self.width_px), self.elevation_deg, self.distance_mm
        every, pair = range(len(self.directions_deg)), _pair(self.azimuth_deg, phi)
        made = {
            "distance": [
                Setting("distance", d, f"{d:g} mm", d, pair, size) for d in self.distances_mm
            ],
            "aperture": [
                Setting("aperture", 2 * half, f"{2 * half:g}°", far, _pair(half, phi), size)
                for half in self.half_apertures_deg
            ],
            "subsets": [self._set(some) for n in every[1:] for some in combinations(every, n + 1)],
        }
        return [setting for case in self.cases for setting in made[case]]

    def _set(self, chosen: tuple[int, ...]) -> Setting:
        label = "–".join(NAMES[i] for i in chosen)
        directions = tuple(self.directions_deg[i] for i in chosen)
        size = _size(self.width_px)
        return Setting("subsets", len(chosen), label, self.distance_mm, directions, size)

    def recorded(self, setting: Setting) -> Setting:
        """All sets of cameras are parts of one recording."""
        every = tuple(range(len(self.directions_deg)))
        return self._set(every) if setting.case == "subsets" else setting

    def blamed(self, case: str) -> str:
        """The parameter that decides whether the cameras of a case see the whole beam."""
        return "distances_mm" if case == "distance" else "distance_mm"

    def varied_of(self, case: str) -> str:
        """What varies in a case."""
        return {"distance": "distance_mm", "aperture": "aperture_deg"}.get(case, "n_cameras")


def _pair(half_deg: float, elevation_deg: float) -> tuple[Direction, Direction]:
    return (half_deg, elevation_deg), (-half_deg, elevation_deg)
