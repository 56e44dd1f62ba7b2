"""Elementary sources of sound, and the medium that they radiate into.

Throughout, `distance` is in m, `omega` is the angular frequency in rad/s, and `medium` the fluid.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, ComplexArray

_BLOCK_PAIRS = 50_000  # point × source pairs at a time: what stays in cache


def _check_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name}: given {value}, needs a positive finite number")


@dataclass(frozen=True)
class Medium:
    """The fluid that the sound is in.

    Raises
    ------
    ValueError
        If either is not positive and finite.
    """

    speed_of_sound: float = 343.0  #: Speed of sound c in m/s
    density: float = 1.21  #: Density ρ₀ in kg/m³

    def __post_init__(self) -> None:
        for name in ("speed_of_sound", "density"):
            _check_positive(name, getattr(self, name))


AIR = Medium()


@dataclass(frozen=True)
class Pistons:
    """A baffled plate as equal rectangular pistons."""

    centres: Array  #: Centres of the pistons in world coordinates, m, shape (2, pistons)
    size: tuple[float, float]  #: Length and width of each piston in m

    @property
    def area(self) -> float:
        """Return the area A_e of one piston in m²."""
        return self.size[0] * self.size[1]


def wavenumber(omega: float, medium: Medium) -> float:
    """Return the wavenumber ω/c in rad/m of a circular frequency in a medium."""
    _check_positive("omega", omega)
    return omega / medium.speed_of_sound


def check_pistons(pistons: Pistons, omega: float, medium: Medium = AIR) -> None:
    """Make sure that the pistons are small against the wavelength.

    Raises
    ------
    ValueError
        If k times the longer side is above π: half a wavelength fits on a piston.

    Warns
    -----
    UserWarning
        If it is above 1.
    """
    extent = wavenumber(omega, medium) * max(pistons.size)
    hint = f"k times the size of a piston is {extent:.2f} at {omega / (2 * np.pi):.4g} Hz"
    if extent > np.pi:
        raise ValueError(f"{hint}, needs at most π: use more and smaller pistons")
    if extent > 1:
        warnings.warn(f"{hint}; above 1 a piston is hardly a point source", stacklevel=3)


def pulsating_sphere(
    distance: ArrayLike, radius: float, volume_velocity: complex, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Return the pressure in Pa of a pulsating sphere in free space (eq. 6.1).

    At distances of at least its radius a in m, for a volume velocity of 4πa²v in m³/s, surface
    times radial velocity.
    """
    k = wavenumber(omega, medium)
    _check_positive("radius", radius)
    r = np.asarray(distance, float)
    if np.any(r < radius):
        raise ValueError(f"distance: given {r.min()} m, needs at least the radius, {radius} m")
    source = 1j * omega * medium.density * volume_velocity / (1 + 1j * k * radius)
    return np.asarray(source / (4 * np.pi * r) * np.exp(-1j * k * (r - radius)))


def monopole_pressure(
    distance: ArrayLike, volume_velocity: complex, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Return pressure in Pa of a point monopole in free space (eq. 6.2), at distances r > 0 in m.

    The volume velocity Q is in m³/s, `omega` in rad/s.
    """
    k = wavenumber(omega, medium)
    r = np.asarray(distance, float)
    if np.any(r <= 0):
        raise ValueError(f"distance: given {r.min()} m, needs more than 0")
    strength = 1j * omega * medium.density * volume_velocity
    return np.asarray(strength / (4 * np.pi * r) * np.exp(-1j * k * r))


def piston_pressure(
    distance: ArrayLike, velocity: complex, area: float, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Return pressure in Pa of one small baffled piston (eq. 6.3): a monopole with Q = 2 v A_e."""
    return monopole_pressure(distance, 2 * velocity * area, omega, medium)


def transfer_pressure(
    pistons: Pistons, points: ArrayLike, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Return the pressure per velocity, jωρ₀A_e e^{−jkR} / (2πR), shape (..., pistons) (eq. 6.7).

    In Pa s/m, at points (3, ...) in m in front of the plate. The exponent has the sign of eq. 6.4,
    that of outgoing waves.

    Raises
    ------
    ValueError
        If a point is not in front of the plate, Z > 0, or the pistons are too large.
    """
    points = np.asarray(points, float)
    result = np.empty((points[0].size, pistons.centres.shape[1]), complex)
    for part, sine, cosine in spherical_waves(pistons, points, omega, medium):
        result[part].real, result[part].imag = sine, cosine
    result *= per_velocity(pistons, omega, medium)
    return result.reshape(points.shape[1:] + result.shape[1:])


def outgoing_wave(k: float, R: Array) -> tuple[Array, Array]:
    """Return the real and imaginary part of j e^{−jkR} / R: sin(kR)/R and cos(kR)/R, in 1/m.

    Both come from tan(kR/2), one fast function in place of two slow ones.
    """
    t = np.tan((0.5 * k) * R)
    square = t * t
    inverse = 1 / ((1 + square) * R)
    return 2 * t * inverse, (1 - square) * inverse


def per_velocity(pistons: Pistons, omega: float, medium: Medium) -> float:
    """Return the factor ωρA/2π in kg/s² from a piston's velocity to its wave's strength."""
    return omega * medium.density * pistons.area / (2 * np.pi)


def spherical_waves(
    pistons: Pistons, points: Array, omega: float, medium: Medium
) -> Iterator[tuple[slice, Array, Array]]:
    """Yield the outgoing waves from every piston to blocks of points, (points, pistons) each."""
    k = wavenumber(omega, medium)
    check_pistons(pistons, omega, medium)
    flat = points.reshape(3, -1)
    if not np.all(flat[2] > 0):
        raise ValueError(f"points: given Z = {flat[2].min()} m, needs Z > 0, in front of the plate")
    x, y = pistons.centres
    step = max(1, _BLOCK_PAIRS // len(x))
    for start in range(0, flat.shape[1], step):
        part = slice(start, start + step)
        X, Y, Z = flat[:, part, None]
        yield part, *outgoing_wave(k, np.sqrt((X - x) ** 2 + ((Y - y) ** 2 + Z**2)))
