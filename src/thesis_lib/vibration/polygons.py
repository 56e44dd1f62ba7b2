"""Polygons and round holes: what lies in them, how far from them, and whether they meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, Mask

Point = tuple[float, float]


@dataclass(frozen=True)
class Circle:
    """A round hole: centre and radius in m."""

    x: float
    y: float
    radius: float


Hole = Circle | tuple[Point, ...]


class ShapeError(ValueError):
    """A shape that cannot be computed, in one line.

    Parameters
    ----------
    what : str
        Which of its parameters is wrong.
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

    I. E. Sutherland and G. W. Hodgman, Commun. ACM 17 (1974): parts that lie apart are joined by
    edges of no width. No corners are left of a polygon outside.
    """
    found = np.asarray(polygon, float)
    for axis, sign, limit in (
        (axis, sign, limit)
        for sign, limits in ((1, low), (-1, high))
        for axis, limit in enumerate(np.asarray(limits, float))
    ):
        depth = sign * (found[:, axis] - limit)
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

    Without an area, the others are 0.
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


def polygon_contains(polygon: ArrayLike, points: Array) -> Mask:
    """Test whether points (2, n) lie in a polygon (corners, 2): count edges to their right.

    Of a point on an edge the answer may be either.
    """
    corners = np.asarray(polygon, float)
    x, y = points
    (x0, y0), (x1, y1) = corners.T[:, :, None], np.roll(corners, -1, axis=0).T[:, :, None]
    between = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        right = x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    inside: Mask = np.sum(between & right, axis=0) % 2 == 1
    return inside


def in_hole(hole: Hole, points: Array) -> Mask:
    """Test whether points (2, n) lie in a hole."""
    if isinstance(hole, Circle):
        return np.hypot(points[0] - hole.x, points[1] - hole.y) < hole.radius
    return polygon_contains(hole, points)


def edge_distances(polygon: ArrayLike, points: Array) -> Array:
    """Return distances (edges, n) of points (2, n) from a polygon's edges (corners, 2)."""
    start = np.asarray(polygon, float)[:, :, None]
    along = np.roll(start, -1, axis=0) - start
    offset = points - start
    t = np.sum(offset * along, axis=1) / np.sum(along**2, axis=1)
    foot = offset - np.clip(t, 0, 1)[:, None] * along
    return np.hypot(foot[:, 0], foot[:, 1])


def is_simple(polygon: Sequence[Point]) -> bool:
    """Test whether no two edges of a polygon meet but neighbours at their common corner."""
    sides = [(np.array(a, float), np.array(b, float)) for a, b in polygon_edges(polygon)]
    n = len(sides)
    folded = any(
        _cross(b - a, c - b) == 0 and np.dot(b - a, c - b) <= 0
        for (a, b), (_, c) in zip(sides, sides[1:] + sides[:1], strict=True)
    )
    apart = [(i, j) for i in range(n) for j in range(i + 2, n) if (i, j) != (0, n - 1)]
    return not folded and not any(segments_meet(*sides[i], *sides[j]) for i, j in apart)


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def segments_meet(a: Array, b: Array, c: Array, d: Array) -> bool:
    """Test whether the segments ab and cd have a point in common."""
    turns = [_cross(b - a, c - a), _cross(b - a, d - a), _cross(d - c, a - c), _cross(d - c, b - c)]
    if turns[0] * turns[1] < 0 and turns[2] * turns[3] < 0:
        return True
    return any(
        turn == 0 and np.dot(p - s, p - e) <= 0
        for turn, p, s, e in zip(turns, (c, d, a, b), (a, a, c, c), (b, b, d, d), strict=True)
    )


def polygon_edges(polygon: Sequence[Point]) -> list[tuple[Point, Point]]:
    """Return pairs of corners: each and the next, and the last and the first."""
    return list(zip(polygon, [*polygon[1:], polygon[0]], strict=True))


def is_within(hole: Hole, outline: Sequence[Point]) -> bool:
    """Test whether a hole lies in a polygon and does not touch its edges."""
    if isinstance(hole, Circle):
        centre = np.array([[hole.x], [hole.y]])
        return bool(
            polygon_contains(outline, centre)[0]
            and np.all(edge_distances(outline, centre) > hole.radius)
        )
    return bool(np.all(polygon_contains(outline, np.array(hole).T))) and not _meet_anywhere(
        hole, outline
    )


def are_apart(one: Hole, other: Hole) -> bool:
    """Test whether two holes have no point in common."""
    if isinstance(one, Circle) and isinstance(other, Circle):
        return math.hypot(one.x - other.x, one.y - other.y) > one.radius + other.radius
    if isinstance(one, Circle):
        centre = np.array([[one.x], [one.y]])
        outside = not in_hole(other, centre)[0]
        assert not isinstance(other, Circle)
        return bool(outside and np.all(edge_distances(other, centre) > one.radius))
    if isinstance(other, Circle):
        return are_apart(other, one)
    nested = (
        polygon_contains(one, np.array(other[:1]).T)[0]
        or polygon_contains(other, np.array(one[:1]).T)[0]
    )
    return not nested and not _meet_anywhere(one, other)


def _meet_anywhere(one: Sequence[Point], other: Sequence[Point]) -> bool:
    """Test whether two polygons' edges meet anywhere."""
    return any(
        segments_meet(*map(np.array, edge), *map(np.array, edge_))
        for edge, edge_ in product(polygon_edges(one), polygon_edges(other))
    )
