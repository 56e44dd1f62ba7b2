"""The manifest: one YAML file that names the recordings, the rig and the structure.

Every field's ``allowed`` text is what stands in the error message. Lengths are in the units of
their suffix here and nowhere else: properties without a suffix are in SI units.
"""

from __future__ import annotations

from itertools import combinations
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.board_fields import BoardSpec
from thesis_lib.measure.recordings.force_fields import FORCED, Excitation, Force
from thesis_lib.measure.recordings.radiation_fields import Place, Radiation
from thesis_lib.measure.recordings.reuse import Reuse
from thesis_lib.studies.refusals import Refusing, permitted, refuse
from thesis_lib.studies.vocabulary import (
    Azimuth,
    Elevation,
    Name,
    Positive,
    Width,
    allowed_text,
    field,
)

Count = Annotated[int, Field(ge=1, le=200)]
FileName = Annotated[str, Field(min_length=1, max_length=500)]

INSIDE = "a path inside the manifest's folder"


def _beam(name: str) -> Any:
    """A property of the thesis's beam (Table 3.1)."""
    from thesis_lib.facts import setups

    return getattr(setups.beam(), name)


def _default(name: str, scale: float = 1.0) -> Any:
    """A property of the thesis's beam as a default, read where a manifest leaves it out."""
    return lambda: round(scale * _beam(name), 9)


def _thesis_layout(given: dict[str, Any]) -> bool:
    """Whether markers are those of the thesis, which alone have a hole unless it is given."""
    return all(
        given.get(name) == Markers.model_fields[name].get_default(call_default_factory=True)
        for name in ("rows", "columns", "spacing_mm", "row_spacing_mm", "diameter_mm", "points_mm")
    )


class Markers(Refusing):
    """Round markers on the structure: rows along it, or any given places."""

    rows: Count = field(3, "rows of markers, side by side")
    columns: Count = field(lambda: _beam("n_markers"), "markers in each row")
    spacing_mm: Positive = field(
        _default("marker_spacing", 1000), "distance between centres along a row"
    )
    row_spacing_mm: Positive = field(10.0, "distance between rows")
    diameter_mm: Positive = field(5.0, "diameter of the markers")
    points_mm: tuple[Place, ...] | None = field(
        None,
        "places of markers in no rows, from the clamped corner; replaces rows and columns",
        "null, or a list of 4 to 2000 different [x, y]",
        min_length=4,
        max_length=2000,
    )
    tone: Literal["dark", "bright"] = field(
        "dark", "whether they are darker or brighter than the structure"
    )
    hole_mm: Place | None = field(
        lambda data: (24.0, 10.0) if _thesis_layout(data) else None,
        "a hole that looks like a marker, from the clamped corner",
        "null, or [x, y] on the structure, at least a diameter from every marker's centre",
    )


class Structure(Refusing):
    """The structure that is filmed."""

    kind: Literal["beam", "plate", "flat"] = field(
        "beam",
        "what it is, which gives the model that shapes are compared with",
        '"beam", clamped at x = 0, "plate", simply supported, or "flat", without a model',
    )
    length_mm: Positive = field(_default("length", 1000), "length along x")
    width_mm: Positive = field(_default("width", 1000), "width along y")
    thickness_mm: Positive = field(_default("thickness", 1000), "thickness")
    density_kg_m3: Positive = field(_default("density"), "density")
    youngs_modulus_pa: float = field(_default("youngs_modulus"), "Young's modulus", gt=0, le=1e13)
    poissons_ratio: float = field(0.3, "Poisson's ratio, which a plate's model needs", ge=0, le=0.5)
    damping: float = field(_default("damping"), "modal damping ratio", gt=0, lt=0.7)
    force_position_mm: Positive = field(
        _default("force_position", 1000),
        "distance of the force from x = 0, a beam's clamp",
        "a number above 0, at most length_mm",
    )
    force_across_mm: Positive | None = field(
        None,
        "distance of the force from y = 0; null is half the width",
        "null, or a number above 0, at most width_mm",
    )
    markers: Markers = field(Markers, "its markers", "an object")

    @model_validator(mode="after")
    def _check(self) -> Structure:
        if self.force_position_mm > self.length_mm:
            self.refuse("force_position_mm")
        if self.force_across_mm is not None and self.force_across_mm > self.width_mm:
            self.refuse("force_across_mm")
        if self.kind == "plate" and self.markers.points_mm is None and self.markers.rows < 2:
            refuse("markers.rows", self.markers.rows, "allowed on a plate: at least 2")
        size, radius = np.array([[self.length_mm], [self.width_mm]]), self.markers.diameter_mm / 2
        points, hole = 1000 * self.marker_points, self.markers.hole_mm
        name = "markers.points_mm" if self.markers.points_mm else "markers"
        given = self.markers.model_dump(mode="json", exclude={"hole_mm"})
        if np.any(points < radius - 1e-9) or np.any(points > size - radius + 1e-9):
            refuse(name, given, "allowed: markers that lie on the structure")
        apart = np.linalg.norm(points[:, :, None] - points[:, None], axis=0)
        if np.any(apart[np.triu_indices(points.shape[1], 1)] < 2 * radius):
            refuse(name, given, "allowed: markers that do not overlap")
        if hole is not None:
            place = np.array(hole)[:, None]
            near = np.linalg.norm(points - place, axis=0).min() < 2 * radius
            if near or np.any(place < 0) or np.any(place > size):
                refuse("markers.hole_mm", hole, permitted(Markers, "hole_mm"))
        return self

    @property
    def marker_points(self) -> Array:
        """Centres of the markers, shape (2, markers), in m, from the clamped corner; row by row."""
        m = self.markers
        if m.points_mm is not None:
            return np.array(m.points_mm).T / 1000
        x = self.length_mm / 2 + (np.arange(m.columns) - (m.columns - 1) / 2) * m.spacing_mm
        y = self.width_mm / 2 + (np.arange(m.rows) - (m.rows - 1) / 2) * m.row_spacing_mm
        return np.stack([np.tile(x, m.rows), np.repeat(y, m.columns)]) / 1000

    @property
    def force_place(self) -> Array:
        """Where the force acts, shape (2,), in m, from the clamped corner."""
        across = self.force_across_mm or self.width_mm / 2
        return np.array([self.force_position_mm, across]) / 1000

    @property
    def hole(self) -> Array | None:
        """Centre of the hole, shape (2,), in m."""
        return None if self.markers.hole_mm is None else np.array(self.markers.hole_mm) / 1000


class CameraFiles(Refusing):
    """One camera and its files."""

    name: Name = field(..., "its name", "1 to 40 characters, different for every camera")
    video: FileName = field(..., "video with the structure's vibration and its sound", INSIDE)
    width_px: Width = field(1920, "width of the pictures")
    height_px: Width = field(1080, "height of the pictures")
    frame_rate_hz: float = field(60.0, "frames per second of the video", ge=1, le=1e5)
    captured_hz: float | None = field(
        None,
        "frames per second that the camera took, of slow motion that plays slowly; null is "
        "frame_rate_hz",
        "null, or a number from 1 to 100000",
        ge=1,
        le=1e5,
    )
    exposure_s: float = field(
        ..., "exposure time of a frame", "a number above 0, at most 1 / frame_rate_hz", gt=0, le=1
    )
    readout_s: float = field(
        0.0,
        "time from the first row's exposure to the last row's; 0 for a global shutter",
        "a number from -1 / frame_rate_hz to 1 / frame_rate_hz, below 0 if the last is first",
        ge=-1,
        le=1,
    )
    shots: FileName | tuple[FileName | None, ...] | None = field(
        None,
        "pictures of the calibration board; the k-th of every camera shows the same pose; null if "
        "calibration has the cameras' places",
        "a folder of pictures, a pattern such as shots/A-*.png, or a list of 3 to 200 files with "
        "null where there is none, each inside the manifest's folder",
    )
    corners_px: tuple[Place, Place, Place, Place] | None = field(
        None,
        "where the structure's corners lie in the pictures: at (0, 0), (length, 0), (length, "
        "width), (0, width)",
        "null, or four [u, v] around a convex quadrilateral",
    )
    focal_length_mm: Positive | None = field(None, "focal length of the lens")
    sensor_width_mm: Positive | None = field(None, "width of the sensor")
    f_number: Positive | None = field(None, "focal length over the aperture's diameter")
    distance_mm: Positive | None = field(
        None, "distance from the structure's centre, which the camera looks at"
    )
    azimuth_deg: Azimuth | None = field(None, "direction of the camera from +Y towards +X")
    elevation_deg: Elevation | None = field(
        None, "direction of the camera above the structure's plane"
    )

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures in px."""
        return self.width_px, self.height_px

    @property
    def rate_hz(self) -> float:
        """Rate at which the frames were taken, Hz."""
        return self.captured_hz or self.frame_rate_hz

    @model_validator(mode="after")
    def _check(self) -> CameraFiles:
        if self.exposure_s * self.rate_hz > 1 + 1e-9:
            self.refuse("exposure_s")
        if abs(self.readout_s) * self.rate_hz > 1 + 1e-9:
            self.refuse("readout_s")
        if isinstance(self.shots, tuple) and not 3 <= len(self.shots) <= 200:
            self.refuse("shots")
        if self.corners_px is not None:
            sides = np.diff([*self.corners_px, *self.corners_px[:2]], axis=0)
            turns = sides[:-1, 0] * sides[1:, 1] - sides[:-1, 1] * sides[1:, 0]
            if not (np.all(turns > 0) or np.all(turns < 0)):
                self.refuse("corners_px")
        return self


class Manifest(Refusing):
    """Recordings of one structure by 2 to 16 cameras."""

    structure: Structure = field(Structure, "the structure", "an object")
    cameras: tuple[CameraFiles, ...] = field(
        ..., "the cameras", "a list of 2 to 16 cameras", min_length=2, max_length=16
    )
    board: BoardSpec = field(BoardSpec, "the calibration board", "an object")
    excitation: Excitation = field(Excitation, "the excitation", "an object")
    calibration: Reuse | None = field(
        None,
        "a calibration that is reused; null calibrates from the pictures of the board",
        "null, a path, or an object",
    )
    force: Force | None = field(
        None,
        "the force that was recorded beside the cameras, for motion over force",
        "null, or an object",
    )
    radiation: Radiation | None = field(
        None, "the sound that is wanted of it", "null, or an object; {} takes the defaults"
    )
    truth: FileName | None = field(None, "truth of a rendered recording", f"null, or {INSIDE}")

    @model_validator(mode="after")
    def _check(self) -> Manifest:
        kind, own = self.excitation.kind, self.structure
        if self.force is None and kind in FORCED[1:]:
            refuse("force", None, f"allowed where excitation.kind is {kind}: an object")
        if self.force is not None:
            if kind not in FORCED:
                refuse(
                    "excitation.kind", kind, 'allowed with a force: "decay", "sweep" or "random"'
                )
            self.force.check((own.length_mm, own.width_mm))
            if self.excitation.sound == "none" and self.force.offset_s is None:
                refuse("force.offset_s", None, "allowed without sound: a number")
        if self.radiation is not None and self.excitation.kind in FORCED[1:]:
            allowed = 'allowed where radiation is given: "tone", "tones" or "decay"'
            refuse("excitation.kind", self.excitation.kind, allowed)
        if self.calibration is None or self.calibration.poses == "anew":
            for i, camera in enumerate(self.cameras):
                if camera.shots is None:
                    allowed = allowed_text(CameraFiles, "shots")
                    refuse(f"cameras[{i}].shots", None, f"allowed without calibration: {allowed}")
        for (i, one), (j, other) in combinations(enumerate(self.cameras), 2):
            for name in ("name", "video"):
                given, allowed = getattr(other, name), allowed_text(CameraFiles, name)
                if given == getattr(one, name):
                    why = f"the same as cameras[{i}].{name}, allowed: {allowed}"
                    refuse(f"cameras[{j}].{name}", given, why)
        if self.radiation is not None:
            size = own.length_mm / 1000, own.width_mm / 1000
            self.radiation.check(own.kind, size, own.marker_points, own.markers.diameter_mm / 1000)
        return self
