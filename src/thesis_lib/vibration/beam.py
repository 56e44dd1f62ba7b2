"""An Euler-Bernoulli beam, and its torsion by a force beside its axis.

Saint-Venant's torsion of a strip, GJ θ'' = ρI_p θ̈ between the clamp and the free end, has the
shapes sin((2n − 1)πx / 2L) and the natural frequencies ωₙ = (2n − 1)π / (2L) √(GJ / ρI_p).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.vibration.structure import numbers_from_one


@dataclass(frozen=True)
class Beam:
    """Slender cantilever beam, clamped at x = 0 and free at x = length."""

    #: Dimensions in m
    length: float
    width: float
    thickness: float
    density: float  #: Density in kg/m³
    youngs_modulus: float  #: Young's modulus in Pa
    damping: float  #: Modal damping ratio ξ, equal for all modes
    force_position: float  #: Distance of the point force from the clamp in m
    n_markers: int  #: Number of markers on the longitudinal axis
    marker_spacing: float  #: Distance between markers in m
    #: Distance of the first marker from the clamp in m; None for a row centred on the beam
    first_marker: float | None = None

    @property
    def mass(self) -> float:
        """Mass ρAL in kg, which is also every mode's modal mass."""
        return self.density * self.width * self.thickness * self.length

    @property
    def bending_stiffness(self) -> float:
        """Return EI in N m², with I = b h³ / 12."""
        return self.youngs_modulus * self.width * self.thickness**3 / 12

    @property
    def extent(self) -> tuple[float, float]:
        """Return the length and width in m."""
        return self.length, self.width

    @property
    def force_point(self) -> Array:
        """Return the position of the force, shape (2, 1), in m."""
        return np.array([[self.force_position], [self.width / 2]])

    @property
    def markers(self) -> Array:
        """Return the marker positions, shape (2, n_markers), in m: a row on the beam's axis."""
        row = np.arange(self.n_markers) * self.marker_spacing
        x = (
            row + (self.length - row[-1]) / 2
            if self.first_marker is None
            else row + self.first_marker
        )
        return np.stack([x, np.full_like(x, self.width / 2)])

    def angular_frequencies(self, n_modes: int) -> Array:
        """Return ωₙ = kₙ² √(EI / ρA) in rad/s, shape (n_modes,) (eq. 3.6)."""
        k = cantilever_roots(n_modes) / self.length
        return k**2 * np.sqrt(self.bending_stiffness * self.length / self.mass)

    def modal_density(self, omega: ArrayLike) -> Array:
        """Return modes per rad/s, L/(2π) (ρA/EI)^¼ ω^-½, the same for any supports at high ω."""
        stiffness = self.bending_stiffness * self.length / self.mass
        return self.length / (2 * np.pi) * stiffness**-0.25 / np.sqrt(np.asarray(omega, float))

    def shape_peak(self, mode: int) -> float:
        """Return the largest absolute value of a mode shape: 2, at the tip."""
        return 2.0

    def mode_shapes(self, modes: Sequence[int], points: ArrayLike, derivative: int = 0) -> Array:
        """Return the mode shapes of eq. 3.4 with its sign put right, or their derivatives.

        φ = cosh kx − cos kx − σ (sinh kx − sin kx) is evaluated with the growing exponential
        scaled to the free end, so that nothing cancels however high the mode.

        Parameters
        ----------
        modes : sequence of int
            Mode numbers from 1.
        points : array_like, shape (2, ...)
            Positions in m; only x matters.
        derivative : int
            Order of the derivative in x, 0 to 3.

        Returns
        -------
        ndarray, shape (len(modes), ...)
            Dimensionless for derivative 0 (2 at the tip), else in m^-derivative.
        """
        x = np.asarray(points, float)[0]
        beta = cantilever_roots(max(modes))[numbers_from_one(modes) - 1]
        beta = beta.reshape((-1,) + (1,) * x.ndim)
        decay = np.exp(-beta)
        scale = 1 + decay**2 + 2 * decay * np.cos(beta)
        grow = (decay + np.cos(beta) + np.sin(beta)) / scale  # (1 − σ)/2 · e^β
        sigma = 1 - 2 * grow * decay
        s = x / self.length
        shape = (
            grow * np.exp(beta * (s - 1))
            + (-1) ** derivative * (1 + sigma) / 2 * np.exp(-beta * s)
            - np.cos(beta * s + derivative * np.pi / 2)
            + sigma * np.sin(beta * s + derivative * np.pi / 2)
        )
        return shape * (beta / self.length) ** derivative


@lru_cache
def _cantilever_roots(n_modes: int) -> tuple[float, ...]:
    beta = (2 * np.arange(1, n_modes + 1) - 1) * np.pi / 2
    for _ in range(20):  # Newton; quadratic, so 20 steps are far more than enough
        decay = np.exp(-beta)
        sech = 2 * decay / (1 + decay**2)
        tanh = (1 - decay**2) / (1 + decay**2)
        beta = beta - (np.cos(beta) + sech) / (-np.sin(beta) - sech * tanh)
    return tuple(beta)


def cantilever_roots(n_modes: int) -> Array:
    """Return the first positive roots β = kL of cos β cosh β = −1, shape (n_modes,), ascending.

    Solved as cos β + 1/cosh β = 0, which neither overflows nor loses digits for high modes.

    Raises
    ------
    ValueError
        If `n_modes` is less than 1.
    """
    if n_modes < 1:
        raise ValueError(f"n_modes: given {n_modes}, needs 1 or more")
    return np.array(_cantilever_roots(int(n_modes)))


POISSON_RATIO = 0.31  # Table 3.1


def torsional_rigidity(beam: Beam, poisson: float = POISSON_RATIO) -> float:
    """Return GJ in N m², with J of a rectangle: b h³/3 (1 − 0.63 h/b (1 − h⁴ / 12b⁴)), h ≤ b."""
    b, h = beam.width, beam.thickness
    shear = beam.youngs_modulus / (2 * (1 + poisson))
    return shear * b * h**3 / 3 * (1 - 0.63 * h / b * (1 - h**4 / (12 * b**4)))


def torsional_inertia(beam: Beam) -> float:
    """Return the polar moment of inertia per length, ρbh (b² + h²) / 12, in kg m."""
    b, h = beam.width, beam.thickness
    return beam.density * b * h * (b**2 + h**2) / 12


def torsional_frequency(beam: Beam, mode: int = 1, poisson: float = POISSON_RATIO) -> float:
    """Return the natural angular frequency in rad/s of a torsional mode."""
    wave = (2 * mode - 1) * np.pi / (2 * beam.length)
    return float(wave * np.sqrt(torsional_rigidity(beam, poisson) / torsional_inertia(beam)))


def tip_twist(
    beam: Beam,
    aside: float,
    omega: float,
    force: float = 1.0,
    modes: int = 1,
    poisson: float = POISSON_RATIO,
) -> float:
    """Return the deflection in m of the tip's edges by a harmonic force `aside` of the axis, in m.

    The force, of an amplitude in N at the angular frequency `omega` in rad/s, acts at the beam's
    force point; so many torsional `modes` are summed.
    """
    n = np.arange(1, modes + 1)
    wn = np.array([torsional_frequency(beam, int(k), poisson) for k in n])
    drive = np.sin((2 * n - 1) * np.pi * beam.force_position / (2 * beam.length))
    tip = np.sin((2 * n - 1) * np.pi / 2)
    modal_inertia = torsional_inertia(beam) * beam.length / 2
    stiffness = wn**2 - omega**2 + 2j * beam.damping * wn * omega
    angle = np.sum(force * aside * drive * tip / (modal_inertia * stiffness))
    return float(np.abs(angle) * beam.width / 2)
