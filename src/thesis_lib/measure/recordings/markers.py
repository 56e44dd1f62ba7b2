"""What stands before the cameras: a structure with printed markers that vibrates, and its force.

Markers are counted row by row along x, row after row in y; the hole, which looks like a marker,
comes last. Positions on the structure are in its own frame (x from the clamp, y across, m); the
world's origin is the structure's centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from thesis_lib.arrays import Array
from thesis_lib.vibration.beam import Beam


@dataclass(frozen=True)
class Markers:
    """Round markers on a flat structure, and one hole that looks like them (thesis 5.1.1)."""

    extent: tuple[float, float]  #: Length and width of the structure in m
    centres: Array  #: Centres on the structure in m, from its corner, shape (2, n)
    diameter: float  #: Diameter of markers and hole in m
    hole: tuple[float, float] | None = None  #: Centre of the hole in m
    bright: bool = False  #: Whether they are brighter than the structure

    @cached_property
    def positions(self) -> Array:
        """Centres of the markers and of the hole, if any, shape (2, n), m."""
        return self.centres if self.hole is None else np.column_stack([self.centres, self.hole])

    @property
    def count(self) -> int:
        """Markers without the hole."""
        return self.centres.shape[1]

    @cached_property
    def nearest(self) -> Array:
        """Distance of each of :attr:`positions` to the nearest other one, m."""
        distance, _ = KDTree(self.positions.T).query(self.positions.T, k=2)
        return np.asarray(distance[:, 1], float)

    @cached_property
    def clear(self) -> Array:
        """Distance along x to the nearest other centre that lies rather along x, and along y.

        Shape (2, n) for :attr:`positions`, in m; infinite where there is none.
        """
        x, y = np.abs(self.positions[:, :, None] - self.positions[:, None])
        np.fill_diagonal(x, np.inf)
        along = np.where(x >= y, x, np.inf).min(axis=1)
        across = np.where(x < y, y, np.inf).min(axis=1)
        return np.stack([along, across])

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """Runs of markers at the same y."""
        ends = np.flatnonzero(np.abs(np.diff(self.centres[1])) > 1e-9) + 1
        return tuple(slice(int(a), int(b)) for a, b in pairwise([0, *ends, self.count]))

    @property
    def middle_row(self) -> slice:
        """Where the row on the structure's axis stands among the markers."""
        return self.rows[len(self.rows) // 2]

    @property
    def columns(self) -> int:
        """Markers in the middle row."""
        return self.middle_row.stop - self.middle_row.start

    @property
    def row_spacing(self) -> float:
        """Distance between the first two rows in m; NaN if there is one."""
        y = self.centres[1, [row.start for row in self.rows[:2]]]
        return float(np.diff(y)[0]) if len(y) == 2 else np.nan

    @property
    def corners(self) -> Array:
        """Corners of the structure, (0, 0), (L, 0), (L, W), (0, W), shape (2, 4), m."""
        return np.array(self.extent)[:, None] * [[0, 1, 1, 0], [0, 0, 1, 1]]

    @property
    def world(self) -> Array:
        """Centres at rest in the world, shape (3, n), m."""
        return on_surface(self.extent, self.positions)


def rows_on(
    beam: Beam,
    rows: int = 3,
    row_spacing: float = 0.010,
    diameter: float = 0.005,
    hole: tuple[float, float] | None = (0.024, 0.010),
) -> Markers:
    """The markers of the thesis's beam: rows along it, centred across it.

    Their number in a row and their spacing are the beam's; the thesis states neither the rows'
    distance nor where the hole is.
    """
    along, _ = beam.markers
    across = (np.arange(rows) - (rows - 1) / 2) * row_spacing
    y = beam.width / 2 + across
    grid = np.stack([np.tile(along, rows), np.repeat(y, len(along))])
    return Markers(beam.extent, grid, diameter, hole)


def on_surface(
    extent: tuple[float, float], points: ArrayLike, deflection: ArrayLike = 0.0
) -> Array:
    """World coordinates (3, ...) of points (2, ...) of a structure, deflected along Z, in m."""
    x, y = np.asarray(points, float)
    length, width = extent
    return np.stack(np.broadcast_arrays(x - length / 2, y - width / 2, deflection))
