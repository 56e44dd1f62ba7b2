"""Motion of a structure during a recording: harmonic components, their sum, and their aliases.

Frames at a rate r cannot distinguish a frequency f from |f − kr|, k = 1, 2 …, and fold it if it is
above half of the rate.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, ComplexArray
from thesis_lib.vibration.structure import Beam, Structure


@dataclass(frozen=True)
class Component:
    """One harmonic part of a motion."""

    #: ``bending`` (the modes of eq. 3.4) or ``torsion`` (sin((2n − 1)πx / 2L) times y)
    kind: str = "bending"
    mode: int = 1  #: Number from 1
    frequency: float = 4.25  #: In Hz
    #: At the tip (torsion: at the tip's edges; a plate: at an antinode), in m
    amplitude: float = 0.004
    phase: float = 0.0  #: In rad

    def shape(self, structure: Structure, points: ArrayLike) -> Array:
        """Return the deflection for amplitude 1 at points (2, ...), dimensionless."""
        x, y = np.asarray(points, float)
        if self.kind == "torsion":
            length, width = structure.extent
            turn: Array = np.sin((2 * self.mode - 1) * np.pi * x / (2 * length))
            return turn * (2 * y / width - 1)
        peak = structure.shape_peak(self.mode)
        shape: Array = structure.mode_shapes([self.mode], [x, y])[0] / peak
        # The beam's modes are upward at the tip, regardless of their sign in eq. 3.4.
        return shape * (-1) ** (self.mode + 1) if isinstance(structure, Beam) else shape


@dataclass(frozen=True)
class Motion:
    """A structure at rest that starts to vibrate and reaches a steady state."""

    structure: Structure  #: Beam or plate
    components: tuple[Component, ...] = (Component(),)  #: Bending and torsion in any mix
    start: float = 1.25  #: Time of the first motion, s
    #: Time from there to the steady state, s; the envelope is a polynomial of degree 7, so that the
    #: acceleration, and with it the force, has no jump
    ramp: float = 0.5

    @property
    def steady(self) -> float:
        """Return the time from which the vibration is harmonic, s."""
        return self.start + self.ramp

    def shapes(self, points: ArrayLike) -> Array:
        """Return the shapes of the components at points (2, ...), shape (components, ...)."""
        return np.stack([part.shape(self.structure, points) for part in self.components])

    def coordinates(self, times: ArrayLike) -> Array:
        """Return each component's displacement where its shape is 1, (components, ...), m."""
        t = np.asarray(times, float)
        return np.stack([self._histories(part, t)[0] for part in self.components])

    def deflection(self, points: ArrayLike, times: ArrayLike) -> Array:
        """Return the deflection in m at points (2, ...) and times (n,), shape (n, ...)."""
        return np.tensordot(self.coordinates(times), self.shapes(points), axes=(0, 0))

    def force(self, times: ArrayLike) -> Array:
        """Return the shaker force in N that produces the bending components.

        One-mode inverse dynamics, F φ(x_F) = m (q̈ + 2ξωₙ q̇ + ωₙ² q), with the natural frequency
        that puts the displacement resonance at the component's frequency; torsion needs none, as
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
        """Return a component's displacement where its shape is 1, and two time derivatives."""
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


def steady_amplitudes(motion: Motion, points: ArrayLike, frequency: float) -> ComplexArray:
    """Return complex steady-state amplitudes in m at a frequency, time factor e^{+jωt}."""
    total = np.zeros(np.shape(np.asarray(points, float)[0]), complex)
    for part in motion.components:
        if np.isclose(part.frequency, frequency):
            omega = 2 * np.pi * part.frequency
            phase = part.phase - np.pi / 2 - omega * motion.start
            total += part.amplitude * np.exp(1j * phase) * part.shape(motion.structure, points)
    return total


TRIALS_PER_LINE = 8  # trial frequencies per 1/T, T being the length of the recording


def fold_frequency(frequency: ArrayLike, rate: ArrayLike) -> Array:
    """Return the alias in Hz of a frequency, between 0 and half of the frame rate.

    Examples
    --------
    >>> [float(fold_frequency(hertz, 60.0)) for hertz in (110.0, 40.0, 25.0)]
    [10.0, 20.0, 25.0]
    """
    f, rate = np.asarray(frequency, float), np.asarray(rate, float)
    return np.asarray(np.abs(f - rate * np.rint(f / rate)), float)


def list_aliases(alias_hz: float, rate: float, highest_hz: float) -> Array:
    """List the frequencies in Hz, up to a highest, that appear at `alias_hz` at a frame rate."""
    k = np.arange(int(np.ceil(highest_hz / rate)) + 1)
    every = np.unique(np.abs(np.concatenate([alias_hz + k * rate, alias_hz - k * rate])))
    return every[every <= highest_hz]


def alias_clearance(frequency: float, rate: float, frames: int) -> float:
    """Return the distance of an alias from 0 and half of the rate, in periods per recording.

    Below a half, the vibration's in-phase and quadrature parts can hardly be separated from each
    other or from the rest position.
    """
    shown = float(fold_frequency(frequency, rate))
    return min(shown, rate / 2 - shown) * frames / rate


def scan_frequencies(rate: float, frames: int) -> Array:
    """Return frequencies to scan in Hz, half a period away from 0 and from half of the rate."""
    least = 0.5 * rate / frames
    return np.linspace(least, rate / 2 - least, TRIALS_PER_LINE * frames // 2)


def detuning_loss(cycles: ArrayLike, frames: int) -> Array:
    """Return the share of an amplitude lost by a frequency error in cycles per recording.

    It is one minus the modulus of the mean of e^{2πjcn/N} over N frames, near 1 − sinc(c).
    """
    c = np.asarray(cycles, float)
    n = np.arange(frames) - (frames - 1) / 2
    return np.asarray(1 - np.abs(np.mean(np.exp(2j * np.pi * c[..., None] * n / frames), -1)))
