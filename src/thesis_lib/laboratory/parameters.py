"""Parameters of rendered experiments, and their validation.

A request is refused where its result would be meaningless: an alias that no fit can use, an
exposure of nearly a period, an apparent motion close to the marker spacing, a structure partly
outside the image, markers that are hardly a pixel high.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.facts import setups
from thesis_lib.facts.setups import Setting
from thesis_lib.files import shipped
from thesis_lib.studies import fields, request
from thesis_lib.vibration.motion import alias_clearance
from thesis_lib.vibration.structure import Structure, resonance_frequency
from thesis_lib.vision.pinhole import hemisphere_directions, hemisphere_rotations

MIN_ALIAS_PERIODS = 0.5  # distance of an alias from 0 and half of the frame rate, times duration
MAX_EXPOSURE_PERIODS = 0.8  # longest exposure over a period
MAX_APPARENT_SHIFT = 0.4  # largest apparent motion over the markers' spacing
MAX_VIEW_EXTENT = 0.98  # largest offset of the structure from the image centre over half the image
MIN_MARKER_HEIGHT_PX = 1.0  # least height of a marker's image

# Fields of the cameras' directions; of several that a request has, the first lists the cameras
DIRECTION_FIELDS = "directions_deg", "azimuths_deg", "azimuth_deg", "cone_deg"

Sizes = tuple[float, float]  # m
Given = tuple[str, Any]  # a field and its value

CAMERA_NAMES = "ABCD"
THESIS_RIG = setups.setup_table("experiment", "rig") | setups.assumed_values("experiment")


def frame_size(width_px: int) -> tuple[int, int]:
    """Return width and height of frames of 16:9 in px."""
    return width_px, round(width_px * 9 / 16)


def facing_directions(azimuth_deg: float, elevation_deg: float) -> tuple[setups.Direction, ...]:
    """Return the azimuth and elevation of cameras A to D, two on each side of the beam."""
    a = azimuth_deg
    return tuple((azimuth, elevation_deg) for azimuth in (a, -a, 180 + a, 180 - a))


class CameraParameters(fields.Fields):
    """Parameters of the cameras that every rendered experiment has."""

    focal_length_mm: fields.FocalLength = THESIS_RIG["focal_length_mm"]
    sensor_width_mm: fields.SensorWidth = THESIS_RIG["sensor_width_mm"]
    lens_k1: fields.Distortion = THESIS_RIG["lens_k1"]
    shot_noise: fields.ShotNoise = THESIS_RIG["shot_noise"]
    read_noise: fields.ReadNoise = THESIS_RIG["read_noise"]


class RenderParameters(CameraParameters):
    """Parameters of rendering; recordings add frame rates, modes and amplitudes."""

    exposure_ms: fields.BriefExposure = 2.0
    frames: fields.Frames = 24

    @property
    def peaks_m(self) -> list[float]:
        """Return the largest deflection of each mode in m."""
        own: Any = self
        return request.peaks_m(own.structure, own.modes, own.amplitude_mm)


class RenderedStudy(request.Study):
    """A study whose data are rendered recordings (:mod:`thesis_lib.laboratory.experiment`)."""

    subject = "lab"
    section = "section 5.3"
    first = "as rendered"
    predicts = "noise of the centres"
    draws = "recordings"

    # Parameters that affect no recording, that only select recordings, and that affect only the
    # estimates from recordings
    analysis_only: ClassVar[frozenset[str]] = frozenset()
    selection_only: ClassVar[frozenset[str]] = frozenset()
    estimation_only: ClassVar[frozenset[str]] = frozenset()

    trials: Annotated[fields.Whole, Field(ge=0, le=10_000)] = 200
    """further recordings of each setting, at most"""
    seed: fields.Seed = 0
    """seed of all noise"""

    @property
    def recordings(self) -> RenderedStudy:
        """Return the request for the recordings, which other figure sets may share."""
        return self

    @property
    def stored_path(self) -> Path:
        """Return the path of the stored replicates of the default request."""
        return shipped() / "data" / "recordings" / f"{self.name}.nc"

    @property
    def rendering(self) -> str:
        """Return the parameters that recordings depend on, as JSON."""
        others = self.analysis_only | self.selection_only | self.estimation_only
        return self.model_dump_json(exclude={"cube", "trials", "repeats", *others})

    @property
    def estimation(self) -> str:
        """Return the parameters that only estimates from recordings depend on, as JSON."""
        return self.model_dump_json(include=set(self.estimation_only))

    def wanted_replicates(self, stored: int) -> int:
        """Return the number of replicates wanted, given the number stored."""
        return self.trials + 1


class ReplicatedStudy(RenderedStudy):
    """A study with as many replicates as are stored, or as a request asks for."""

    repeats: Annotated[fields.Whole, Field(ge=1, le=1000)] | Literal["kept"] = "kept"
    """number of recordings of every setting, or "kept": those stored in data/recordings for these
    parameters; bands are over all but the first"""

    def wanted_replicates(self, stored: int) -> int:
        """Return the number of replicates wanted, given the number stored."""
        count = max(stored, 1) if self.repeats == "kept" else self.repeats
        return min(count, self.trials + 1)


def check_motions(film: Any, structure: Structure, name: str, rates: Sequence[float]) -> None:
    """Refuse a list of amplitudes without one for each mode, and rates that hide the modes."""
    given, modes = film.amplitude_mm, film.modes
    if isinstance(given, list) and len(given) != len(modes):
        film.refuse("amplitude_mm", "allowed: a list with one for each mode")
    shown = {f"mode {m}": resonance_frequency(structure, m) / (2 * np.pi) for m in modes}
    check_rates(film, shown, name, rates)


def check_rates(
    film: Any,
    hertz: Mapping[str, float],
    name: str,
    rates: Sequence[float],
    periods: float = MIN_ALIAS_PERIODS,
) -> None:
    """Refuse rates at which no fit can use an alias, and exposures that are too long.

    `hertz` are the frequencies to be observed, by name; `name` is the field of the rates.
    """
    for rate in rates:
        for shown, frequency in hertz.items():
            if alias_clearance(frequency, rate, film.frames) < periods:
                least = f"{periods * rate / film.frames:.3g} Hz away from 0 and from half of it"
                enough = f"{periods:g} periods in {film.frames} frames"
                allowed = f"allowed: rates that show {shown}, {frequency:.4g} Hz, at least"
                fields.refuse_value(name, rate, f"{allowed} {least}, {enough}")
    check_exposure(film, max(rates), max(hertz.values()))


def check_exposure(film: Any, rate: float, frequency: float) -> None:
    """Refuse an exposure that lasts until the next frame, or nearly a period."""
    longest = 1000 * min(1 / rate, MAX_EXPOSURE_PERIODS / frequency)
    if film.exposure_ms > longest * (1 + 1e-9):
        limits = f"the time between frames and {MAX_EXPOSURE_PERIODS:g} of the shortest period"
        film.refuse("exposure_ms", f"allowed: at most {fields.format_limit(longest)} ms, {limits}")


def check_frequency(film: Any, share: float) -> None:
    """Refuse a frequency above a share of the frame rate, and exposures that are too long."""
    if film.frequency_hz > share * film.frame_rate_hz:
        most = f"{share:g} of the frame rate, {fields.format_limit(share * film.frame_rate_hz)} Hz"
        film.refuse("frequency_hz", f"allowed: at most {most}")
    check_exposure(film, film.frame_rate_hz, film.frequency_hz)


def check_place(film: Any, extent: Sizes, lift: float, setting: Setting, place: Given) -> None:
    """Refuse cameras at one place, within a structure's reach, or without all of it in 16:9 images.

    The structure's `extent` and largest deflection `lift` are in m; `place` is the field that sets
    the cameras' positions, with its value.
    """
    for pair in setting.coincident_cameras():
        field = next(name for name in DIRECTION_FIELDS if name in type(film).model_fields)
        where = "two cameras at the same place ([azimuth, elevation] in °)"
        fields.refuse_value(field, pair, f"{where}, allowed: different places")
    near = setting.distance_mm <= 1000 * (math.hypot(*extent) / 2 + lift)
    box = np.array([*extent, 2 * lift]) / 2
    corners = box * list(itertools.product((-1, 1), repeat=3))
    half = film.sensor_width_mm / film.focal_length_mm / 2
    spread = 1 + film.lens_k1 * half**2  # lens distortion moves the border by a few percent
    for azimuth, elevation in setting.directions_deg:
        angles = np.radians([azimuth, elevation])
        rays = corners - setting.distance_mm / 1000 * hemisphere_directions(*angles)
        u, v, depth = hemisphere_rotations(*angles) @ rays.T
        seen = max(np.abs(u / depth).max(), np.abs(v / depth).max() * 16 / 9) * spread / half
        if near or seen > MAX_VIEW_EXTENT:
            there = f"azimuth {azimuth:g}°, elevation {elevation:g}°"
            one = f"the one at {there}, {setting.distance_mm:g} mm away is not"
            beyond = "cameras beyond the structure's reach that see the whole structure"
            fields.refuse_value(*place, f"allowed: {beyond}; {one}")


def check_markers(
    film: Any, sizes: Sizes, lift: float, setting: Setting, place: Given, twist: float = 0.0
) -> None:
    """Refuse markers too small to be found, and motions that bring them near their neighbours.

    `sizes` are the least distance and the diameter of markers, `lift` the largest deflection by
    bending and `twist` that by torsion, in m.
    """
    spacing, diameter = sizes
    slope = math.radians(min(elevation for _, elevation in setting.directions_deg))
    focal = film.focal_length_mm / film.sensor_width_mm * setting.resolution_px[0]
    high = 1000 * diameter * focal / setting.distance_mm * math.sin(slope)
    if high < MIN_MARKER_HEIGHT_PX:
        enough = f"markers are at least {MIN_MARKER_HEIGHT_PX:g} px high, not {high:.2g} px"
        remedy = "wider or nearer ones" + ", or fewer and larger markers" * hasattr(film, "grid")
        fields.refuse_value(*place, f"allowed: images in which {enough}: {remedy}")
    largest = MAX_APPARENT_SHIFT * spacing * math.tan(slope)
    if lift + twist > largest:
        field, other = ("torsion_mm", lift) if twist > lift else ("amplitude_mm", twist)
        most = fields.format_limit(1000 * max(largest - other, 0))
        seen = f"as seen from an elevation of {math.degrees(slope):.3g}°"
        why = f"peaks of at most {most} mm {seen}, or markers seem to change places"
        film.refuse(field, f"allowed: {why}")


class RigRequest(fields.Fields):
    """Parameters of a rendered rig, its vibration and its recordings."""

    focal_length_mm: fields.FocalLength = THESIS_RIG["focal_length_mm"]
    sensor_width_mm: fields.SensorWidth = THESIS_RIG["sensor_width_mm"]
    distance_mm: fields.BeamDistance = THESIS_RIG["distance_mm"]
    azimuth_deg: fields.RigAzimuth = THESIS_RIG["azimuth_deg"]
    elevation_deg: Annotated[fields.Real, Field(ge=15, le=60)] = THESIS_RIG["elevation_deg"]
    """elevation of the cameras"""
    lens_k1: fields.Distortion = THESIS_RIG["lens_k1"]
    frequency_hz: Annotated[fields.Real, Field(ge=1)] = THESIS_RIG["frequency_hz"]
    """frequency of the vibration, at most 0.4 of the frame rate"""
    amplitude_mm: fields.TipPeak = THESIS_RIG["amplitude_mm"]
    frame_rate_hz: fields.RigRate = THESIS_RIG["frame_rate_hz"]
    exposure_ms: fields.Exposure = THESIS_RIG["exposure_ms"]
    shot_noise: fields.ShotNoise = THESIS_RIG["shot_noise"]
    read_noise: fields.ReadNoise = THESIS_RIG["read_noise"]
    audio_noise_db: Annotated[fields.Real, Field(ge=0, le=120)] = THESIS_RIG["audio_noise_db"]
    """force over noise on the audio tracks"""
    codec: Literal["lossless", "h264"] = "lossless"
    """how the videos are stored; h264, at crf 23, loses part of motions well below a pixel"""

    @model_validator(mode="after")
    def _check_rig(self) -> RigRequest:
        check_frequency(self, 0.4)
        far, directions = self.distance_mm, tuple(self.directions_deg.values())
        rig, lift = Setting("", far, "", far, directions, (0, 0)), self.amplitude_mm / 1000
        check_place(self, setups.thesis_beam().extent, lift, rig, ("distance_mm", far))
        return self

    @property
    def directions_deg(self) -> dict[str, setups.Direction]:
        """Return the azimuth and elevation of each camera."""
        directions = facing_directions(self.azimuth_deg, self.elevation_deg)
        return dict(zip(CAMERA_NAMES, directions, strict=True))
