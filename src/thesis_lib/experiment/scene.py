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
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from thesis_lib.structures import Beam, Structure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Markers:
    """Round markers on a flat structure, and one hole that looks like them (thesis 5.1.1).

    Parameters
    ----------
    extent : tuple of float
        Length and width of the structure in m.
    centres : ndarray, shape (2, n)
        Centres on the structure in m, from its corner.
    diameter : float
        Diameter of markers and hole in m.
    hole : tuple of float or None
        Centre of the hole in m.
    bright : bool
        Whether they are brighter than the structure.
    """

    extent: tuple[float, float]
    centres: Array
    diameter: float
    hole: tuple[float, float] | None = None
    bright: bool = False

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


@dataclass(frozen=True)
class Component:
    """One harmonic part of a motion.

    Parameters
    ----------
    kind : str
        ``bending`` (the modes of eq. 3.4) or ``torsion`` (sin((2n − 1)πx / 2L) times y).
    mode : int
        Number from 1.
    frequency : float
        In Hz.
    amplitude : float
        At the tip (torsion: at the tip's edges; a plate: at an antinode), in m.
    phase : float
        In rad.
    """

    kind: str = "bending"
    mode: int = 1
    frequency: float = 4.25
    amplitude: float = 0.004
    phase: float = 0.0

    def shape(self, structure: Structure, points: ArrayLike) -> Array:
        """Deflection for amplitude 1 at points (2, ...) of the structure's frame, dimensionless."""
        x, y = np.asarray(points, float)
        if self.kind == "torsion":
            length, width = structure.extent
            turn: Array = np.sin((2 * self.mode - 1) * np.pi * x / (2 * length))
            return turn * (2 * y / width - 1)
        shape: Array = structure.mode_shapes([self.mode], [x, y])[0] / structure.shape_peak(
            self.mode
        )
        # The beam's modes are taken upward at the tip, whatever sign eq. 3.4 gives them there.
        return shape * (-1) ** (self.mode + 1) if isinstance(structure, Beam) else shape


@dataclass(frozen=True)
class Motion:
    """A structure at rest that starts to vibrate and reaches a steady state.

    Parameters
    ----------
    structure : Structure
        What moves, a beam or a plate.
    components : sequence of Component
        Bending and torsion in any mix.
    start : float
        Time of the first motion, s.
    ramp : float
        Time from there to the steady state, s; the envelope is a polynomial of degree 7, so that
        the acceleration, and with it the force, has no jump.
    """

    structure: Structure
    components: tuple[Component, ...] = (Component(),)
    start: float = 1.25
    ramp: float = 0.5

    @property
    def steady(self) -> float:
        """Time from which the vibration is harmonic, s."""
        return self.start + self.ramp

    def shapes(self, points: ArrayLike) -> Array:
        """Shapes of the components at points (2, ...), shape (components, ...)."""
        return np.stack([part.shape(self.structure, points) for part in self.components])

    def coordinates(self, times: ArrayLike) -> Array:
        """Displacement of each component where its shape is 1, shape (components, ...), m."""
        t = np.asarray(times, float)
        return np.stack([self._histories(part, t)[0] for part in self.components])

    def deflection(self, points: ArrayLike, times: ArrayLike) -> Array:
        """Deflection in m at points (2, ...) and times (n,), shape (n, ...)."""
        return np.tensordot(self.coordinates(times), self.shapes(points), axes=(0, 0))

    def force(self, times: ArrayLike) -> Array:
        """Force in N of the shaker that makes the bending components move as they do.

        One-mode inverse dynamics, F φ(x_F) = m (q̈ + 2ξωₙ q̇ + ωₙ² q), with the natural frequency
        that puts the displacement resonance at the component's frequency; torsion takes none, as
        the force acts on the axis.
        """
        t = np.asarray(times, float)
        total = np.zeros_like(t)
        structure, xi = self.structure, self.structure.damping
        for part in self.components:
            if part.kind == "torsion":
                continue
            w, first, second = self._histories(part, t)
            natural = 2 * np.pi * part.frequency / np.sqrt(1 - 2 * xi**2)
            drive = part.shape(structure, structure.force_point)[0]
            modal_mass = structure.mass / structure.shape_peak(part.mode) ** 2  # for a peak of 1
            total += modal_mass / drive * (second + 2 * xi * natural * first + natural**2 * w)
        return total

    def _histories(self, part: Component, t: Array) -> tuple[Array, Array, Array]:
        """A component's displacement where its shape is 1, and two derivatives in time."""
        s = np.clip((t - self.start) / self.ramp, 0, 1)
        e0 = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
        e1 = 140 * s**3 * (1 - s) ** 3 / self.ramp
        e2 = 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s) / self.ramp**2
        omega = 2 * np.pi * part.frequency
        angle = omega * (t - self.start) + part.phase
        sine, cosine = part.amplitude * np.sin(angle), part.amplitude * omega * np.cos(angle)
        return (
            e0 * sine,
            e1 * sine + e0 * cosine,
            e2 * sine + 2 * e1 * cosine - omega**2 * e0 * sine,
        )


def amplitudes(motion: Motion, points: ArrayLike, frequency: float) -> NDArray[np.complex128]:
    """Complex amplitudes in m, time factor e^{+jωt}, of the steady state's part at a frequency."""
    total = np.zeros(np.shape(np.asarray(points, float)[0]), complex)
    for part in motion.components:
        if np.isclose(part.frequency, frequency):
            omega = 2 * np.pi * part.frequency
            phase = part.phase - np.pi / 2 - omega * motion.start
            total += part.amplitude * np.exp(1j * phase) * part.shape(motion.structure, points)
    return total
