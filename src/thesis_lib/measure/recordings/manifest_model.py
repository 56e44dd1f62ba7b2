"""Fields of a manifest, which names the recordings, the rig and the structure.

Lengths are in the units of their suffix here and nowhere else: properties without a suffix are in
SI units.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.board import MARK_DICTIONARY, MARK_RATIO, Board
from thesis_lib.measure.recordings.excitation import Excitation, FileName, Force, Place, list_kinds
from thesis_lib.studies.fields import (
    Azimuth,
    Elevation,
    Fields,
    Flag,
    Name,
    Positive,
    Real,
    Whole,
    Width,
    refuse_value,
)

if TYPE_CHECKING:
    from thesis_lib.acoustics.sources import Medium


class BoardSpec(Fields):
    """The calibration board."""

    kind: Literal["checkerboard", "charuco"] = Field(
        "checkerboard",
        description="whether its light tiles are empty, or carry ArUco marks as OpenCV's "
        "CharucoBoard has them",
    )
    columns: Whole = Field(9, ge=4, le=100, description="tiles along x")
    rows: Whole = Field(9, ge=4, le=100, description="tiles along y")
    tile_mm: Positive = Field(45.0, description="side of a tile")
    margin_mm: Real = Field(45.0, ge=0, le=1e5, description="width of the white margin")
    mark_mm: Positive | None = Field(
        default_factory=lambda data: (
            round(MARK_RATIO * data.get("tile_mm", 0), 9) if _mark_default(data) else None
        ),
        description="side of a mark",
    )
    dictionary: str | None = Field(
        default_factory=lambda data: MARK_DICTIONARY if _mark_default(data) else None,
        pattern=r"^DICT_(4X4|5X5|6X6|7X7)_(50|100|250|1000)$",
        title="null, or DICT_4X4_50 to DICT_7X7_1000",
        description="OpenCV's name of the dictionary that the marks are of",
    )
    two_sided: Flag = Field(
        default_factory=lambda data: not _mark_default(data),
        description="whether it is printed on both sides",
    )
    thickness_mm: Real = Field(0.0, ge=0, le=100, description="distance of the two printed sides")

    @model_validator(mode="after")
    def _check(self) -> BoardSpec:
        if self.kind == "checkerboard":
            for name in ("mark_mm", "dictionary"):
                if (given := getattr(self, name)) is not None:
                    refuse_value(name, given, "allowed where kind is checkerboard: null")
            return self
        if self.mark_mm is None or self.mark_mm >= self.tile_mm:
            self.refuse("mark_mm", "allowed: a number below tile_mm, in mm")
        marks = self.columns * self.rows // 2
        if self.dictionary is None or int(self.dictionary.rpartition("_")[2]) < marks:
            self.refuse(
                "dictionary",
                f"allowed: DICT_4X4_50 to DICT_7X7_1000 with enough marks, here {marks}",
            )
        if self.two_sided:
            self.refuse("two_sided", "allowed where kind is charuco: false")
        return self

    @property
    def board(self) -> Board:
        """The board in SI units."""
        return Board(
            self.columns,
            self.rows,
            self.tile_mm / 1000,
            self.margin_mm / 1000,
            self.thickness_mm / 1000,
            (self.mark_mm or 0) / 1000,
            self.dictionary or MARK_DICTIONARY,
        )


def _mark_default(given: dict[str, object]) -> bool:
    return given.get("kind") == "charuco"


class Reuse(Fields):
    """A calibration that was made before, here or by another program; a path alone is its file."""

    file: Annotated[str, Field(min_length=1, max_length=500)] = Field(
        ...,
        description="folder of an earlier measurement, or of one file for each camera; or a "
        "file: calibration.nc, YAML, XML or JSON of OpenCV, YAML of ROS or Kalibr, TOML of "
        "aniposelib, caliscope or Pose2Sim",
    )
    poses: Literal["kept", "anew"] = Field(
        "kept",
        description="whether the cameras stand where they stood, or are placed again by this "
        "folder's board images, which need no lens then",
    )
    unit: Literal["m", "mm"] | None = Field(
        None, description="unit of the file's lengths; null is what the file says, else m"
    )

    @model_validator(mode="before")
    @classmethod
    def _path(cls, given: Any) -> Any:
        return {"file": given} if isinstance(given, str) else given


Length = Annotated[Real, Field(ge=-1e5, le=1e5)]
Point = tuple[Length, Length, Annotated[Real, Field(gt=0, le=1e5)]]
Edge = Literal["free", "held"]
Wall = Annotated[
    Literal["yes", "no", "unknown"],  # YAML reads yes and no as true and false
    BeforeValidator(lambda value: ("no", "yes")[value] if isinstance(value, bool) else value),
]
MIN_SURFACE_MARKERS = 6  # markers that a surface needs


class Radiation(Fields):
    """What the structure radiates, and where that is wanted."""

    outline_mm: Literal["structure", "hull"] | tuple[Place, ...] = Field(
        "structure",
        description="what radiates: length by width, the hull of the markers, or corners from "
        "the clamped corner",
    )
    edges: Literal["by kind"] | tuple[Edge, ...] = Field(
        "by kind",
        description="edges of the outline that are held at rest, from each corner to the next; "
        "by kind: a beam's at x = 0, a plate's four, else none",
    )
    between: Literal["model", "spline"] | None = Field(
        None,
        description="what is fitted between markers: modes of the model, or a thin plate spline; "
        "null takes the model where there is one that fits",
    )
    points_mm: tuple[Point, ...] = Field(
        ((0.0, 0.0, 1000.0),),
        min_length=1,
        max_length=20,
        description="where the pressure is wanted: X, Y from the structure's centre, Z above its "
        "plane",
    )
    plane_half_width_mm: Positive | None = Field(
        None, description="the planes XZ and YZ reach so far; null is the longer side"
    )
    plane_bottom_mm: Positive = Field(50.0, description="lowest height of the planes")
    plane_top_mm: Positive | None = Field(
        None, description="greatest height of the planes; null is the longer side above the lowest"
    )
    wall: Wall = Field(
        "unknown",
        description="whether the structure lies in a wall, in whose plane no air flows around "
        "its edges",
    )
    speed_of_sound_m_s: Positive = Field(343.0, description="speed of sound in the air")
    air_density_kg_m3: Positive = Field(1.21, description="density of the air")

    @property
    def medium(self) -> Medium:
        """The air."""
        from thesis_lib.acoustics.sources import Medium

        return Medium(self.speed_of_sound_m_s, self.air_density_kg_m3)

    @property
    def points(self) -> Array:
        """Return the points at which the pressure is computed, shape (3, n), m."""
        return np.array(self.points_mm, float).T / 1000

    def corners(self, size: tuple[float, float], markers: Array, diameter: float) -> Array:
        """Return the corners (n, 2) in m of the outline, for a size and markers (2, m)."""
        if isinstance(self.outline_mm, tuple):
            return np.array(self.outline_mm, float) / 1000
        if self.outline_mm == "structure":
            return np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * np.array(size)
        from scipy.spatial import ConvexHull

        turn = 2 * np.pi * np.arange(8) / 8
        discs = markers[:, :, None] + diameter / 2 * np.stack([np.cos(turn), np.sin(turn)])[:, None]
        every = discs.reshape(2, -1).T
        return np.asarray(every[ConvexHull(every).vertices], float)

    def held_edges(self, kind: str, corners: int) -> list[int]:
        """Return the numbers of the edges that are held at rest."""
        if self.edges != "by kind":
            return [i for i, edge in enumerate(self.edges) if edge == "held"]
        if self.outline_mm != "structure":
            return []
        return {"beam": [3], "plate": [0, 1, 2, 3]}.get(kind, [])

    def check(self, kind: str, size: tuple[float, float], markers: Array, diameter: float) -> None:
        """Refuse what does not go with the structure; lengths in m."""
        from thesis_lib.vibration.polygons import (
            edge_distances,
            is_simple,
            polygon_area,
            polygon_contains,
        )

        count = markers.shape[1]
        if count < MIN_SURFACE_MARKERS:
            why = "fewer do not tell how the surface between them moves"
            words = f"allowed with {MIN_SURFACE_MARKERS} markers or more, given {count}: {why}"
            self._refuse("outline_mm", words)
        corners = self.corners(size, markers, diameter)
        if isinstance(self.outline_mm, tuple):
            simple = 3 <= len(self.outline_mm) <= 200 and is_simple(self.outline_mm)
            if not simple or abs(polygon_area(self.outline_mm)) == 0:
                self._refuse(
                    "outline_mm", "allowed: 3 to 200 corners [x, y] whose edges do not cross"
                )
            on = polygon_contains(corners, markers) | (
                edge_distances(corners, markers).min(axis=0) < 1e-9
            )
            if not on.all():
                x, y = 1000 * markers[:, ~on][:, 0]
                why = f"allowed: corners around all markers, the one at ({x:g}, {y:g}) is outside"
                self._refuse("outline_mm", why)
        if self.edges != "by kind" and len(self.edges) != len(corners):
            edges = f'allowed: "by kind", or {len(corners)} of "free" and "held"'
            self._refuse("edges", edges)
        if self.between == "model" and (kind == "flat" or self.outline_mm != "structure"):
            why = 'allowed: null or "spline", since there is no model of this outline'
            self._refuse("between", why)
        if self.plane_top_mm is not None and self.plane_top_mm <= self.plane_bottom_mm:
            self._refuse("plane_top_mm", "allowed: null, or a number above plane_bottom_mm, in mm")

    def _refuse(self, name: str, why: str) -> None:
        refuse_value(f"radiation.{name}", getattr(self, name), why)


Count = Annotated[Whole, Field(ge=1, le=200)]

INSIDE_TEXT = "a path inside the manifest's folder"


def _beam(name: str) -> Any:
    """Return a property of the thesis's beam (Table 3.1)."""
    from thesis_lib.facts import setups

    return getattr(setups.thesis_beam(), name)


def _default(name: str, scale: float = 1.0) -> Any:
    """Return a property of the thesis's beam as a default, read where a manifest leaves it out."""
    return lambda: round(scale * _beam(name), 9)


def _thesis_layout(given: dict[str, Any]) -> bool:
    """Return whether markers are the thesis's, which alone have a hole unless it is given."""
    return all(
        given.get(name) == MarkersSpec.model_fields[name].get_default(call_default_factory=True)
        for name in ("rows", "columns", "spacing_mm", "row_spacing_mm", "diameter_mm", "points_mm")
    )


class MarkersSpec(Fields):
    """Round markers on the structure: rows along it, or any given places."""

    rows: Count = Field(3, description="rows of markers, side by side")
    columns: Count = Field(
        default_factory=lambda: _beam("n_markers"), description="markers in each row"
    )
    spacing_mm: Positive = Field(
        default_factory=_default("marker_spacing", 1000),
        description="distance between centres along a row",
    )
    row_spacing_mm: Positive = Field(10.0, description="distance between rows")
    diameter_mm: Positive = Field(5.0, description="diameter of the markers")
    points_mm: tuple[Place, ...] | None = Field(
        None,
        min_length=4,
        max_length=2000,
        description="places of markers in no rows, from the clamped corner; replaces rows and "
        "columns",
    )
    tone: Literal["dark", "bright"] = Field(
        "dark", description="whether they are darker or brighter than the structure"
    )
    detector: str = Field("disc", description="what finds them in a frame")
    hole_mm: Place | None = Field(
        default_factory=lambda data: (24.0, 10.0) if _thesis_layout(data) else None,
        description="a hole that looks like a marker, from the clamped corner",
    )


class StructureSpec(Fields):
    """The structure that is filmed."""

    kind: Literal["beam", "plate", "flat"] = Field(
        "beam", description="what it is, which gives the model that shapes are compared with"
    )
    length_mm: Positive = Field(
        default_factory=_default("length", 1000), description="length along x"
    )
    width_mm: Positive = Field(default_factory=_default("width", 1000), description="width along y")
    thickness_mm: Positive = Field(
        default_factory=_default("thickness", 1000), description="thickness"
    )
    density_kg_m3: Positive = Field(default_factory=_default("density"), description="density")
    youngs_modulus_pa: Real = Field(
        default_factory=_default("youngs_modulus"), gt=0, le=1e13, description="Young's modulus"
    )
    poissons_ratio: Real = Field(
        0.3, ge=0, le=0.5, description="Poisson's ratio, which a plate's model needs"
    )
    damping: Real = Field(
        default_factory=_default("damping"), gt=0, lt=0.7, description="modal damping ratio"
    )
    force_position_mm: Positive = Field(
        default_factory=_default("force_position", 1000),
        description="distance of the force from x = 0, a beam's clamp",
    )
    force_across_mm: Positive | None = Field(
        None, description="distance of the force from y = 0; null is half the width"
    )
    markers: MarkersSpec = Field(default_factory=MarkersSpec, description="its markers")

    @model_validator(mode="after")
    def _check(self) -> StructureSpec:
        if self.force_position_mm > self.length_mm:
            self.refuse("force_position_mm", "allowed: at most length_mm, in mm")
        if self.force_across_mm is not None and self.force_across_mm > self.width_mm:
            self.refuse("force_across_mm", "allowed: null, or at most width_mm, in mm")
        if self.kind == "plate" and self.markers.points_mm is None and self.markers.rows < 2:
            refuse_value("markers.rows", self.markers.rows, "allowed on a plate: at least 2")
        size, radius = np.array([[self.length_mm], [self.width_mm]]), self.markers.diameter_mm / 2
        points, hole = 1000 * self.marker_points, self.markers.hole_mm
        name = "markers.points_mm" if self.markers.points_mm else "markers"
        given = self.markers.model_dump(mode="json", exclude={"hole_mm"})
        if np.any(points < radius - 1e-9) or np.any(points > size - radius + 1e-9):
            refuse_value(name, given, "allowed: markers that lie on the structure")
        apart = np.linalg.norm(points[:, :, None] - points[:, None], axis=0)
        if np.any(apart[np.triu_indices(points.shape[1], 1)] < 2 * radius):
            refuse_value(name, given, "allowed: markers that do not overlap")
        if hole is not None:
            place = np.array(hole)[:, None]
            near = np.linalg.norm(points - place, axis=0).min() < 2 * radius
            if near or np.any(place < 0) or np.any(place > size):
                away = "on the structure, at least a diameter from every marker's centre"
                refuse_value("markers.hole_mm", hole, f"allowed: null, or [x, y] {away}")
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
        """Return the force's point, shape (2,), in m, from the clamped corner."""
        across = self.force_across_mm or self.width_mm / 2
        return np.array([self.force_position_mm, across]) / 1000

    @property
    def hole(self) -> Array | None:
        """Return the centre of the hole, shape (2,), in m."""
        return None if self.markers.hole_mm is None else np.array(self.markers.hole_mm) / 1000


class CameraFiles(Fields):
    """One camera and its files."""

    name: Name = Field(..., description="its name")
    video: FileName = Field(..., description="video with the structure's vibration and its sound")
    width_px: Width = Field(1920, description="width of the images")
    height_px: Width = Field(1080, description="height of the images")
    frame_rate_hz: Real = Field(60.0, ge=1, le=1e5, description="frames per second of the video")
    captured_hz: Real | None = Field(
        None,
        ge=1,
        le=1e5,
        description="frames per second that the camera took, of slow motion that plays slowly; "
        "null is frame_rate_hz",
    )
    exposure_s: Real = Field(..., gt=0, le=1, description="exposure time of a frame")
    readout_s: Real = Field(
        0.0,
        ge=-1,
        le=1,
        description="time from the first row's exposure to the last row's; 0 for a global shutter",
    )
    board_images: FileName | tuple[FileName | None, ...] | None = Field(
        None,
        title="null, a folder of images, a pattern such as board/A-*.png, or a list of 3 to 200 "
        "files with null where there is none, each inside the manifest's folder",
        description="images of the calibration board; the k-th of every camera shows the same "
        "pose; null if calibration has the cameras' places",
    )
    corners_px: tuple[Place, Place, Place, Place] | None = Field(
        None,
        description="where the structure's corners lie in the images: at (0, 0), (length, 0), "
        "(length, width), (0, width)",
    )
    focal_length_mm: Positive | None = Field(None, description="focal length of the lens")
    sensor_width_mm: Positive | None = Field(None, description="width of the sensor")
    f_number: Positive | None = Field(None, description="focal length over the aperture's diameter")
    distance_mm: Positive | None = Field(
        None, description="distance from the structure's centre, which the camera looks at"
    )
    azimuth_deg: Azimuth | None = Field(
        None, description="direction of the camera from +Y towards +X"
    )
    elevation_deg: Elevation | None = Field(
        None, description="direction of the camera above the structure's plane"
    )

    @property
    def size(self) -> tuple[int, int]:
        """Return the width and height of the images in px."""
        return self.width_px, self.height_px

    @property
    def rate_hz(self) -> float:
        """Return the rate at which the frames were taken, Hz."""
        return self.captured_hz or self.frame_rate_hz

    @model_validator(mode="after")
    def _check(self) -> CameraFiles:
        if self.exposure_s * self.rate_hz > 1 + 1e-9:
            self.refuse("exposure_s", "allowed: at most 1 / frame_rate_hz, in s")
        if abs(self.readout_s) * self.rate_hz > 1 + 1e-9:
            self.refuse("readout_s", "allowed: from -1 / frame_rate_hz to 1 / frame_rate_hz, in s")
        if isinstance(self.board_images, tuple) and not 3 <= len(self.board_images) <= 200:
            self.refuse("board_images", "allowed: 3 to 200 files, with null where there is none")
        if self.corners_px is not None:
            sides = np.diff([*self.corners_px, *self.corners_px[:2]], axis=0)
            turns = sides[:-1, 0] * sides[1:, 1] - sides[:-1, 1] * sides[1:, 0]
            if not (np.all(turns > 0) or np.all(turns < 0)):
                self.refuse(
                    "corners_px", "allowed: null, or four [u, v] around a convex quadrilateral"
                )
        return self


class Manifest(Fields):
    """Recordings of one structure by 2 to 16 cameras."""

    structure: StructureSpec = Field(default_factory=StructureSpec, description="the structure")
    cameras: tuple[CameraFiles, ...] = Field(
        ..., min_length=2, max_length=16, description="the cameras"
    )
    board: BoardSpec = Field(default_factory=BoardSpec, description="the calibration board")
    excitation: Excitation = Field(default_factory=Excitation, description="the excitation")
    calibration: Reuse | None = Field(
        None,
        title="null, a path, or an object",
        description="a calibration that is reused; null calibrates from the board images",
    )
    force: Force | None = Field(
        None, description="the force that was recorded beside the cameras, for motion over force"
    )
    radiation: Radiation | None = Field(None, description="the sound that is wanted of it")
    truth: FileName | None = Field(None, description="truth of a rendered recording")

    @model_validator(mode="after")
    def _check(self) -> Manifest:
        kind, own, behaviour = self.excitation.kind, self.structure, self.excitation.behaviour
        if self.force is None and behaviour.force == "required":
            refuse_value("force", None, f"allowed where excitation.kind is {kind}: an object")
        if self.force is not None:
            if behaviour.force == "none":
                forced = list_kinds(lambda one: one.force != "none")
                refuse_value("excitation.kind", kind, f"allowed with a force: {forced}")
            self.force.check((own.length_mm, own.width_mm))
            if self.excitation.sound == "none" and self.force.offset_s is None:
                refuse_value("force.offset_s", None, "allowed without sound: a number")
        if self.radiation is not None and behaviour.result == "response":
            shaped = list_kinds(lambda one: one.result != "response")
            refuse_value("excitation.kind", kind, f"allowed where radiation is given: {shaped}")
        if self.calibration is None or self.calibration.poses == "anew":
            for i, camera in enumerate(self.cameras):
                if camera.board_images is None:
                    why = "allowed without calibration: board images"
                    refuse_value(f"cameras[{i}].board_images", None, why)
        for (i, one), (j, other) in combinations(enumerate(self.cameras), 2):
            for name in ("name", "video"):
                given = getattr(other, name)
                if given == getattr(one, name):
                    why = f"the same as cameras[{i}].{name}, allowed: another one"
                    refuse_value(f"cameras[{j}].{name}", given, why)
        if self.radiation is not None:
            size = own.length_mm / 1000, own.width_mm / 1000
            self.radiation.check(own.kind, size, own.marker_points, own.markers.diameter_mm / 1000)
        return self
