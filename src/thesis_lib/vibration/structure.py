"""Vibrating structures: natural frequencies, mode shapes, forced response (thesis 3.1, 4.1).

Every structure offers the same few attributes (:class:`Structure`); the functions below work on
any of them. Points are given in the structure's own frame, coordinates first: ``(2, ...)`` for x
along the length and y across, in metres. Shapes are real and normalised so that the mean of their
square over the structure is one, which makes the modal mass equal to the mass.

Two structures have closed forms: an Euler-Bernoulli beam and a simply supported Kirchhoff plate. A
force off the beam's axis also twists it. Saint-Venant's torsion of a strip, GJ θ'' = ρI_p θ̈
between the clamp and the free end, has the shapes sin((2n − 1)πx / 2L) and the natural frequencies
ωₙ = (2n − 1)π / (2L) √(GJ / ρI_p).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, ComplexArray, IntArray


class Structure(Protocol):
    """A structure with modes, as the rest of the library uses it."""

    @property
    def mass(self) -> float:
        """Mass in kg."""

    @property
    def damping(self) -> float:
        """Return the modal damping ratio, equal for all modes."""

    @property
    def extent(self) -> tuple[float, float]:
        """Return the length along x and width along y in m."""

    @property
    def force_point(self) -> Array:
        """Return the position of the force, shape (2, 1), in m."""

    @property
    def markers(self) -> Array:
        """Return the marker positions, shape (2, markers), in m."""

    def shape_peak(self, mode: int) -> float:
        """Return the largest absolute value of a mode shape over the structure."""

    def angular_frequencies(self, n_modes: int) -> Array:
        """Return the first natural frequencies in rad/s, shape (n_modes,)."""

    def modal_density(self, omega: ArrayLike) -> Array:
        """Return the asymptotic modes per rad/s at angular frequency `omega`."""

    def mode_shapes(self, modes: Sequence[int], points: ArrayLike) -> Array:
        """Return the mode shapes at `points` (2, ...), shape (modes, ...)."""


def mode_numbers(modes: Sequence[int]) -> IntArray:
    """Return the mode numbers as an array; raise ValueError for numbers below 1."""
    numbers = np.asarray(modes, np.int64)
    if numbers.min() < 1:
        raise ValueError(f"modes: given {list(modes)}, needs numbers from 1")
    return numbers


def cell_centres(grid: tuple[int, int], extent: tuple[float, float]) -> Array:
    """Return the centres of a grid of equal cells, shape (2, nx · ny), in m; x runs fastest."""
    x, y = ((np.arange(n) + 0.5) * side / n for n, side in zip(grid, extent, strict=True))
    return np.stack([np.tile(x, grid[1]), np.repeat(y, grid[0])])


def resonance_frequency(structure: Structure, mode: int) -> float:
    """Return ω = ωₙ √(1 − 2ξ²) in rad/s, a mode's displacement resonance."""
    omega_n = structure.angular_frequencies(mode)[mode - 1]
    return float(omega_n * np.sqrt(1 - 2 * structure.damping**2))


def modal_coordinates(
    structure: Structure, omega: ArrayLike, n_modes: int, force: float = 1.0
) -> ComplexArray:
    """Return the complex amplitudes qₙ of eq. 3.5 for a harmonic point force.

    Parameters
    ----------
    omega : array_like, shape (...)
        Angular frequencies in rad/s (0 for a static force).
    force : float
        Amplitude of the force in N.

    Returns
    -------
    ndarray, shape (n_modes, ...), complex
        Modal coordinates in m, time factor e^{+jωt}.
    """
    w = np.asarray(omega, float)
    column = (-1,) + (1,) * w.ndim
    wn = structure.angular_frequencies(n_modes).reshape(column)
    drive = structure.mode_shapes(range(1, n_modes + 1), structure.force_point)[:, 0]
    stiffness = wn**2 - w**2 + 2j * structure.damping * wn * w
    return drive.reshape(column) * force / (structure.mass * stiffness)


def full_response(
    structure: Structure, points: ArrayLike, omega: float, n_modes: int, force: float = 1.0
) -> ComplexArray:
    """Return the sum of the first `n_modes` modes (eq. 3.3), complex amplitudes in m.

    Parameters
    ----------
    structure : Structure
        The vibrating structure.
    points : array_like, shape (2, ...)
        Positions in m.
    omega : float
        Angular frequency in rad/s.
    n_modes : int
        Number of modes.
    force : float
        Amplitude of the point force in N.
    """
    shapes = structure.mode_shapes(range(1, n_modes + 1), points)
    q = modal_coordinates(structure, omega, n_modes, force)
    return np.tensordot(q, shapes, axes=1)


def single_mode_response(
    structure: Structure, mode: int, points: ArrayLike, omega: float, force: float = 1.0
) -> ComplexArray:
    """Return one mode's share of the response (eq. 3.7) at `points` (2, ...), complex, in m."""
    q = modal_coordinates(structure, omega, mode, force)[mode - 1]
    return q * structure.mode_shapes([mode], points)[0]


def peak_deflection(structure: Structure, mode: int, force: float = 1.0) -> float:
    """Return the peak |w| in m of one mode alone at its resonance, for a force in N."""
    q = modal_coordinates(structure, resonance_frequency(structure, mode), mode, force)[mode - 1]
    return float(abs(q) * structure.shape_peak(mode))


def deflection_shape(structure: Structure, mode: int, points: ArrayLike, peak: float) -> Array:
    """Return the single-mode deflection at the instant of its maximum (eq. 3.7), in m.

    The instant is that of the largest |Re q|: at resonance q is almost purely imaginary, so the
    instant printed in the thesis, t = nπ/ω, would give about 2 % of it.

    Parameters
    ----------
    structure : Structure
        The vibrating structure.
    mode : int
        Mode number from 1.
    points : array_like, shape (2, ...)
        Positions in m.
    peak : float
        Largest |w| over the structure in m; :func:`peak_deflection` computes it for a force.

    Returns
    -------
    ndarray, shape (...)
        Deflection in m.
    """
    return structure.mode_shapes([mode], points)[0] * (peak / structure.shape_peak(mode))


def modal_overlap(structure: Structure, omega: ArrayLike) -> Array:
    """Return modal overlap factor: modal density times half-power bandwidth 2ξω, dimensionless."""
    return structure.modal_density(omega) * 2 * structure.damping * np.asarray(omega, float)


def single_mode_distance(structure: Structure, mode: int, n_modes: int = 200) -> float:
    """Return the deviation of one mode alone from the full modal sum at its resonance.

    It is the largest |w_full − w_single| on a grid over the structure, divided by the largest
    |w_single|; sections 3.1 and 4.1 of the thesis assume that it is small.
    """
    length, width = structure.extent
    points = np.stack(np.meshgrid(np.linspace(0, length, 121), np.linspace(0, width, 41)))
    omega = resonance_frequency(structure, mode)
    full = full_response(structure, points, omega, n_modes)
    single = single_mode_response(structure, mode, points, omega)
    return float(np.max(np.abs(full - single)) / np.max(np.abs(single)))


def world_points(structure: Structure, deflections: Array) -> Array:
    """Return the markers' world coordinates (3, ...) for deflections (..., markers) in m."""
    centre = np.array(structure.extent) / 2
    x, y = structure.markers - centre[:, None]
    return np.stack(np.broadcast_arrays(x, y, deflections))


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
        first = self.first_marker
        x = row + ((self.length - row[-1]) / 2 if first is None else first)
        return np.stack([x, np.full_like(x, self.width / 2)])

    def angular_frequencies(self, n_modes: int) -> Array:
        """Return ωₙ = kₙ² √(EI / ρA) in rad/s, shape (n_modes,) (eq. 3.6)."""
        k = cantilever_roots(n_modes) / self.length
        return k**2 * np.sqrt(self.bending_stiffness * self.length / self.mass)

    def modal_density(self, omega: ArrayLike) -> Array:
        """Return modes per rad/s, L/(2π) (ρA/EI)^¼ ω^-½, for any supports at high ω."""
        stiffness = self.bending_stiffness * self.length / self.mass
        return self.length / (2 * np.pi) * stiffness**-0.25 / np.sqrt(np.asarray(omega, float))

    def shape_peak(self, mode: int) -> float:
        """Return the largest absolute value of a mode shape: 2, at the tip."""
        return 2.0

    def mode_shapes(self, modes: Sequence[int], points: ArrayLike, derivative: int = 0) -> Array:
        """Return the mode shapes of eq. 3.4 with its sign corrected, or their derivatives.

        φ = cosh kx − cos kx − σ (sinh kx − sin kx) is evaluated with the growing exponential
        scaled to the free end, so that no digits cancel even for high modes.

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
        beta = cantilever_roots(max(modes))[mode_numbers(modes) - 1]
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


def torsional_rigidity(beam: Beam) -> float:
    """Return GJ in N m², with J of a rectangle: b h³/3 (1 − 0.63 h/b (1 − h⁴ / 12b⁴)), h ≤ b."""
    b, h = beam.width, beam.thickness
    shear = beam.youngs_modulus / (2 * (1 + POISSON_RATIO))
    return shear * b * h**3 / 3 * (1 - 0.63 * h / b * (1 - h**4 / (12 * b**4)))


def torsional_inertia(beam: Beam) -> float:
    """Return the polar moment of inertia per length, ρbh (b² + h²) / 12, in kg m."""
    b, h = beam.width, beam.thickness
    return beam.density * b * h * (b**2 + h**2) / 12


def torsional_frequency(beam: Beam, mode: int | IntArray) -> Array:
    """Return the natural angular frequency in rad/s of torsional modes."""
    wave = (2 * mode - 1) * np.pi / (2 * beam.length)
    return np.asarray(wave * np.sqrt(torsional_rigidity(beam) / torsional_inertia(beam)))


def tip_twist(beam: Beam, aside: float, omega: float, modes: int = 1) -> float:
    """Return the deflection in m of the tip's edges by a force of 1 N, `aside` (m) off the axis.

    The harmonic force, at the angular frequency `omega` in rad/s, acts at the beam's force point;
    the first `modes` torsional modes are summed.
    """
    n = np.arange(1, modes + 1)
    wn = torsional_frequency(beam, n)
    drive = np.sin((2 * n - 1) * np.pi * beam.force_position / (2 * beam.length))
    tip = np.sin((2 * n - 1) * np.pi / 2)
    modal_inertia = torsional_inertia(beam) * beam.length / 2
    stiffness = wn**2 - omega**2 + 2j * beam.damping * wn * omega
    angle = np.sum(aside * drive * tip / (modal_inertia * stiffness))
    return float(np.abs(angle) * beam.width / 2)


class Sheet:
    """Material of a thin plate of any outline, and the position of its force."""

    thickness: float
    density: float
    youngs_modulus: float
    poisson: float
    force_position: tuple[float, float]

    @property
    def bending_stiffness(self) -> float:
        """Return D = E h³ / (12 (1 − ν²)) in N m."""
        return self.youngs_modulus * self.thickness**3 / (12 * (1 - self.poisson**2))

    @property
    def mass_per_area(self) -> float:
        """Mass ρh per area in kg/m²."""
        return self.density * self.thickness

    @property
    def force_point(self) -> Array:
        """Return the position of the force, shape (2, 1), in m."""
        return np.array(self.force_position, float)[:, None]

    @property
    def area(self) -> float:
        """Return the area in m²."""
        raise NotImplementedError

    def modal_density(self, omega: ArrayLike) -> Array:
        """Return the modes per rad/s, S/(4π) √(m/D); for a panel the limit at high frequency."""
        density = self.area / (4 * np.pi) * np.sqrt(self.mass_per_area / self.bending_stiffness)
        return np.full_like(np.asarray(omega, float), density)


@dataclass(frozen=True)
class Plate(Sheet):
    """Thin rectangular plate, simply supported on its four edges (thesis 4.1)."""

    #: Dimensions along x, y and z in m
    length: float
    width: float
    thickness: float
    density: float  #: Density in kg/m³
    youngs_modulus: float  #: Young's modulus in Pa
    poisson: float  #: Poisson's ratio
    damping: float  #: Modal damping ratio ξ, equal for all modes
    force_position: tuple[float, float]  #: Where the point force acts, x and y in m
    grid: tuple[int, int]  #: Markers along x and y: the centres of equal cells

    @property
    def area(self) -> float:
        """Return the area in m²."""
        return self.length * self.width

    @property
    def mass(self) -> float:
        """Mass ρ Lx Ly h in kg, which is also every mode's modal mass."""
        return self.density * self.length * self.width * self.thickness

    @property
    def extent(self) -> tuple[float, float]:
        """Return the length and width in m."""
        return self.length, self.width

    @property
    def markers(self) -> Array:
        """Return the cell centres, shape (2, nx · ny), in m; x runs fastest."""
        return cell_centres(self.grid, self.extent)

    def mode_indices(self, n_modes: int) -> IntArray:
        """Return index pairs (m₁, m₂) of the first modes in order of frequency, shape (n_modes, 2).

        Table 4.2 of the thesis departs from this order from its fourth mode on.
        """
        if n_modes < 1:
            raise ValueError(f"n_modes: given {n_modes}, needs 1 or more")
        return np.array(_plate_indices(self.length / self.width, int(n_modes)))

    def angular_frequencies(self, n_modes: int) -> Array:
        """Return the first natural frequencies in rad/s, shape (n_modes,) (eq. 4.6)."""
        waves = np.pi * self.mode_indices(n_modes) / self.extent
        return np.sqrt(self.bending_stiffness / self.mass_per_area) * np.sum(waves**2, axis=1)

    def shape_peak(self, mode: int) -> float:
        """Return the largest absolute value of a mode shape: 2, at the antinodes."""
        return 2.0

    def mode_shapes(self, modes: Sequence[int], points: ArrayLike) -> Array:
        """Return mode shapes 2 sin(m₁πx/Lx) sin(m₂πy/Ly) at `points` (2, ...) (eq. 4.4)."""
        x, y = np.asarray(points, float)
        m = self.mode_indices(max(modes))[mode_numbers(modes) - 1].T
        m1, m2 = m.reshape((2, -1) + (1,) * x.ndim)
        return 2 * np.sin(m1 * np.pi * x / self.length) * np.sin(m2 * np.pi * y / self.width)


@lru_cache
def _plate_indices(aspect: float, n_modes: int) -> tuple[tuple[int, int], ...]:
    # A mode among the first n has m₁ m₂ ≤ n: no pair with smaller or equal indices has a higher ω.
    pairs = [(m1, m2) for m1 in range(1, n_modes + 1) for m2 in range(1, n_modes // m1 + 1)]
    return tuple(sorted(pairs, key=lambda m: ((m[0] / aspect) ** 2 + m[1] ** 2, m))[:n_modes])
