"""Triangles for a flat region: a polygon with round or polygonal holes (no mesh generator needed).

Boundaries are cut into pieces about as long as an element, a hexagonal grid fills the inside, and
Delaunay's triangulation joins the points. A piece of the boundary becomes an edge of a triangle if
the circle on it as diameter is empty, so points in such circles are left out. Small round holes
are surrounded by rings of points whose distance grows with the radius; triangles around re-entrant
corners, where bending moments are singular, are halved several times.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.arrays import Array, IntArray
from thesis_lib.vibration.polygons import (
    Circle,
    Hole,
    Point,
    ShapeError,
    edge_distances,
    polygon_area,
    polygon_contains,
)

if TYPE_CHECKING:
    from skfem import MeshTri

MIN_CIRCLE_PIECES = 24  # least number of pieces of a circle
MIN_BOUNDARY_RATIO = 0.6  # least distance of a grid point from the boundary, over the element size
MIN_TRIANGLES, MAX_TRIANGLES = 200, 60_000  # triangles


def divide_hole(hole: Hole, size: float) -> Array:
    """Divide a hole's boundary into pieces about `size` long; their corners, (pieces, 2)."""
    if not isinstance(hole, Circle):
        return _cut(hole, size)
    count = max(MIN_CIRCLE_PIECES, int(np.ceil(2 * np.pi * hole.radius / size)))
    turn = 2 * np.pi * np.arange(count) / count
    return np.stack([hole.x + hole.radius * np.cos(turn), hole.y + hole.radius * np.sin(turn)], 1)


def _cut(polygon: Sequence[Point], size: float) -> Array:
    """Cut a polygon into pieces no longer than `size`; return first corners (pieces, 2)."""
    parts = []
    corners = np.array(polygon, float)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.hypot(*(end - start)) / size - 1e-9)))
        parts.append(start + np.arange(count)[:, None] / count * (end - start))
    return np.concatenate(parts)


def _rings(circle: Circle, count: int, size: float) -> list[Array]:
    """Return rings of points around a small hole, as far apart as points, up to `size`."""
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
        What is cut out.
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
    loops = [_cut(outline, size), *(divide_hole(hole, size) for hole in holes)]
    points = _points(outline, holes, size, loops)
    corners = Delaunay(points.T).simplices
    middle = points[:, corners].mean(axis=2)
    kept = polygon_contains(loops[0], middle)
    for loop in loops[1:]:
        kept &= ~polygon_contains(loop, middle)
    corners = _anticlockwise(points, corners[kept])
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
    corners = _reentrant(outline, True)
    for hole in holes:
        corners += [] if isinstance(hole, Circle) else _reentrant(hole, False)
    for level in range(halvings if corners else 0):
        reach = 1.5 * size / 2**level
        middle = mesh.p[:, mesh.t].mean(axis=1)
        near = [np.hypot(*(middle - np.array(corner)[:, None])) < reach for corner in corners]
        mesh = mesh.refined(np.flatnonzero(np.any(near, axis=0)))
    return mesh


def _points(
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
        rings = _rings(hole, len(loop), size) if isinstance(hole, Circle) else []
        for ring in rings:
            gap = np.hypot(*(ring[:, 0] - ring[:, 1]))
            others = (other for other in holes if other is not hole)
            taken.append(_free(ring, outline, others, MIN_BOUNDARY_RATIO * gap))
        if rings and isinstance(hole, Circle):
            reach = np.hypot(*(rings[-1][:, 0] - [hole.x, hole.y])) + MIN_BOUNDARY_RATIO * size
            away = np.hypot(inside[0] - hole.x, inside[1] - hole.y) > reach
            inside = inside[:, away]
            for other in range(len(loops), len(taken) - len(rings)):  # rings of other holes
                far = np.hypot(taken[other][0] - hole.x, taken[other][1] - hole.y) > reach
                taken[other] = taken[other][:, far]
    taken.append(_free(inside, outline, holes, MIN_BOUNDARY_RATIO * size))
    return np.concatenate(taken, axis=1)


def _free(points: Array, outline: Sequence[Point], holes: Iterable[Hole], gap: float) -> Array:
    """Return those of points (2, n) in the region that are at least `gap` from its boundaries."""
    kept = polygon_contains(outline, points) & np.all(edge_distances(outline, points) > gap, axis=0)
    for hole in holes:
        if isinstance(hole, Circle):
            kept &= np.hypot(points[0] - hole.x, points[1] - hole.y) > hole.radius + gap
        else:
            kept &= ~polygon_contains(hole, points) & np.all(
                edge_distances(hole, points) > gap, axis=0
            )
    return points[:, kept]


def _twice_areas(points: Array, corners: IntArray) -> Array:
    """Return twice the signed areas of triangles (n, 3)."""
    a, b, c = points[:, corners.T].transpose(1, 0, 2)
    twice: Array = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return twice


def _anticlockwise(points: Array, corners: IntArray) -> IntArray:
    """Return triangles (n, 3) in one sense, without those of no area."""
    twice = _twice_areas(points, corners)
    real = np.abs(twice) > 1e-9 * np.max(np.abs(twice))
    return np.where((twice > 0)[:, None], corners, corners[:, ::-1])[real]


def _reentrant(polygon: Sequence[Point], outer: bool) -> list[Point]:
    """Return the corners of a boundary at which the region has an angle above 180°."""
    corners = np.array(polygon, float)
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn /= np.hypot(*before.T) * np.hypot(*after.T)
    sign = np.sign(polygon_area(polygon)) * (1 if outer else -1)
    return [tuple(c) for c, t in zip(corners.tolist(), turn * sign, strict=True) if t < -1e-6]
