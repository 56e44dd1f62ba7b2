"""What stands before the cameras: a beam with printed markers that vibrates, and its force.

Markers are counted row by row along x, row after row in y; the hole, which looks like a marker,
comes last. Positions on the structure are in its own frame (x from the clamp, y across, m); the
world's origin is the structure's centre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thesis_lib.structures import Beam

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Markers:
    """Round markers printed in rows on a beam, and one hole (thesis 5.1.1, Appendix F).

    Parameters
    ----------
    beam : Beam
        The beam that carries them; its `marker_spacing` is that along the rows.
    rows : int
        Rows, centred across the beam.
    row_spacing : float
        Distance between rows in m; the thesis does not state it.
    diameter : float
        Diameter of markers and hole in m.
    hole : tuple of float or None
        Centre of the hole in the beam's frame in m; the thesis does not state it.
    """

    beam: Beam
    rows: int = 3
    row_spacing: float = 0.010
    diameter: float = 0.005
    hole: tuple[float, float] | None = (0.024, 0.010)

    @property
    def positions(self) -> Array:
        """Centres of the markers and of the hole, if any, in the beam's frame, shape (2, n), m."""
        along, _ = self.beam.markers
        across = (np.arange(self.rows) - (self.rows - 1) / 2) * self.row_spacing
        y = self.beam.width / 2 + across
        grid = np.stack([np.tile(along, self.rows), np.repeat(y, len(along))])
        return grid if self.hole is None else np.column_stack([grid, self.hole])

    @property
    def count(self) -> int:
        """Markers without the hole."""
        return self.rows * self.beam.n_markers

    @property
    def middle_row(self) -> slice:
        """Where the row on the beam's axis stands among the markers."""
        first = self.rows // 2 * self.beam.n_markers
        return slice(first, first + self.beam.n_markers)

    @property
    def world(self) -> Array:
        """Centres at rest in the world, shape (3, n), m."""
        return on_surface(self.beam, self.positions)


def on_surface(beam: Beam, points: ArrayLike, deflection: ArrayLike = 0.0) -> Array:
    """World coordinates (3, ...) of points (2, ...) of the beam, deflected along Z, in m."""
    x, y = np.asarray(points, float)
    length, width = beam.extent
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
        At the tip (torsion: at the tip's edges), in m.
    phase : float
        In rad.
    """

    kind: str = "bending"
    mode: int = 1
    frequency: float = 4.25
    amplitude: float = 0.004
    phase: float = 0.0

    def shape(self, beam: Beam, points: ArrayLike) -> Array:
        """Deflection for amplitude 1 at points (2, ...) of the beam's frame, dimensionless."""
        x, y = np.asarray(points, float)
        if self.kind == "torsion":
            turn: Array = np.sin((2 * self.mode - 1) * np.pi * x / (2 * beam.length))
            return turn * (2 * y / beam.width - 1)
        return beam.mode_shapes([self.mode], [x, y])[0] * ((-1) ** (self.mode + 1) / 2)


@dataclass(frozen=True)
class Motion:
    """A beam at rest that starts to vibrate and reaches a steady state.

    Parameters
    ----------
    beam : Beam
        What moves.
    components : sequence of Component
        Bending and torsion in any mix.
    start : float
        Time of the first motion, s.
    ramp : float
        Time from there to the steady state, s; the envelope is a polynomial of degree 7, so that
        the acceleration, and with it the force, has no jump.
    """

    beam: Beam
    components: tuple[Component, ...] = (Component(),)
    start: float = 1.25
    ramp: float = 0.5

    @property
    def steady(self) -> float:
        """Time from which the vibration is harmonic, s."""
        return self.start + self.ramp

    def shapes(self, points: ArrayLike) -> Array:
        """Shapes of the components at points (2, ...), shape (components, ...)."""
        return np.stack([part.shape(self.beam, points) for part in self.components])

    def coordinates(self, times: ArrayLike) -> Array:
        """Displacement of each component at its tip, shape (components, ...), m."""
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
        beam, xi = self.beam, self.beam.damping
        for part in self.components:
            if part.kind == "torsion":
                continue
            w, first, second = self._histories(part, t)
            natural = 2 * np.pi * part.frequency / np.sqrt(1 - 2 * xi**2)
            drive = part.shape(beam, beam.force_point)[0]
            modal_mass = beam.mass / 4  # for a shape of 1 at the tip
            total += modal_mass / drive * (second + 2 * xi * natural * first + natural**2 * w)
        return total

    def _histories(self, part: Component, t: Array) -> tuple[Array, Array, Array]:
        """A component's displacement at the tip, and its first two derivatives in time."""
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
            total += part.amplitude * np.exp(1j * phase) * part.shape(motion.beam, points)
    return total
