"""Sound from vibrating surfaces: elementary sources, Rayleigh's integral, power (thesis 6.1).

Time factor e^{+jωt}, outgoing waves e^{−jkR}. Pressures, velocities and volume velocities are
complex amplitudes. A plate in a rigid baffle is a set of small pistons in the plane Z = 0, each
with the area A_e and the velocity of its centre; it radiates into Z > 0.

Points and sources put coordinates first: points ``(3, ...)`` and sources ``(2, sources)`` in m.

Throughout, `velocity` (pistons,) are the normal velocities of the `pistons` in m/s, `omega` is the
angular frequency in rad/s, `medium` the fluid, and `directions` (3, ...) are unit vectors, Z ≥ 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.acoustics.sources import (
    AIR,
    Medium,
    Pistons,
    check_pistons,
    per_velocity,
    spherical_waves,
    wavenumber,
)
from thesis_lib.arrays import Array, ComplexArray

REFERENCE_PRESSURE = 20e-6  # Pa
REFERENCE_POWER = 1e-12  # W


def rayleigh_pressure(
    pistons: Pistons, velocity: ArrayLike, points: ArrayLike, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Return the pressure in Pa of a baffled plate at any points in front of it (eq. 6.4, 6.7).

    Parameters
    ----------
    pistons, velocity, omega, medium
        As everywhere here.
    points : array_like, shape (3, ...)
        Observation points, Z > 0, in m.

    Returns
    -------
    ndarray, shape (...), complex
        Pressure; memory stays bounded by a block of points.
    """
    points = np.asarray(points, float)
    v = np.asarray(velocity)
    parts = np.stack([v.real, v.imag], axis=-1)
    pressure = np.empty(points[0].size, complex)
    for part, sine, cosine in spherical_waves(pistons, points, omega, medium):
        in_phase, quadrature = sine @ parts, cosine @ parts
        pressure[part].real = in_phase[:, 0] - quadrature[:, 1]
        pressure[part].imag = in_phase[:, 1] + quadrature[:, 0]
    pressure *= per_velocity(pistons, omega, medium)
    return pressure.reshape(points.shape[1:])


def radiation_matrix(pistons: Pistons, omega: float, medium: Medium = AIR) -> Array:
    """Return the radiation resistance R = ω²ρ₀A_e²/(4πc) · sin(kr)/(kr), shape (pistons, pistons).

    The power of velocities v is W = vᴴRv (Elliott and Johnson 1993); the matrix is symmetric and
    positive semi-definite, in W s²/m².
    """
    k = wavenumber(omega, medium)
    check_pistons(pistons, omega, medium)
    x, y = pistons.centres
    r = np.hypot(x[:, None] - x, y[:, None] - y)
    scale = omega**2 * medium.density * pistons.area**2 / (4 * np.pi * medium.speed_of_sound)
    return scale * np.sinc(k * r / np.pi)


def sound_power(pistons: Pistons, velocity: ArrayLike, omega: float, medium: Medium = AIR) -> float:
    """Return the radiated power vᴴRv in W."""
    v = np.asarray(velocity)
    return float(np.real(np.conj(v) @ radiation_matrix(pistons, omega, medium) @ v))


def radiation_efficiency(
    pistons: Pistons, velocity: ArrayLike, omega: float, medium: Medium = AIR
) -> float:
    """Return W / (ρ₀ c S v² / 2), power over that of a plane wave of the same area and v²."""
    v = np.asarray(velocity)
    area = pistons.area * len(v)
    plane = medium.density * medium.speed_of_sound * area * np.mean(np.abs(v) ** 2) / 2
    return sound_power(pistons, v, omega, medium) / float(plane)


def far_field(
    pistons: Pistons, velocity: ArrayLike, directions: ArrayLike, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Return the far-field pressure times distance, p r e^{jkr}, in Pa m, shape (...)."""
    k = wavenumber(omega, medium)
    check_pistons(pistons, omega, medium)
    u = np.asarray(directions, float)
    phase = k * np.tensordot(pistons.centres, u[:2], axes=(0, 0))
    waves = np.tensordot(np.asarray(velocity), np.exp(1j * phase), axes=(0, 0))
    return np.asarray(1j * per_velocity(pistons, omega, medium) * waves)


def pressure_level(pressure: ArrayLike) -> Array:
    """Return the sound pressure level in dB re 20 µPa of complex amplitudes in Pa."""
    rms = np.abs(np.asarray(pressure)) / np.sqrt(2)
    with np.errstate(divide="ignore"):
        return np.asarray(20 * np.log10(rms / REFERENCE_PRESSURE))


def power_level(power: ArrayLike) -> Array:
    """Return the sound power level in dB re 1 pW of a power in W."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(np.asarray(power, float) / REFERENCE_POWER))
