"""Sound from vibrating surfaces: elementary sources, Rayleigh's integral, power (thesis 6.1).

Time factor e^{+jωt}, outgoing waves e^{−jkR}. Pressures, velocities and volume velocities are
complex amplitudes. A plate in a rigid baffle is a set of small pistons in the plane Z = 0, each
with the area A_e and the velocity of its centre; it radiates into Z > 0.

Points and sources put coordinates first: points ``(3, ...)`` and sources ``(2, sources)`` in m.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

REFERENCE_PRESSURE = 20e-6  # Pa
REFERENCE_POWER = 1e-12  # W
_BLOCK_PAIRS = 50_000  # point × source pairs at a time: what stays in cache


def _check_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name}: given {value}, needs a positive finite number")


@dataclass(frozen=True)
class Medium:
    """The fluid that the sound is in.

    Parameters
    ----------
    speed_of_sound : float
        Speed of sound c in m/s.
    density : float
        Density ρ₀ in kg/m³.

    Raises
    ------
    ValueError
        If either is not positive and finite.
    """

    speed_of_sound: float = 343.0
    density: float = 1.21

    def __post_init__(self) -> None:
        for name in ("speed_of_sound", "density"):
            _check_positive(name, getattr(self, name))


AIR = Medium()


@dataclass(frozen=True)
class Pistons:
    """A baffled plate as equal rectangular pistons.

    Parameters
    ----------
    centres : ndarray, shape (2, pistons)
        Centres of the pistons in world coordinates, m.
    size : tuple of float
        Length and width of each piston in m.
    """

    centres: Array
    size: tuple[float, float]

    @property
    def area(self) -> float:
        """Area A_e of one piston in m²."""
        return self.size[0] * self.size[1]


def _wavenumber(omega: float, medium: Medium) -> float:
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
    extent = _wavenumber(omega, medium) * max(pistons.size)
    hint = f"k times the size of a piston is {extent:.2f} at {omega / (2 * np.pi):.4g} Hz"
    if extent > np.pi:
        raise ValueError(f"{hint}, needs at most π: use more and smaller pistons")
    if extent > 1:
        warnings.warn(f"{hint}; above 1 a piston is hardly a point source", stacklevel=3)


def pulsating_sphere(
    distance: ArrayLike, radius: float, volume_velocity: complex, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Pressure in Pa of a pulsating sphere in free space at `distance` from its centre (eq. 6.1).

    Parameters
    ----------
    distance : array_like
        Distance r in m, at least the radius.
    radius : float
        Radius a of the sphere in m.
    volume_velocity : complex
        Surface times radial velocity, 4πa²v, in m³/s.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.
    """
    k = _wavenumber(omega, medium)
    _check_positive("radius", radius)
    r = np.asarray(distance, float)
    if np.any(r < radius):
        raise ValueError(f"distance: given {r.min()} m, needs at least the radius, {radius} m")
    source = 1j * omega * medium.density * volume_velocity / (1 + 1j * k * radius)
    return np.asarray(source / (4 * np.pi * r) * np.exp(-1j * k * (r - radius)))


def monopole(
    distance: ArrayLike, volume_velocity: complex, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Pressure in Pa of a point monopole in free space (eq. 6.2).

    Parameters
    ----------
    distance : array_like
        Distance r from the source in m, above 0.
    volume_velocity : complex
        Volume velocity Q in m³/s.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.
    """
    k = _wavenumber(omega, medium)
    r = np.asarray(distance, float)
    if np.any(r <= 0):
        raise ValueError(f"distance: given {r.min()} m, needs more than 0")
    strength = 1j * omega * medium.density * volume_velocity
    return np.asarray(strength / (4 * np.pi * r) * np.exp(-1j * k * r))


def piston(
    distance: ArrayLike, velocity: complex, area: float, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Pressure in Pa of one small baffled piston (eq. 6.3): a monopole with Q = 2 v A_e."""
    return monopole(distance, 2 * velocity * area, omega, medium)


def transfer(
    pistons: Pistons, points: ArrayLike, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Pressure per velocity, jωρ₀A_e e^{−jkR} / (2πR), shape (..., pistons) (eq. 6.7).

    The exponent has the sign of eq. 6.4, that of outgoing waves.

    Parameters
    ----------
    pistons : Pistons
        The sources.
    points : array_like, shape (3, ...)
        Observation points in front of the plate, Z > 0, in m.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.

    Returns
    -------
    ndarray, shape (..., pistons), complex
        In Pa s/m.

    Raises
    ------
    ValueError
        If a point is not in front of the plate, or the pistons are too large.
    """
    points = np.asarray(points, float)
    result = np.empty((points[0].size, pistons.centres.shape[1]), complex)
    for part, sine, cosine in _waves(pistons, points, omega, medium):
        result[part].real, result[part].imag = sine, cosine
    result *= _per_velocity(pistons, omega, medium)
    return result.reshape(points.shape[1:] + result.shape[1:])


def outgoing_wave(k: float, R: Array) -> tuple[Array, Array]:
    """Real and imaginary part of j e^{−jkR} / R: sin(kR)/R and cos(kR)/R, in 1/m.

    Both come from tan(kR/2), one fast function in place of two slow ones.
    """
    t = np.tan((0.5 * k) * R)
    square = t * t
    inverse = 1 / ((1 + square) * R)
    return 2 * t * inverse, (1 - square) * inverse


def _per_velocity(pistons: Pistons, omega: float, medium: Medium) -> float:
    return omega * medium.density * pistons.area / (2 * np.pi)


def _waves(
    pistons: Pistons, points: Array, omega: float, medium: Medium
) -> Iterator[tuple[slice, Array, Array]]:
    """Outgoing waves from every piston to blocks of points, (points, pistons) each."""
    k = _wavenumber(omega, medium)
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


def rayleigh(
    pistons: Pistons, velocity: ArrayLike, points: ArrayLike, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Pressure in Pa of a baffled plate at any points in front of it (eq. 6.4, 6.7).

    Parameters
    ----------
    pistons : Pistons
        The sources.
    velocity : array_like, shape (pistons,)
        Normal velocities in m/s.
    points : array_like, shape (3, ...)
        Observation points, Z > 0, in m.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.

    Returns
    -------
    ndarray, shape (...), complex
        Pressure; memory stays bounded by a block of points.
    """
    points = np.asarray(points, float)
    v = np.asarray(velocity)
    parts = np.stack([v.real, v.imag], axis=-1)
    pressure = np.empty(points[0].size, complex)
    for part, sine, cosine in _waves(pistons, points, omega, medium):
        in_phase, quadrature = sine @ parts, cosine @ parts
        pressure[part].real = in_phase[:, 0] - quadrature[:, 1]
        pressure[part].imag = in_phase[:, 1] + quadrature[:, 0]
    pressure *= _per_velocity(pistons, omega, medium)
    return pressure.reshape(points.shape[1:])


def radiation_matrix(pistons: Pistons, omega: float, medium: Medium = AIR) -> Array:
    """Radiation resistance R = ω²ρ₀A_e²/(4πc) · sin(kr)/(kr), shape (pistons, pistons).

    The power of velocities v is W = vᴴRv (Elliott and Johnson 1993); the matrix is symmetric and
    positive semi-definite, in W s²/m².
    """
    k = _wavenumber(omega, medium)
    check_pistons(pistons, omega, medium)
    x, y = pistons.centres
    r = np.hypot(x[:, None] - x, y[:, None] - y)
    scale = omega**2 * medium.density * pistons.area**2 / (4 * np.pi * medium.speed_of_sound)
    return scale * np.sinc(k * r / np.pi)


def sound_power(pistons: Pistons, velocity: ArrayLike, omega: float, medium: Medium = AIR) -> float:
    """Radiated power vᴴRv in W.

    Parameters
    ----------
    pistons : Pistons
        The sources.
    velocity : array_like, shape (pistons,)
        Normal velocities in m/s, complex amplitudes.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.
    """
    v = np.asarray(velocity)
    return float(np.real(np.conj(v) @ radiation_matrix(pistons, omega, medium) @ v))


def radiation_efficiency(
    pistons: Pistons, velocity: ArrayLike, omega: float, medium: Medium = AIR
) -> float:
    """Power over that of a plane wave of the same area and mean square v², W / (ρ₀ c S v² / 2).

    Parameters
    ----------
    pistons : Pistons
        The sources.
    velocity : array_like, shape (pistons,)
        Normal velocities in m/s, complex amplitudes.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.
    """
    v = np.asarray(velocity)
    area = pistons.area * len(v)
    plane = medium.density * medium.speed_of_sound * area * np.mean(np.abs(v) ** 2) / 2
    return sound_power(pistons, v, omega, medium) / float(plane)


def far_field(
    pistons: Pistons, velocity: ArrayLike, directions: ArrayLike, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Far-field pressure times distance, p r e^{jkr}, in Pa m.

    Parameters
    ----------
    pistons : Pistons
        The sources.
    velocity : array_like, shape (pistons,)
        Normal velocities in m/s.
    directions : array_like, shape (3, ...)
        Unit vectors with Z ≥ 0.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.
    """
    k = _wavenumber(omega, medium)
    check_pistons(pistons, omega, medium)
    u = np.asarray(directions, float)
    phase = k * np.tensordot(pistons.centres, u[:2], axes=(0, 0))
    waves = np.tensordot(np.asarray(velocity), np.exp(1j * phase), axes=(0, 0))
    return np.asarray(1j * _per_velocity(pistons, omega, medium) * waves)


def directivity(
    pistons: Pistons, velocity: ArrayLike, directions: ArrayLike, omega: float, medium: Medium = AIR
) -> Array:
    """Far-field intensity over that of the same power spread evenly over the half space.

    Parameters
    ----------
    pistons : Pistons
        The sources.
    velocity : array_like, shape (pistons,)
        Normal velocities in m/s, complex amplitudes.
    directions : array_like, shape (3, ...)
        Unit vectors with Z ≥ 0.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.
    """
    p = far_field(pistons, velocity, directions, omega, medium)
    intensity = np.abs(p) ** 2 / (2 * medium.density * medium.speed_of_sound)
    return 2 * np.pi * intensity / sound_power(pistons, velocity, omega, medium)


def pressure_level(pressure: ArrayLike) -> Array:
    """Sound pressure level in dB re 20 µPa of complex amplitudes in Pa."""
    rms = np.abs(np.asarray(pressure)) / np.sqrt(2)
    with np.errstate(divide="ignore"):
        return np.asarray(20 * np.log10(rms / REFERENCE_PRESSURE))


def power_level(power: ArrayLike) -> Array:
    """Sound power level in dB re 1 pW of a power in W."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(np.asarray(power, float) / REFERENCE_POWER))
