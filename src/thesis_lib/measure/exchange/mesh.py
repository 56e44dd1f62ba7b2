"""Which markers are neighbours: faces between them, for images and for programs of the field."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import Delaunay, QhullError

from thesis_lib.arrays import Array, IntArray

MAX_ROW_OFFSET_M = 1e-6  # m; markers closer than this along an axis stand in one row or column
MAX_EDGE_RATIO = 2.5  # times the middle edge's length, beyond which an edge spans a gap


def marker_faces(x: ArrayLike, y: ArrayLike) -> IntArray:
    """Return the faces between markers, counted from 0, with corners in one sense of rotation.

    Parameters
    ----------
    x, y : array_like, shape (markers,)
        Places in m.

    Returns
    -------
    ndarray of int, shape (faces, 4) or (faces, 3)
        Rectangles if the markers fill a grid of rows and columns, else triangles (Delaunay) without
        those that span a gap; none if all markers stand on one line.
    """
    points = np.column_stack([np.asarray(x, float), np.asarray(y, float)])
    column, row = (_classes(values) for values in points.T)
    columns, rows = column.max() + 1, row.max() + 1
    if min(columns, rows) >= 2 and len(points) == columns * rows:
        place = np.full((rows, columns), -1)
        place[row, column] = np.arange(len(points))
        if (place >= 0).all():
            corners = place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]
            return np.stack(corners, axis=-1).reshape(-1, 4)
    try:
        found = Delaunay(points).simplices
    except (QhullError, ValueError):  # on one line, or fewer than three
        return np.empty((0, 3), int)
    sides = np.linalg.norm(points[found] - points[np.roll(found, 1, axis=1)], axis=2)
    return np.asarray(found[sides.max(axis=1) <= MAX_EDGE_RATIO * np.median(sides)], int)


def marker_edges(x: ArrayLike, y: ArrayLike) -> IntArray:
    """Return lines between neighbours, (lines, 2), each once; along the row if all stand in one."""
    corners = marker_faces(x, y)
    if not len(corners):
        order = np.lexsort((np.asarray(y, float), np.asarray(x, float)))
        return np.column_stack([order[:-1], order[1:]])
    pairs = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _classes(values: Array) -> IntArray:
    """Return the numbers of values in ascending order; those that are as good as equal have one."""
    order = np.argsort(values)
    number = np.empty(len(values), int)
    number[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > MAX_ROW_OFFSET_M)])
    return number
