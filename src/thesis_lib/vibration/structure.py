"""Vibrating structures: natural frequencies, mode shapes, forced response (thesis 3.1, 4.1).

Every structure offers the same few attributes (:class:`Structure`); the functions below work on
any of them. Points are given in the structure's own frame, coordinates first: ``(2, ...)`` for x
along the length and y across, in metres. Shapes are real and normalised so that the mean of their
square over the structure is one, which makes the modal mass equal to the mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, ComplexArray, IntArray


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
        """Return the force's point, shape (2, 1), in m."""

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


def numbers_from_one(modes: Sequence[int]) -> IntArray:
    """Return the mode numbers as an array, refused unless they begin with 1."""
    numbers = np.asarray(modes, np.int64)
    if numbers.min() < 1:
        raise ValueError(f"modes: given {list(modes)}, needs numbers from 1")
    return numbers


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
    structure : Structure
        The vibrating structure.
    omega : array_like, shape (...)
        Angular frequencies in rad/s (0 for a static force).
    n_modes : int
        Number of modes.
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


def deflection_shape(
    structure: Structure,
    mode: int,
    points: ArrayLike,
    peak: float | None = None,
    force: float | None = None,
) -> Array:
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
    peak : float, optional
        Largest |w| over the structure in m.
    force : float, optional
        Amplitude in N of the point force at the mode's resonance; instead of `peak`.

    Returns
    -------
    ndarray, shape (...)
        Deflection in m.

    Raises
    ------
    ValueError
        If not exactly one of `peak` and `force` is given.
    """
    if (peak is None) == (force is None):
        raise ValueError(f"peak, force: given {peak} and {force}, needs exactly one of them")
    if peak is None:
        assert force is not None
        peak = peak_deflection(structure, mode, force)
    return structure.mode_shapes([mode], points)[0] * (peak / structure.shape_peak(mode))


def modal_overlap(structure: Structure, omega: ArrayLike) -> Array:
    """Return modal overlap factor: modal density times half-power bandwidth 2ξω, dimensionless."""
    return structure.modal_density(omega) * 2 * structure.damping * np.asarray(omega, float)


def single_mode_distance(structure: Structure, mode: int, n_modes: int = 200) -> float:
    """Return the deviation of one mode alone from the full modal sum at its resonance.

    Largest |w_full − w_single| over a grid on the structure, over the largest |w_single|; sections
    3.1 and 4.1 of the thesis take it to be small.
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
