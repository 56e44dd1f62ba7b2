"""How things are filmed beyond chapter 5: parameters that recordings share, and what is refused.

A request is refused where its result would say nothing: an alias that no fit can use, a frame that
lasts nearly a period, a motion that looks as large as the way to the next marker, a structure that
is not all in the picture, markers that are hardly a pixel high.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Protocol

import numpy as np
from pydantic import BaseModel, Field

from thesis_lib.facts.readings import reading
from thesis_lib.facts.setups import Direction, Setting
from thesis_lib.measure.fitting.aliasing import clearance
from thesis_lib.studies.request import Study, permitted, refuse
from thesis_lib.studies.vocabulary import Positive, field
from thesis_lib.vibration.structure import Structure, peak_deflection, resonance
from thesis_lib.vision.pinhole import hemisphere_directions, hemisphere_rotations

CLEAR = 0.5  # periods that an alias stays away from 0 and from half of the frame rate
LONGEST = 0.8  # of a period that a frame may last
NEAR = 0.4  # of the markers' spacing that a marker may seem to move
EDGE = 0.98  # of half the picture that the structure may reach
LEAST = 1.0  # px that a marker's picture is high

Rate = Annotated[float, Field(ge=10, le=5000)]
FilmedWidth = Annotated[int, Field(ge=320, le=1920)]
FilmedElevation = Annotated[float, Field(ge=10, le=75)]
Peak = Annotated[float, Field(gt=0, le=100)]
FilmedMode = Annotated[int, Field(ge=1, le=5)]
Noise = Annotated[float, Field(ge=0, le=50)]
READING = reading("experiment")


class Film(BaseModel):
    """Parameters of how anything is filmed; recordings add frame rates, modes and amplitudes."""

    focal_length_mm: Positive = field(
        READING["focal_length_mm"], "focal length of the lenses", "a number above 0, at most 100000"
    )
    sensor_width_mm: Positive = field(
        READING["sensor_width_mm"], "width of the sensors", "a number above 0, at most 100000"
    )
    lens_k1: Annotated[float, Field(ge=-0.3, le=0.3)] = field(
        READING["lens_k1"],
        "first coefficient of the lens distortion",
        "a number from -0.3 to 0.3",
    )
    exposure_ms: Positive = field(
        2.0,
        "exposure time of a frame",
        "a number above 0, at most the time between frames and 0.8 of the shortest period",
    )
    frames: int = field(
        24,
        "frames of the steady vibration in each recording",
        "a whole number from 8 to 500",
        ge=8,
        le=500,
    )
    shot_noise: Noise = field(
        READING["shot_noise"], "variance of the noise over the grey level", "a number from 0 to 50"
    )
    read_noise: Noise = field(
        READING["read_noise"],
        "standard deviation of the dark noise in grey levels",
        "a number from 0 to 50",
    )


class LabStudy(Study):
    """What the studies beyond chapter 5 have in common."""

    subject = "lab"
    section = "section 5.3"
    first = "as filmed"
    predicts = "noise of the centres"

    trials: int = field(
        200,
        "further runs, with starts and centre noise drawn at random",
        "a whole number from 0 to 10000",
        ge=0,
        le=10_000,
    )
    seed: int = field(0, "seed of all noise", "a whole number from 0 to 2^63 - 1", ge=0, lt=2**63)


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

    Parameters
    ----------
    film : Lens
        Lens and sensor.
    extent : tuple of float
        Length and width of the structure in m.
    lift : float
        Its largest deflection in m.
    direction : tuple of float
        Azimuth and elevation of the camera in degrees.
    distance : float
        Of the camera from the centre in m.
    """
    length, width = extent
    corners = np.array([[x, y, z] for x in (-length / 2, length / 2)
                        for y in (-width / 2, width / 2) for z in (-lift, lift)])  # fmt: skip
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
                refuse(name, rate, f"allowed: rates that show mode {mode}, {frequency:.4g} Hz, at "
                       f"least {CLEAR * rate / film.frames:.3g} Hz away from 0 and from half of "
                       f"the rate, {CLEAR:g} periods in {film.frames} frames")  # fmt: skip
    longest = 1000 * min(1 / max(rates), LONGEST / max(hertz.values()))
    if film.exposure_ms > longest * (1 + 1e-9):
        refuse("exposure_ms", film.exposure_ms, f"allowed: at most {longest:.4g} ms, the time "
               f"between frames and {LONGEST:g} of the shortest period")  # fmt: skip


def check_place(
    film: Film, extent: tuple[float, float], lift: float, setting: Setting, name: str, given: Any
) -> None:
    """Refuse cameras within the structure's reach, or that do not see all of it.

    `name` and `given` are the field that puts the cameras there, and its value.
    """
    reach = 1000 * (math.hypot(*extent) / 2 + lift)
    if setting.distance_mm <= reach:
        refuse(name, given, f"allowed: cameras more than {reach:.4g} mm away, the reach of the "
               "structure and its deflection")  # fmt: skip
    for direction in setting.directions_deg:
        if off_centre(film, extent, lift, direction, setting.distance_mm / 1000) > EDGE:
            refuse(name, given, f"allowed: cameras that see the whole structure; the one at "
                   f"azimuth {direction[0]:g}°, elevation {direction[1]:g}°, "
                   f"{setting.distance_mm:g} mm away does not")  # fmt: skip


def check_markers(
    film: Film, spacing: float, diameter: float, lift: float, setting: Setting, name: str,
    given: Any,
) -> None:  # fmt: skip
    """Refuse markers too small to be found, and motions that bring them near their neighbours."""
    slope = math.radians(min(elevation for _, elevation in setting.directions_deg))
    focal = film.focal_length_mm / film.sensor_width_mm * setting.resolution_px[0]
    high = 1000 * diameter * focal / setting.distance_mm * math.sin(slope)
    if high < LEAST:
        refuse(name, given, f"allowed: pictures in which markers are at least {LEAST:g} px high, "
               f"not {high:.2g} px: wider or nearer ones, or fewer and larger markers")  # fmt: skip
    largest = NEAR * spacing * math.tan(slope)
    if lift > largest:
        refuse("amplitude_mm", film.amplitude_mm, f"allowed: peaks of at most "  # type: ignore[attr-defined]
               f"{1000 * largest:.3g} mm as seen from an elevation of {math.degrees(slope):.3g}°, "
               "or markers seem to change places")  # fmt: skip
