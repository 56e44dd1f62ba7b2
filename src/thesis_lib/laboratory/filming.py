"""How things are rendered beyond chapter 5: parameters that recordings share, and what is refused.

A request is refused where its result would say nothing: an alias that no fit can use, a frame that
lasts nearly a period, a motion that looks as large as the way to the next marker, a structure that
is not all in the picture, markers that are hardly a pixel high.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from pydantic import BaseModel

from thesis_lib.facts.readings import reading
from thesis_lib.facts.setups import Direction, Setting
from thesis_lib.measure.fitting.aliasing import clearance
from thesis_lib.studies.refusals import permitted, refuse
from thesis_lib.studies.request import Study
from thesis_lib.studies.vocabulary import (
    BriefExposure,
    Distortion,
    Fields,
    FocalLength,
    Frames,
    NoiseSeed,
    ReadNoise,
    Repeats,
    Runs,
    SensorWidth,
    ShotNoise,
    field,
)
from thesis_lib.vibration.structure import Structure, peak_deflection, resonance
from thesis_lib.vision.pinhole import hemisphere_directions, hemisphere_rotations

CLEAR = 0.5  # periods that an alias stays away from 0 and from half of the frame rate
LONGEST = 0.8  # of a period that a frame may last
NEAR = 0.4  # of the markers' spacing that a marker may seem to move
EDGE = 0.98  # of half the picture that the structure may reach
LEAST = 1.0  # px that a marker's picture is high

READING = reading("experiment")


IN_VIEW = (
    "allowed: so far, or with a focal length so short against the sensor, that all cameras see "
    "the whole beam"
)


class Film(Fields):
    """Parameters of how anything is rendered; recordings add frame rates, modes and amplitudes."""

    focal_length_mm: FocalLength = READING["focal_length_mm"]
    sensor_width_mm: SensorWidth = READING["sensor_width_mm"]
    lens_k1: Distortion = READING["lens_k1"]
    exposure_ms: BriefExposure = 2.0
    frames: Frames = 24
    shot_noise: ShotNoise = READING["shot_noise"]
    read_noise: ReadNoise = READING["read_noise"]


class Repeated(Fields):
    """A figure set whose settings can be rendered again and again."""

    repeats: Repeats = "kept"


class LabStudy(Study):
    """What the studies beyond chapter 5 have in common."""

    subject = "lab"
    section = "section 5.3"
    first = "as rendered"
    predicts = "noise of the centres"

    trials: Runs = field(200, "further runs, with starts and centre noise drawn at random")
    seed: NoiseSeed = 0


def peaks_m(
    structure: Structure, modes: Sequence[int], amplitude_mm: float | list[float] | str
) -> list[float]:
    """Largest deflection of each mode in m; ``force`` is what 1 N makes of it."""
    if isinstance(amplitude_mm, str):
        return [peak_deflection(structure, mode) for mode in modes]
    if isinstance(amplitude_mm, list):
        return [peak / 1000 for peak in amplitude_mm]
    return [amplitude_mm / 1000] * len(modes)


class Lens(Protocol):
    """The parameters of a lens and its sensor."""

    @property
    def focal_length_mm(self) -> float:
        """Focal length in mm."""

    @property
    def sensor_width_mm(self) -> float:
        """Width of the sensor in mm."""

    @property
    def lens_k1(self) -> float:
        """First coefficient of the lens distortion."""


def off_centre(
    film: Lens, extent: tuple[float, float], lift: float, direction: Direction, distance: float
) -> float:
    """How far a structure's corners reach in a 16:9 picture, over half its width or height.

    The structure's `extent` and largest deflection `lift` are in m; the camera looks from a
    `distance` in m in a `direction` of azimuth and elevation in degrees.
    """
    length, width = extent
    sides = (-length / 2, length / 2), (-width / 2, width / 2), (-lift, lift)
    corners = np.array(list(itertools.product(*sides)))
    azimuth, elevation = np.radians(direction)
    rays = corners - distance * hemisphere_directions(azimuth, elevation)
    u, v, depth = hemisphere_rotations(azimuth, elevation) @ rays.T
    if np.any(depth <= 0):
        return math.inf
    half = film.sensor_width_mm / film.focal_length_mm / 2
    spread = 1 + film.lens_k1 * half**2  # lens distortion moves the border by a few percent
    return float(max(np.abs(u / depth).max(), np.abs(v / depth).max() * 16 / 9) * spread / half)


def check_amplitudes(model: type[BaseModel], modes: Sequence[int], amplitude_mm: object) -> None:
    """Refuse a list of amplitudes that has not one for each mode."""
    if isinstance(amplitude_mm, list) and len(amplitude_mm) != len(modes):
        refuse("amplitude_mm", amplitude_mm, permitted(model, "amplitude_mm"))


def check_rates(
    film: Film, structure: Structure, modes: Sequence[int], name: str, rates: Sequence[float]
) -> None:
    """Refuse aliases that no fit can use, and frames that last too long.

    `name` is the field that holds the frame rates.
    """
    hertz = {mode: resonance(structure, mode) / (2 * np.pi) for mode in modes}
    for rate in rates:
        for mode, frequency in hertz.items():
            if clearance(frequency, rate, film.frames) < CLEAR:
                shown = f"rates that show mode {mode}, {frequency:.4g} Hz, at least"
                away = f"{CLEAR * rate / film.frames:.3g} Hz away from 0 and from half of the rate"
                enough = f"{CLEAR:g} periods in {film.frames} frames"
                refuse(name, rate, f"allowed: {shown} {away}, {enough}")
    longest = 1000 * min(1 / max(rates), LONGEST / max(hertz.values()))
    if film.exposure_ms > longest * (1 + 1e-9):
        limits = f"the time between frames and {LONGEST:g} of the shortest period"
        refuse("exposure_ms", film.exposure_ms, f"allowed: at most {longest:.4g} ms, {limits}")


def check_place(
    film: Lens, extent: tuple[float, float], lift: float, setting: Setting, name: str, given: Any
) -> None:
    """Refuse cameras within the structure's reach, or that do not see all of it.

    `name` and `given` are the field that puts the cameras there, and its value.
    """
    reach = 1000 * (math.hypot(*extent) / 2 + lift)
    if setting.distance_mm <= reach:
        far = f"cameras more than {reach:.4g} mm away"
        refuse(name, given, f"allowed: {far}, the reach of the structure and its deflection")
    for direction in setting.directions_deg:
        if off_centre(film, extent, lift, direction, setting.distance_mm / 1000) > EDGE:
            there = f"azimuth {direction[0]:g}°, elevation {direction[1]:g}°"
            one = f"the one at {there}, {setting.distance_mm:g} mm away does not"
            refuse(name, given, f"allowed: cameras that see the whole structure; {one}")


def check_markers(
    film: Film,
    spacing: float,
    diameter: float,
    lift: float,
    setting: Setting,
    name: str,
    given: Any,
) -> None:
    """Refuse markers too small to be found, and motions that bring them near their neighbours."""
    slope = math.radians(min(elevation for _, elevation in setting.directions_deg))
    focal = film.focal_length_mm / film.sensor_width_mm * setting.resolution_px[0]
    high = 1000 * diameter * focal / setting.distance_mm * math.sin(slope)
    if high < LEAST:
        enough = f"markers are at least {LEAST:g} px high, not {high:.2g} px"
        remedy = "wider or nearer ones, or fewer and larger markers"
        refuse(name, given, f"allowed: pictures in which {enough}: {remedy}")
    largest = NEAR * spacing * math.tan(slope)
    if lift > largest:
        seen = f"as seen from an elevation of {math.degrees(slope):.3g}°"
        why = f"peaks of at most {1000 * largest:.3g} mm {seen}, or markers seem to change places"
        refuse("amplitude_mm", film.amplitude_mm, f"allowed: {why}")  # type: ignore[attr-defined]
