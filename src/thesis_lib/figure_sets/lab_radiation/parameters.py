"""The parameters of ``lab-radiation``: structures that sound, and the cameras before them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.facts.readings import reading
from thesis_lib.facts.setups import Direction, Setting
from thesis_lib.laboratory.filming import LabStudy, check_markers, check_place
from thesis_lib.measure.fitting.aliasing import clearance
from thesis_lib.studies.vocabulary import (
    Azimuth,
    BriefExposure,
    Distortion,
    FilmedElevation,
    FocalLength,
    FrameRate,
    Frames,
    Peak,
    Positive,
    ReadNoise,
    SensorWidth,
    Several,
    ShotNoise,
    field,
)

if TYPE_CHECKING:
    from thesis_lib.figure_sets.lab_radiation.structures import Driven

READING, SOUND = reading("experiment"), reading("sound")
RECORDED = 39  # further recordings of each structure that are data
CLEAR = 1.0  # periods that the tone's alias stays away from 0 and from half of the frame rate
LONGEST = 0.8  # of a period that a frame may last
CASES = ("plate", "between", "beam", "l")
Case = Literal["plate", "between", "beam", "l"]


class Radiation(LabStudy):
    """What is rendered: a thin structure at one tone, before three cameras."""

    study = "radiation"
    varied = "cases"
    varied_label = "structure"
    section = "sections 6.1, 6.2"
    first = "first recording"
    predicts = "stated standard errors"
    draws = "recordings"

    cases: Several[Case] = field(
        lambda: list(CASES),
        "what vibrates: a plate in its first mode, or between its first two; a beam in its third; "
        "an L-shaped plate in its first",
    )
    amplitude_mm: Peak = field(
        1.0,
        "largest deflection",
        "a number above 0, at most 100, that leaves each marker nearest to its own place",
    )
    azimuths_deg: Annotated[list[Azimuth], Field(min_length=2, max_length=6)] = field(
        lambda: [-30.0, 30.0, 180.0],
        "azimuths of the cameras",
        "a list of 2 to 6 different numbers from -360 to 360",
    )
    elevation_deg: FilmedElevation = field(45.0, "elevation of the cameras")
    plate_distance_mm: Positive = field(
        950.0,
        "distance of the cameras from a plate's centre",
        "a number above the plate's reach, at most 100000",
    )
    beam_distance_mm: Positive = field(
        620.0,
        "distance of the cameras from the beam's centre",
        "a number above the beam's reach, at most 100000",
    )
    width_px: Annotated[int, Field(ge=320, le=1920)] = field(
        640, "width of the frames; heights are 9/16 of widths"
    )
    frame_rate_hz: FrameRate = field(
        50.0,
        "frames per second",
        "a number from 10 to 5000 that shows the tone at least one period in all frames away "
        "from rest and from half of the rate",
    )
    frames: Frames = 24
    exposure_ms: BriefExposure = 1.0
    focal_length_mm: FocalLength = READING["focal_length_mm"]
    sensor_width_mm: SensorWidth = READING["sensor_width_mm"]
    lens_k1: Distortion = READING["lens_k1"]
    shot_noise: ShotNoise = READING["shot_noise"]
    read_noise: ReadNoise = READING["read_noise"]
    trials: Annotated[int, Field(ge=1, le=1000)] = field(
        RECORDED, "further recordings of each structure, by cameras that are set up anew"
    )

    def settings(self) -> list[Setting]:
        """None: results are a list."""
        return []

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the frames in px."""
        return self.width_px, round(self.width_px * 9 / 16)

    @property
    def directions(self) -> tuple[Direction, ...]:
        """Azimuth and elevation of each camera in degrees."""
        return tuple((azimuth, self.elevation_deg) for azimuth in self.azimuths_deg)

    def distance_field(self, case: str) -> str:
        """The field that tells how far the cameras are from a structure."""
        return "beam_distance_mm" if case == "beam" else "plate_distance_mm"

    def distance_mm(self, case: str) -> float:
        """How far the cameras are from a structure."""
        return float(getattr(self, self.distance_field(case)))

    @model_validator(mode="after")
    def _check_films(self) -> Radiation:
        from thesis_lib.figure_sets.lab_radiation.structures import driven

        for case in self.cases:
            self._check_tone(driven(case))
            self._check_view(case, driven(case))
        return self

    def _check_tone(self, own: Driven) -> None:
        if clearance(own.frequency, self.frame_rate_hz, self.frames) < CLEAR:
            self.refuse("frame_rate_hz")
        if self.exposure_ms > 1000 * min(1 / self.frame_rate_hz, LONGEST / own.frequency):
            self.refuse("exposure_ms")

    def _check_view(self, case: str, own: Driven) -> None:
        lift, name = self.amplitude_mm / 1000, self.distance_field(case)
        distance = self.distance_mm(case)
        setting = Setting(case, distance, case, distance, self.directions, self.size)
        check_place(self, own.structure.extent, lift, setting, name, distance)
        spacing = float(np.min(own.markers.nearest))
        check_markers(
            self,  # type: ignore[arg-type]  # it has all that is asked for
            spacing,
            own.markers.diameter,
            lift,
            setting,
            "width_px",
            self.width_px,
        )


class LabRadiation(Radiation):
    """From video to sound."""

    name = "lab-radiation"
    title = "Laboratory: from video to sound"

    speed_of_sound_m_s: Positive = field(SOUND["speed_of_sound_m_s"], "speed of sound in the air")
    air_density_kg_m3: Positive = field(SOUND["air_density_kg_m3"], "density of the air")

    @property
    def recordings(self) -> RadiationRecordings:
        """What has to be rendered: the recordings that are data, if they do."""
        own = RadiationRecordings(
            **self.model_dump(include=set(RadiationRecordings.model_fields) - {"cube"})
        )
        whole = RadiationRecordings()
        chosen = {"trials": RECORDED, "cases": list(CASES)}
        same = own.model_copy(update=chosen) == whole
        return whole if same and self.trials <= RECORDED else own


class RadiationRecordings(Radiation):
    """The recordings, and what was measured on each."""

    name = "lab-radiation-recordings"
    title = "Laboratory: recordings of structures that sound"
