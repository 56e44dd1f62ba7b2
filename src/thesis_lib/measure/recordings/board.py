"""Calibration board and markers (thesis 5.1.1, 5.1.2, Appendix D).

The board is a checkerboard with a white margin. A ChArUco board has an ArUco mark in each light
tile, which identifies its corners. The board's frame has the origin at its centre, x along the
columns, y along the rows, and z out of the printed side, in m. Inner corners are ordered with x
running fastest.

Markers are numbered row by row, along x in each row; the hole, which looks like a marker, comes
last. Positions on the structure are in its own frame (x from the clamp, y across, m); the world's
origin is the structure's centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
import scipy
from pydantic import Field, model_validator

from thesis_lib.arrays import Array, ArrayLike
from thesis_lib.studies.fields import Fields, Flag, Positive, Real, Whole, refuse_value
from thesis_lib.vibration.structure import Beam

Place = tuple[Real, Real]
MARK_DICTIONARY = "DICT_5X5_1000"  # OpenCV's dictionary for boards that this library prints
MARK_RATIO = 0.7  # side of their marks over that of a tile


@dataclass(frozen=True)
class Board:
    """A checkerboard, with ArUco marks or without."""

    #: Tiles along x and y
    columns: int = 9
    rows: int = 9
    tile: float = 0.045  #: Side of a tile in m
    margin: float = 0.045  #: Width of the white margin around the tiles in m
    thickness: float = 0.0  #: Distance between the printed sides of a two-sided board in m
    mark: float = 0.0  #: Side of the marks in m; 0 if there are none
    dictionary: str = MARK_DICTIONARY  #: OpenCV's name of the marks' dictionary

    @property
    def shape(self) -> tuple[int, int]:
        """Return the number of inner corners along x and along y."""
        return self.columns - 1, self.rows - 1

    @property
    def corners(self) -> Array:
        """Return the inner corners in the board's frame, shape (3, corners), in m."""
        nx, ny = self.shape
        x = (np.arange(nx) - (nx - 1) / 2) * self.tile
        y = (np.arange(ny) - (ny - 1) / 2) * self.tile
        return np.stack([np.tile(x, ny), np.repeat(y, nx), np.zeros(nx * ny)])

    def corners_in_images(self, images: Array) -> Array:
        """Return the corners of the side that each image shows, in the front side's frame, in m.

        Corners of the back lie one thickness behind, and their order is mirrored in an image.

        Parameters
        ----------
        images : ndarray, shape (..., 2, corners)
            Pixels in the order of :attr:`corners`; NaN where an image is absent.

        Returns
        -------
        ndarray, shape (3, corners) for a thickness of 0, else (..., 3, corners)
        """
        if self.thickness == 0:
            return self.corners
        nx, ny = self.shape
        grid = images.reshape(*images.shape[:-1], ny, nx)
        along, up = (np.gradient(grid, axis=axis).mean((-2, -1)) for axis in (-1, -2))
        turn = along[..., 0] * up[..., 1] - along[..., 1] * up[..., 0]  # rows of pixels run down
        behind = np.where(turn > 0, self.thickness, 0.0)[..., None, None]
        return self.corners - behind * np.array([[0.0], [0.0], [1.0]])

    @property
    def dark_tiles(self) -> Array:
        """Return the vertices (tiles, 4, 2) of the dark tiles in m; the tile at −x, −y is dark."""
        i, j = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        dark = (i + j) % 2 == 0
        low = np.stack([i[dark] - self.columns / 2, j[dark] - self.rows / 2], axis=-1)
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        return (low[:, None] + square) * self.tile

    @property
    def outline(self) -> Array:
        """Return the vertices of the whole board with its margin, shape (4, 2), in m."""
        x = self.columns * self.tile / 2 + self.margin
        y = self.rows * self.tile / 2 + self.margin
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])


class BoardSpec(Fields):
    """The calibration board."""

    kind: Literal["checkerboard", "charuco"] = "checkerboard"
    """whether the light tiles are empty, or carry ArUco marks as in OpenCV's CharucoBoard"""
    columns: Whole = Field(9, ge=4, le=100)
    """tiles along x"""
    rows: Whole = Field(9, ge=4, le=100)
    """tiles along y"""
    tile_mm: Positive = 45.0
    """side of a tile"""
    margin_mm: Real = Field(45.0, ge=0, le=1e5)
    """width of the white margin"""
    mark_mm: Positive | None = Field(
        default_factory=lambda data: (
            round(MARK_RATIO * data.get("tile_mm", 0), 9) if _mark_default(data) else None
        )
    )
    """side of a mark"""
    dictionary: str | None = Field(
        default_factory=lambda data: MARK_DICTIONARY if _mark_default(data) else None,
        pattern=r"^DICT_(4X4|5X5|6X6|7X7)_(50|100|250|1000)$",
        title="null, or DICT_4X4_50 to DICT_7X7_1000",
    )
    """OpenCV's name of the marks' dictionary"""
    two_sided: Flag = Field(default_factory=lambda data: not _mark_default(data))
    """whether the board is printed on both sides"""
    thickness_mm: Real = Field(0.0, ge=0, le=100)
    """distance between the two printed sides"""

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
            self.refuse("dictionary", f"allowed: a dictionary with enough marks, here {marks}")
        if self.two_sided:
            self.refuse("two_sided", "allowed where kind is charuco: false")
        return self

    @property
    def board(self) -> Board:
        """Return the board in SI units."""
        lengths_mm = self.tile_mm, self.margin_mm, self.thickness_mm, self.mark_mm or 0
        tile, margin, thickness, mark = (length / 1000 for length in lengths_mm)
        dictionary = self.dictionary or MARK_DICTIONARY
        return Board(self.columns, self.rows, tile, margin, thickness, mark, dictionary)


def _mark_default(given: dict[str, object]) -> bool:
    return given.get("kind") == "charuco"


@dataclass(frozen=True)
class Markers:
    """Round markers on a flat structure, and one hole that looks like them (thesis 5.1.1)."""

    extent: tuple[float, float]  #: Length and width of the structure in m
    centres: Array  #: Centres on the structure in m, from its corner, shape (2, n)
    diameter: float  #: Diameter of markers and hole in m
    hole: tuple[float, float] | None = None  #: Centre of the hole in m
    bright: bool = False  #: Whether markers are brighter than the structure

    @cached_property
    def positions(self) -> Array:
        """Return the centres of the markers and of the hole, if any, shape (2, n), m."""
        return self.centres if self.hole is None else np.column_stack([self.centres, self.hole])

    @property
    def count(self) -> int:
        """Return the number of markers without the hole."""
        return self.centres.shape[1]

    @cached_property
    def nearest(self) -> Array:
        """Return the distance of each of :attr:`positions` to the nearest other one, m."""
        distance, _ = scipy.spatial.KDTree(self.positions.T).query(self.positions.T, k=2)
        return np.asarray(distance[:, 1], float)

    @cached_property
    def clear(self) -> Array:
        """Return the distances along x and y to the nearest centre in that direction, in m.

        Shape (2, n) for :attr:`positions`; a centre counts in the direction of its larger offset,
        and infinity stands for none.
        """
        x, y = np.abs(self.positions[:, :, None] - self.positions[:, None])
        np.fill_diagonal(x, np.inf)
        along = np.where(x >= y, x, np.inf).min(axis=1)
        across = np.where(x < y, y, np.inf).min(axis=1)
        return np.stack([along, across])

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """Return the index range of each row of markers, which have the same y."""
        ends = np.flatnonzero(np.abs(np.diff(self.centres[1])) > 1e-9) + 1
        return tuple(slice(int(a), int(b)) for a, b in pairwise([0, *ends, self.count]))

    @property
    def middle_row(self) -> slice:
        """Return the index range of the middle row of markers."""
        return self.rows[len(self.rows) // 2]

    @property
    def columns(self) -> int:
        """Return the number of markers in the middle row."""
        return self.middle_row.stop - self.middle_row.start

    @property
    def row_spacing(self) -> float:
        """Return the distance between the first two rows in m; NaN for a single row."""
        y = self.centres[1, [row.start for row in self.rows[:2]]]
        return float(np.diff(y)[0]) if len(y) == 2 else np.nan

    @property
    def corners(self) -> Array:
        """Return the corners of the structure, (0, 0), (L, 0), (L, W), (0, W), shape (2, 4), m."""
        return np.array(self.extent)[:, None] * [[0, 1, 1, 0], [0, 0, 1, 1]]

    @property
    def world(self) -> Array:
        """Return the centres at rest in the world, shape (3, n), m."""
        return on_surface(self.extent, self.positions)


Count = Annotated[Whole, Field(ge=1, le=200)]


def beam_default(name: str, scale: int = 1) -> Any:
    """Return a factory of a manifest default: a property of the thesis's beam (Table 3.1)."""

    def read() -> Any:
        from thesis_lib.facts import setups

        return round(scale * getattr(setups.thesis_beam(), name), 9)

    return read


def _default_hole(given: dict[str, Any]) -> Place | None:
    """Return the hole if the markers are those of the thesis, else None."""
    own = all(
        given.get(name) == MarkersSpec.model_fields[name].get_default(call_default_factory=True)
        for name in ("rows", "columns", "spacing_mm", "row_spacing_mm", "diameter_mm", "points_mm")
    )
    return (24.0, 10.0) if own else None


class MarkersSpec(Fields):
    """Round markers on the structure: rows along it, or any given positions."""

    rows: Count = 3
    """number of rows of markers"""
    columns: Count = Field(default_factory=beam_default("n_markers"))
    """number of markers in each row"""
    spacing_mm: Positive = Field(default_factory=beam_default("marker_spacing", 1000))
    """distance between centres along a row"""
    row_spacing_mm: Positive = 10.0
    """distance between rows"""
    diameter_mm: Positive = 5.0
    """diameter of the markers"""
    points_mm: tuple[Place, ...] | None = Field(None, min_length=4, max_length=2000)
    """positions of markers that form no rows, from the clamped corner; replaces rows and columns"""
    tone: Literal["dark", "bright"] = "dark"
    """whether the markers are darker or brighter than the structure"""
    detector: Literal["disc"] = "disc"
    """method that detects the markers in a frame"""
    hole_mm: Place | None = Field(default_factory=_default_hole)
    """centre of a hole that looks like a marker, from the clamped corner"""


def rows_on(
    beam: Beam,
    rows: int = 3,
    row_spacing: float = 0.010,
    diameter: float = 0.005,
    hole: tuple[float, float] | None = (0.024, 0.010),
) -> Markers:
    """Return the markers of the thesis's beam: rows along it, centred across it.

    Their number in a row and their spacing are properties of the beam; the thesis states neither
    the distance between rows nor the position of the hole.
    """
    along, _ = beam.markers
    y = beam.width / 2 + (np.arange(rows) - (rows - 1) / 2) * row_spacing
    grid = np.stack([np.tile(along, rows), np.repeat(y, len(along))])
    return Markers(beam.extent, grid, diameter, hole)


def on_surface(
    extent: tuple[float, float], points: ArrayLike, deflection: ArrayLike = 0.0
) -> Array:
    """Return world coordinates (3, ...) in m of points (2, ...) deflected along Z."""
    x, y = np.asarray(points, float)
    length, width = extent
    return np.stack(np.broadcast_arrays(x - length / 2, y - width / 2, deflection))
