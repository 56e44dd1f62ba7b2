"""The parameters of ``lab-equal-pixels``: rigs that have equal pixels per second in all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.readings import reading
from thesis_lib.facts.setups import Setting
from thesis_lib.laboratory.filming import LabStudy, check_place
from thesis_lib.studies.refusals import permitted, refuse
from thesis_lib.studies.shared_fields import Grid
from thesis_lib.studies.vocabulary import (
    Angle,
    Distortion,
    Exposure,
    FocalLength,
    Peak,
    Positive,
    ReadNoise,
    SensorWidth,
    Several,
    ShotNoise,
    field,
)
from thesis_lib.vibration.plate import Plate
from thesis_lib.vision.cone_law import cone_directions, equal_pixel_rate

READING = reading("experiment")
RECORDED = 19  # further recordings of each rig that are data
FASTEST = 0.22  # of the frame rate; the second harmonic is fitted, too
LEAST_FRAMES = 8
Count = Annotated[int, Field(ge=2, le=16)]


@dataclass(frozen=True)
class Kind:
    """So many cameras of one kind, and the markers that they film."""

    count: int  #: How many cameras
    size: tuple[int, int]  #: Width and height of their frames in px
    frame_rate: float  #: Frames per second
    diameter: float  #: Diameter of the markers in mm
    shot_noise: float  #: Variance of the noise over the grey level


class EqualPixels(LabStudy):
    """What is filmed: a plate in its first mode, from a cone about its normal."""

    study = "equal-pixels"
    varied = "n_cameras"
    varied_label = "number of cameras N"
    section = "sections 1.2, 5.3"
    first = "first recording"
    predicts = "law of edges"
    draws = "recordings"

    cases: Several[Literal["pixels", "light", "frames"]] = field(
        lambda: ["pixels", "light", "frames"],
        "what fewer cameras have more of: pixels in a frame; such that are smaller and get less "
        "light; frames per second",
    )
    counts: Several[Count] = field(
        lambda: [2, 4, 8, 16], "numbers of cameras that share the pixels per second"
    )
    diameters_mm: Several[Positive] = field(
        lambda: [30.0, 12.0, 8.0],
        "diameters of the markers; cases light and frames have the first",
        "a list of different numbers above 0, at most half of the distance between markers",
    )
    width_px: Annotated[int, Field(ge=160, le=1280)] = field(
        320, "width of the frames of the most cameras; heights are 9/16 of widths"
    )
    frame_rate_hz: Annotated[float, Field(ge=10, le=240)] = field(
        60.0, "about how many frames per second each takes, but in case frames"
    )
    duration_s: Annotated[float, Field(gt=0, le=4)] = field(
        0.32,
        "how long the steady vibration is filmed",
        f"a number above 0, at most 4, that {LEAST_FRAMES} frames fit into",
    )
    frequency_hz: Positive = field(
        12.5,
        "frequency of the vibration",
        f"a number from 1 over the duration to {FASTEST:g} of the frame rate",
    )
    exposure_ms: Exposure = 1.0
    amplitude_mm: Peak = field(
        5.0,
        "peak of the deflection over the plate, in mode 1",
        "a number above 0, at most 100, that leaves each marker nearest to its own place",
    )
    grid: Grid = (6, 4)
    distance_mm: Positive = field(
        1000.0, "distance of the cameras", "a number above the plate's reach, at most 100000"
    )
    cone_deg: Angle = field(55.0, "angle of the cone that they stand on, from the normal")
    focal_length_mm: FocalLength = READING["focal_length_mm"]
    sensor_width_mm: SensorWidth = READING["sensor_width_mm"]
    lens_k1: Distortion = READING["lens_k1"]
    shot_noise: ShotNoise = READING["shot_noise"]
    read_noise: ReadNoise = READING["read_noise"]
    trials: Annotated[int, Field(ge=0, le=1000)] = field(
        RECORDED, "further recordings of each rig, by cameras that are set up anew"
    )

    @property
    def plate(self) -> Plate:
        """The plate with its markers."""
        return setups.plate(self.grid)

    @property
    def modes(self) -> list[int]:
        """The one mode that is filmed."""
        return [1]

    @property
    def kinds(self) -> dict[tuple[str, int], Kind]:
        """What films each case and number of cameras; markers of case pixels name the case."""
        counts, shot, largest = np.sort(self.counts), self.shot_noise, self.diameters_mm[0]
        coarse = self.width_px, round(self.width_px * 9 / 16)
        shared = float(counts[-1]) * coarse[0] * coarse[1]  # pixels in a frame of all cameras
        shared_out = equal_pixel_rate(shared * self.frame_rate_hz, counts, self.frame_rate_hz)
        alike = {
            int(n): ((int(width), int(height)), float(rate))
            for n, width, height, rate in zip(counts, *shared_out, strict=True)
        }
        finest = alike[int(counts[0])][0][0]
        made: dict[tuple[str, int], Kind] = {}
        for n, (size, rate) in alike.items():
            if "pixels" in self.cases:
                for each in self.diameters_mm:
                    made[f"{each:g} mm", n] = Kind(n, size, rate, each, shot)
            if "light" in self.cases:  # pixels share a sensor of one size
                got = shot * (size[0] / finest) ** 2
                made["light", n] = Kind(n, size, rate, largest, got)
            if "frames" in self.cases:
                often = float(self.frame_rate_hz * counts[-1] / n)
                made["frames", n] = Kind(n, coarse, often, largest, shot)
        order = [case for case, _ in made]
        return dict(sorted(made.items(), key=lambda item: (order.index(item[0][0]), item[0][1])))

    @property
    def filmed_kinds(self) -> list[Kind]:
        """What has to be filmed, each once."""
        return list(dict.fromkeys(self.kinds.values()))

    def settings(self) -> list[Setting]:
        """The rigs, case by case, the fewest cameras first."""
        made = []
        for (case, n), kind in self.kinds.items():
            angles = np.degrees(cone_directions(np.radians(self.cone_deg), n)).T.tolist()
            each = f"{kind.frame_rate:.0f} Hz" if case == "frames" else "{}×{}".format(*kind.size)
            places = tuple((azimuth, elevation) for azimuth, elevation in angles)
            label = f"{n} with {each}"
            made.append(Setting(case, n, label, self.distance_mm, places, kind.size))
        return made

    @model_validator(mode="after")
    def _check_rigs(self) -> EqualPixels:
        rates = [kind.frame_rate for kind in self.kinds.values()]
        if not 1 / self.duration_s <= self.frequency_hz <= FASTEST * self.frame_rate_hz:
            self.refuse("frequency_hz")
        if round(self.duration_s * min(rates)) < LEAST_FRAMES:
            self.refuse("duration_s")
        if self.exposure_ms > 1000 / max(rates):
            refuse("exposure_ms", self.exposure_ms, permitted(type(self), "exposure_ms"))
        lift, plate = self.amplitude_mm / 1000, self.plate
        spacing = min(plate.length / self.grid[0], plate.width / self.grid[1])
        if lift > 0.4 * spacing / np.tan(np.radians(self.cone_deg)):
            self.refuse("amplitude_mm")
        if max(self.diameters_mm) > 1000 * spacing / 2:
            self.refuse("diameters_mm")
        for setting in self.settings():
            check_place(self, plate.extent, lift, setting, "distance_mm", self.distance_mm)
        return self


class LabEqualPixels(EqualPixels):
    """Many coarse cameras against few sharp ones."""

    name = "lab-equal-pixels"
    title = "Laboratory: equal pixels per second"

    @property
    def recordings(self) -> EqualPixelsRecordings:
        """What has to be filmed: the recordings that are data, if they do."""
        fields = self.model_dump(exclude={"cube"})
        whole = EqualPixelsRecordings()
        own = EqualPixelsRecordings(**fields)
        same = own.model_copy(update={"trials": RECORDED}) == whole
        return whole if same and self.trials <= RECORDED else own


class EqualPixelsRecordings(EqualPixels):
    """The recordings, and what was measured on each."""

    name = "lab-equal-pixels-recordings"
    title = "Laboratory: recordings with equal pixels per second"
