"""Polygons with polygonal or round holes, and their triangulation.

Boundaries are cut into pieces about as long as an element, a hexagonal grid of points fills the
inside, and Delaunay's triangulation joins the points. A piece of the boundary becomes an edge of a
triangle if the circle on it as diameter is empty, so points in such circles are left out. Small
round holes are surrounded by rings of points whose distance grows with the radius; triangles around
re-entrant corners, where bending moments are singular, are halved several times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, IntArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry
    from skfem import MeshTri


Point = tuple[float, float]


@dataclass(frozen=True)
class Circle:
    """A round hole: centre and radius in m."""

    x: float
    y: float
    radius: float


Hole = Circle | tuple[Point, ...]


class ShapeError(ValueError):
    """An invalid shape; the message is one line.

    Parameters
    ----------
    what : str
        Name of the invalid parameter.
    given : object
        Its value.
    allowed : str
        What is allowed, in words.
    """

    def __init__(self, what: str, given: object, allowed: str) -> None:
        super().__init__(f"{what}: given {given}, allowed: {allowed}")
        self.what, self.given, self.allowed = what, given, allowed


def polygon_area(polygon: ArrayLike) -> float:
    """Return ½ Σ (xᵢyᵢ₊₁ − xᵢ₊₁yᵢ), the signed area; positive if anticlockwise."""
    x, y = np.asarray(polygon, float).T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def clip_polygon(polygon: ArrayLike, low: ArrayLike, high: ArrayLike) -> Array:
    """Return the part of a polygon (corners, 2) in a box between two corners (2,), as a polygon.

    I. E. Sutherland and G. W. Hodgman, Commun. ACM 17 (1974): separate parts are joined by edges
    of zero width. The result has no corners for a polygon outside the box.
    """
    found = np.asarray(polygon, float)
    for (sign, limits), axis in product(((1, low), (-1, high)), range(2)):
        depth = sign * (found[:, axis] - np.asarray(limits, float)[axis])
        corners = []
        for i in range(len(found)):  # the edge to each corner from the one before
            if (depth[i - 1] < 0) != (depth[i] < 0):
                t = depth[i - 1] / (depth[i - 1] - depth[i])
                corners.append(found[i - 1] + t * (found[i] - found[i - 1]))
            if depth[i] >= 0:
                corners.append(found[i])
        found = np.array(corners).reshape(-1, 2)
    return found


def polygon_moments(polygon: ArrayLike) -> tuple[float, Array, Array]:
    """Return area, centroid (2,) and variances (2,) of a polygon (corners, 2) about it.

    If the area is 0, so are centroid and variances.
    """
    start = np.asarray(polygon, float).reshape(-1, 2)
    end = np.roll(start, -1, axis=0)
    cross = start[:, 0] * end[:, 1] - end[:, 0] * start[:, 1]
    whole = float(cross.sum() / 2)
    if whole == 0:
        return 0.0, np.zeros(2), np.zeros(2)
    centre = (start + end).T @ cross / (6 * whole)
    square = (start**2 + start * end + end**2).T @ cross / (12 * whole)
    return abs(whole), centre, square - centre**2


def polygon_depths(polygon: ArrayLike, points: Array, cutouts: Sequence[ArrayLike] = ()) -> Array:
    """Return distances (n,) of points (2, n) from the edges of a polygon (corners, 2) with cutouts.

    They are positive inside, negative outside and in cutouts.
    """
    import shapely  # takes longer than all other imports of this module

    region = shapely.Polygon(polygon, cutouts)
    sign = np.where(shapely.contains_xy(region, *points), 1, -1)
    return sign * shapely.distance(region.boundary, shapely.points(*points))


def polygon_edges(polygon: Sequence[Point]) -> list[tuple[Point, Point]]:
    """Return pairs of corners: each and the next, and the last and the first."""
    return list(zip(polygon, [*polygon[1:], polygon[0]], strict=True))


MIN_GAP_RATIO = 1e-9  # least gap over a boundary's length or radius; smaller ones are round-off


def is_simple(polygon: Sequence[Point]) -> bool:
    """Test whether the edges of a polygon meet at the common corners of neighbours alone."""
    import shapely

    ring = shapely.LinearRing(polygon)
    clear = ring.minimum_clearance > MIN_GAP_RATIO * ring.length  # of distinct corners
    return bool(clear and ring.is_simple) and len(set(polygon)) == len(polygon)


def is_within(hole: Hole, outline: Sequence[Point]) -> bool:
    """Test whether a hole lies in a polygon and does not touch its edges."""
    import shapely

    region, (core, reach) = shapely.Polygon(outline), _split_hole(hole)
    return bool(region.contains(core) and region.exterior.distance(core) > reach)


def are_apart(one: Hole, other: Hole) -> bool:
    """Test whether two holes have no point in common."""
    (core, reach), (other_core, other_reach) = _split_hole(one), _split_hole(other)
    return bool(core.distance(other_core) > reach + other_reach)


def _split_hole(hole: Hole) -> tuple[BaseGeometry, float]:
    """Return a hole's polygon or centre, and the distance in m within which it is touched."""
    import shapely

    if isinstance(hole, Circle):
        return shapely.Point(hole.x, hole.y), hole.radius * (1 + MIN_GAP_RATIO)
    polygon = shapely.Polygon(hole)
    return polygon, MIN_GAP_RATIO * polygon.length


MIN_CIRCLE_PIECES = 24  # least number of pieces of a circle
MIN_BOUNDARY_RATIO = 0.6  # least distance of a grid point from the boundary, over the element size
MIN_TRIANGLES, MAX_TRIANGLES = 200, 60_000


def divide_hole(hole: Hole, size: float) -> Array:
    """Divide a hole's boundary into pieces about `size` long; return corners (pieces, 2)."""
    if not isinstance(hole, Circle):
        return _cut_polygon(hole, size)
    count = max(MIN_CIRCLE_PIECES, int(np.ceil(2 * np.pi * hole.radius / size)))
    turn = 2 * np.pi * np.arange(count) / count
    return np.stack([hole.x + hole.radius * np.cos(turn), hole.y + hole.radius * np.sin(turn)], 1)


def _cut_polygon(polygon: Sequence[Point], size: float) -> Array:
    """Cut a polygon into pieces no longer than `size`; return first corners (pieces, 2)."""
    parts = []
    corners = np.array(polygon, float)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.hypot(*(end - start)) / size - 1e-9)))
        parts.append(start + np.arange(count)[:, None] / count * (end - start))
    return np.concatenate(parts)


def _ring_points(circle: Circle, count: int, size: float) -> list[Array]:
    """Return rings of points around a small hole, with a spacing that grows up to `size`."""
    rings, radius, turned = [], circle.radius, 0.0
    while (step := 2 * np.pi * radius / count * np.sqrt(3) / 2) < 0.75 * size:
        radius, turned = radius + step, turned + np.pi / count
        angle = turned + 2 * np.pi * np.arange(count) / count
        x, y = circle.x + radius * np.cos(angle), circle.y + radius * np.sin(angle)
        rings.append(np.stack([x, y]))
    return rings


def triangulate_polygon(
    outline: Sequence[Point], holes: Sequence[Hole], size: float
) -> tuple[Array, IntArray]:
    """Return the triangles of a polygon without its holes.

    Parameters
    ----------
    outline : sequence of (x, y)
        Corners in m.
    holes : sequence of Circle or sequence of (x, y)
        Holes in it.
    size : float
        Length of an element's side in m.

    Returns
    -------
    points : ndarray, shape (2, points)
        In m.
    corners : ndarray, shape (3, triangles)
        Numbers of the points of each triangle, anticlockwise.

    Raises
    ------
    ShapeError
        If there would be fewer than 200 or more than 60 000 triangles, or the region is too narrow
        for elements of this size.
    """
    from scipy.spatial import Delaunay

    count = abs(polygon_area(outline)) / (np.sqrt(3) / 4 * size**2)
    if not MIN_TRIANGLES <= count <= MAX_TRIANGLES:
        made = f"this one makes {count:.0f}"
        allowed = f"sizes that make {MIN_TRIANGLES} to {MAX_TRIANGLES} triangles ({made})"
        raise ShapeError("element_size", f"{size:g} m", allowed)
    loops = [_cut_polygon(outline, size), *(divide_hole(hole, size) for hole in holes)]
    points = _place_points(outline, holes, size, loops)
    corners = Delaunay(points.T).simplices
    corners = corners[polygon_depths(loops[0], points[:, corners].mean(axis=2), loops[1:]) > 0]
    twice = _twice_areas(points, corners)
    real = np.abs(twice) > 1e-9 * np.max(np.abs(twice))
    corners = np.where((twice > 0)[:, None], corners, corners[:, ::-1])[real]  # all anticlockwise
    used, corners = np.unique(corners, return_inverse=True)
    points, corners = points[:, used], corners.reshape(-1, 3).T.astype(np.int64)
    sides = np.sort(np.concatenate([corners[[0, 1]], corners[[1, 2]], corners[[2, 0]]], axis=1), 0)
    once = np.unique(sides, axis=1, return_counts=True)[1] == 1
    wanted = abs(polygon_area(loops[0])) - sum(abs(polygon_area(loop)) for loop in loops[1:])
    missed = abs(np.sum(_twice_areas(points, corners.T)) / 2 - wanted) > 1e-9 * wanted
    if missed or np.count_nonzero(once) != sum(map(len, loops)):
        allowed = "a smaller one, for the region is narrower than an element"
        raise ShapeError("element_size", f"{size:g} m", allowed)
    return np.ascontiguousarray(points), np.ascontiguousarray(corners)


def mesh_outline(
    outline: Sequence[Point], holes: Sequence[Hole], size: float, halvings: int = 9
) -> MeshTri:
    """Mesh an outline with holes; triangles at re-entrant corners are halved `halvings` times."""
    from skfem import MeshTri  # not needed to check a request

    mesh = MeshTri(*triangulate_polygon(outline, holes, size))
    corners = _find_reentrant(outline, True)
    for hole in holes:
        corners += [] if isinstance(hole, Circle) else _find_reentrant(hole, False)
    for level in range(halvings if corners else 0):
        reach = 1.5 * size / 2**level
        middle = mesh.p[:, mesh.t].mean(axis=1)
        near = [np.hypot(*(middle - np.array(corner)[:, None])) < reach for corner in corners]
        mesh = mesh.refined(np.flatnonzero(np.any(near, axis=0)))
    return mesh


def _place_points(
    outline: Sequence[Point], holes: Sequence[Hole], size: float, loops: Sequence[Array]
) -> Array:
    """Return all triangles' corners (2, n): boundaries, rings around holes, hexagonal grid."""
    low, high = loops[0].min(axis=0), loops[0].max(axis=0)
    across = np.arange(low[0], high[0] + size, size)
    up = np.arange(low[1], high[1] + size, size * np.sqrt(3) / 2)
    x, y = np.meshgrid(across, up)
    x[1::2] += size / 2
    inside = np.stack([x.ravel(), y.ravel()])
    taken = [loop.T for loop in loops]
    for hole, loop in zip(holes, loops[1:], strict=True):
        rings = _ring_points(hole, len(loop), size) if isinstance(hole, Circle) else []
        for ring in rings:
            gap = np.hypot(*(ring[:, 0] - ring[:, 1]))
            others = [other for other in holes if other is not hole]
            taken.append(_keep_free(ring, outline, others, MIN_BOUNDARY_RATIO * gap))
        if rings and isinstance(hole, Circle):
            reach = np.hypot(*(rings[-1][:, 0] - [hole.x, hole.y])) + MIN_BOUNDARY_RATIO * size
            away = np.hypot(inside[0] - hole.x, inside[1] - hole.y) > reach
            inside = inside[:, away]
            for other in range(len(loops), len(taken) - len(rings)):  # rings of other holes
                far = np.hypot(taken[other][0] - hole.x, taken[other][1] - hole.y) > reach
                taken[other] = taken[other][:, far]
    taken.append(_keep_free(inside, outline, holes, MIN_BOUNDARY_RATIO * size))
    return np.concatenate(taken, axis=1)


def _keep_free(points: Array, outline: Sequence[Point], holes: Sequence[Hole], gap: float) -> Array:
    """Return the points (2, n) in the region that are farther than `gap` from its boundaries."""
    circles = [hole for hole in holes if isinstance(hole, Circle)]
    cutouts = [hole for hole in holes if not isinstance(hole, Circle)]
    kept = polygon_depths(outline, points, cutouts) > gap
    for hole in circles:
        kept &= np.hypot(points[0] - hole.x, points[1] - hole.y) > hole.radius + gap
    return points[:, kept]


def _twice_areas(points: Array, corners: IntArray) -> Array:
    """Return twice the signed areas of triangles (n, 3)."""
    a, b, c = points[:, corners.T].transpose(1, 0, 2)
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _find_reentrant(polygon: Sequence[Point], outer: bool) -> list[Point]:
    """Return the corners of a boundary at which the region has an angle above 180°."""
    corners = np.array(polygon, float)
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn /= np.hypot(*before.T) * np.hypot(*after.T)
    sign = np.sign(polygon_area(polygon)) * (1 if outer else -1)
    return [tuple(c) for c, t in zip(corners.tolist(), turn * sign, strict=True) if t < -1e-6]
