"""Thin plates of any outline, with holes: a :class:`~thesis_lib.vibration.structure.Structure`.

Beam and rectangle have closed forms; a panel's frequencies and shapes come from finite elements
(:mod:`thesis_lib.vibration.finite_elements`). The origin of its frame is the lower left corner of
the box around it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, Mask
from thesis_lib.vibration import finite_elements, polygons, structure

MODES_PER_BATCH = 10  # modes computed at a time
ON_EDGE = 1e-9  # share of the box's longer side: a point nearer than this to an edge is on it


@dataclass(frozen=True)
class Panel(structure.Sheet):
    """Thin plate with a polygonal outline and holes.

    Raises
    ------
    ShapeError
        If a parameter is invalid or the panel cannot be meshed; the message is one line.
    """

    outline: tuple[polygons.Point, ...]  #: Corners in m; the box around them begins at (0, 0)
    #: Support of each edge, from the corner of its number to the next: ``simply supported``,
    #: ``clamped`` or ``free``
    supports: tuple[str, ...]
    holes: tuple[polygons.Hole, ...]  #: Round or polygonal holes; their edges are free
    thickness: float  #: In m
    density: float  #: In kg/m³
    youngs_modulus: float  #: In Pa
    poisson: float  #: Poisson's ratio
    damping: float  #: Modal damping ratio ξ, equal for all modes
    force_position: polygons.Point  #: Where the point force acts, x and y in m
    #: Numbers of cells into which the box is divided along x and y; a cell whose centre is on the
    #: panel has a marker there
    grid: tuple[int, int]
    element_size: float  #: Length of an element's side in m

    def __post_init__(self) -> None:
        positive = ("thickness", "density", "youngs_modulus", "element_size")
        for name, is_right, allowed in (
            *((one, 0 < getattr(self, one) < math.inf, "a number above 0") for one in positive),
            ("poisson", -1 < self.poisson < 0.5, "a number above -1 and below 0.5"),
            ("damping", 0 <= self.damping < math.sqrt(0.5), "a number from 0 to below 0.707"),
            ("force_position", np.isfinite(self.force_position).all(), "finite numbers"),
            ("grid", min(self.grid) >= 1, "whole numbers from 1"),
        ):
            if not is_right:
                raise polygons.ShapeError(name, getattr(self, name), allowed)
        _check_polygon("outline", self.outline)
        low = np.min(self.outline, axis=0)
        if np.any(np.abs(low) > ON_EDGE * max(self.extent)):
            given = f"a box from {tuple(low.tolist())}"
            raise polygons.ShapeError("outline", given, "corners whose box begins at (0, 0)")
        _check_holes(self)
        _check_supports(self)
        if not self.covers(np.array(self.force_position, float)[:, None])[0]:
            raise polygons.ShapeError("force_position", self.force_position, "a point on the panel")
        if (found := self.markers.shape[1]) < 3:
            allowed = f"a finer one: fewer than 3 cells have their centre on the panel ({found})"
            raise polygons.ShapeError("grid", self.grid, allowed)
        _check_mesh(self.outline, self.holes, self.element_size)

    @property
    def area(self) -> float:
        """Return the area in m²."""
        cut = (
            math.pi * hole.radius**2
            if isinstance(hole, polygons.Circle)
            else abs(polygons.polygon_area(hole))
            for hole in self.holes
        )
        return abs(polygons.polygon_area(self.outline)) - sum(cut)

    @property
    def mass(self) -> float:
        """Mass in kg, which is also every mode's modal mass."""
        return self.mass_per_area * self.area

    @property
    def extent(self) -> tuple[float, float]:
        """Return the length and width of the box around the panel in m."""
        x, y = np.max(self.outline, axis=0).tolist()
        return x, y

    @property
    def markers(self) -> Array:
        """Centres of the cells that are on the panel, shape (2, markers), in m; x runs fastest."""
        centres = structure.cell_centres(self.grid, self.extent)
        return centres[:, self.covers(centres)]

    @property
    def contours(self) -> list[Array]:
        """Closed curves to draw, each (corners, 2) in m: outline anticlockwise, holes clockwise."""
        coarse = max(self.extent)
        outer = np.array(self.outline, float)
        holes = [polygons.divide_hole(hole, coarse) for hole in self.holes]
        signs = [int(np.sign(polygons.polygon_area(curve))) for curve in (outer, *holes)]
        return [outer[:: signs[0]], *(c[::-sign] for c, sign in zip(holes, signs[1:], strict=True))]

    def covers(self, points: ArrayLike) -> Mask:
        """Return whether points (2, n) in m are on the panel; its edges are part of it."""
        points = np.asarray(points, float)
        cutouts = [hole for hole in self.holes if not isinstance(hole, polygons.Circle)]
        depths = polygons.polygon_depths(self.outline, points, cutouts)
        on = depths >= -ON_EDGE * max(self.extent)
        for hole in self.holes:
            if isinstance(hole, polygons.Circle):
                on &= np.hypot(points[0] - hole.x, points[1] - hole.y) >= hole.radius
        return on

    def angular_frequencies(self, n_modes: int) -> Array:
        """Return the first natural frequencies in rad/s, shape (n_modes,): ω = √(λ D / m)."""
        ratio = self.bending_stiffness / self.mass_per_area
        return np.sqrt(_find_modes(self, n_modes).eigenvalues[:n_modes] * ratio)

    def shape_peak(self, mode: int) -> float:
        """Return the largest absolute value of a mode shape at the corners of the elements."""
        return float(_find_modes(self, mode).peaks[mode - 1])

    def mode_shapes(self, modes: Sequence[int], points: ArrayLike) -> Array:
        """Return mode shapes at `points` (2, ...), shape (modes, ...); NaN off the panel.

        Their mean square over the panel is 1, and their signs are those of
        :func:`thesis_lib.vibration.finite_elements.plate_modes`.
        """
        numbers, points = structure.mode_numbers(modes), np.asarray(points, float)
        flat = points.reshape(2, -1)
        values = np.full((len(numbers), flat.shape[1]), np.nan)
        on = self.covers(flat)
        if on.any():
            found, kept = _find_modes(self, int(numbers.max())), flat[:, on]
            values[:, on] = found.at(kept)[numbers - 1]
        return values.reshape((len(numbers), *points.shape[1:]))


@lru_cache(maxsize=8)
def _compute_batch(panel: Panel, batches: int) -> finite_elements.PlateModes:
    mesh = polygons.mesh_outline(panel.outline, panel.holes, panel.element_size)
    sides: dict[str, list[Any]] = {
        support: [np.zeros(0, np.int64)] for support in finite_elements.SUPPORTS
    }
    for edge, support in zip(polygons.polygon_edges(panel.outline), panel.supports, strict=True):
        sides[support].append(finite_elements.facets_along(mesh, *edge))
    clamped = np.concatenate(sides[finite_elements.CLAMPED_EDGE])
    supported = np.concatenate(sides[finite_elements.SIMPLY_SUPPORTED])
    count = batches * MODES_PER_BATCH
    return finite_elements.plate_modes(mesh, clamped, supported, panel.poisson, count)


def _find_modes(panel: Panel, n_modes: int) -> finite_elements.PlateModes:
    """Return at least the first `n_modes` modes, cached."""
    return _compute_batch(panel, math.ceil(n_modes / MODES_PER_BATCH))


# Checks of a panel's parameters.


def _check_polygon(name: str, polygon: Sequence[polygons.Point]) -> None:
    if len(polygon) < 3 or not np.all(np.isfinite(np.asarray(polygon, float))):
        raise polygons.ShapeError(name, polygon, "at least 3 corners, of finite numbers")
    if not polygons.is_simple(polygon):
        raise polygons.ShapeError(name, polygon, "edges that meet at their common corners alone")


def _check_holes(panel: Panel) -> None:
    for hole in panel.holes:
        if isinstance(hole, polygons.Circle):
            finite = all(map(math.isfinite, (hole.x, hole.y, hole.radius)))
            if not (finite and hole.radius > 0):
                raise polygons.ShapeError("holes", hole, "finite numbers, and a radius above 0")
        else:
            _check_polygon("holes", hole)
        if not polygons.is_within(hole, panel.outline):
            raise polygons.ShapeError("holes", hole, "a hole inside the outline")
    for one, other in combinations(panel.holes, 2):
        if not polygons.are_apart(one, other):
            raise polygons.ShapeError("holes", (one, other), "holes that do not touch")


def _check_supports(panel: Panel) -> None:
    sides = polygons.polygon_edges(panel.outline)
    if len(panel.supports) != len(sides) or not set(panel.supports) <= set(
        finite_elements.SUPPORTS
    ):
        allowed = f"one of {', '.join(finite_elements.SUPPORTS)} for each of {len(sides)} edges"
        raise polygons.ShapeError("supports", panel.supports, allowed)
    supported = [s == finite_elements.SIMPLY_SUPPORTED for s in panel.supports]
    held = np.array(sides)[supported].reshape(-1, 2)
    near = ON_EDGE * max(panel.extent)
    on_a_line = len(held) < 3 or np.linalg.matrix_rank(held[1:] - held[0], tol=near) < 2
    if finite_elements.CLAMPED_EDGE not in panel.supports and on_a_line:
        allowed = "a clamped edge, or simply supported ones that are not on one line"
        raise polygons.ShapeError("supports", panel.supports, allowed)


@lru_cache(maxsize=32)
def _check_mesh(
    outline: tuple[polygons.Point, ...], holes: tuple[polygons.Hole, ...], size: float
) -> None:
    polygons.triangulate_polygon(outline, holes, size)
