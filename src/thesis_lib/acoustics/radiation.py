"""Sound from vibrating surfaces: elementary sources, Rayleigh's integral, power (thesis 6.1).

Time factor e^{+jωt}, outgoing waves e^{−jkR}. Pressures, velocities and volume velocities are
complex amplitudes. A plate in a rigid baffle is a set of small pistons in the plane Z = 0, each
with the area A_e and the velocity of its centre; it radiates into Z > 0.

Points and sources put coordinates first: points ``(3, ...)`` and sources ``(2, sources)`` in m.

Throughout, `velocity` (pistons,) are the normal velocities of the `pistons` in m/s, `distance` is
in m, `omega` is the angular frequency in rad/s, `medium` the fluid, and `directions` (3, ...) are
unit vectors, Z ≥ 0.

*Integrals instead of sums.* Pistons at the middles of cells are a midpoint rule, whose error falls
with the square of their size. Gauss and Legendre's rule (:func:`integrate_pressure`) gains a digit
with every few nodes, since the integrand is smooth: for a point at the height h it is singular
only at ±jh from the point's foot, in the complex plane, and along a half side a the error falls as
e^(-2n asinh(h/a)) with the nodes n.

*Radiation modes.* The mean square pressure on a plane is vᵀQv for real velocities v of the pistons,
with the form Q = FᵀF of a factor F (:func:`.full_factor`). Its eigenvectors radiate independently,
without interference. Errors with the covariance C radiate tr(QC) on average, to which the mode
qₖ with eigenvalue λₖ adds λₖ qₖᵀCqₖ. Only a few modes radiate much, those in which distant markers
move in phase. So errors that markers have in common radiate, and independent errors hardly do.
"""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, ComplexArray
from thesis_lib.vibration.structure import Plate

_BLOCK_PAIRS = 50_000  # point × source pairs at a time, which stay in cache


def _check_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name}: given {value}, needs a positive finite number")


@dataclass(frozen=True)
class Medium:
    """Fluid in which the sound propagates.

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


FINER_PISTONS = "use more and smaller pistons"  # advice that callers may replace


def check_pistons(pistons: Pistons, omega: float, medium: Medium = AIR) -> None:
    """Check that the pistons are small compared with the wavelength.

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
        raise ValueError(f"{hint}, needs at most π: {FINER_PISTONS}")
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
    for part, sine, cosine in _spherical_waves(pistons, points, omega, medium):
        result[part].real, result[part].imag = sine, cosine
    result *= _per_velocity(pistons, omega, medium)
    return result.reshape(points.shape[1:] + result.shape[1:])


def outgoing_wave(k: float, R: Array) -> tuple[Array, Array]:
    """Return the real and imaginary part of j e^{−jkR} / R: sin(kR)/R and cos(kR)/R, in 1/m.

    Both come from tan(kR/2), one fast function in place of two slow ones.
    """
    t = np.tan((0.5 * k) * R)
    square = t * t
    inverse = 1 / ((1 + square) * R)
    return 2 * t * inverse, (1 - square) * inverse


def _per_velocity(pistons: Pistons, omega: float, medium: Medium) -> float:
    """Return the factor ωρA/2π in kg/s² from a piston's velocity to its wave's strength."""
    return omega * medium.density * pistons.area / (2 * np.pi)


def _spherical_waves(
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


REFERENCE_PRESSURE = 20e-6  # Pa
REFERENCE_POWER = 1e-12  # W


def rayleigh_pressure(
    pistons: Pistons, velocity: ArrayLike, points: ArrayLike, omega: float, medium: Medium = AIR
) -> ComplexArray:
    """Return the pressure in Pa of a baffled plate at any points in front of it (eq. 6.4, 6.7).

    Parameters
    ----------
    pistons, velocity, omega, medium
        As throughout this module.
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
    for part, sine, cosine in _spherical_waves(pistons, points, omega, medium):
        in_phase, quadrature = sine @ parts, cosine @ parts
        pressure[part].real = in_phase[:, 0] - quadrature[:, 1]
        pressure[part].imag = in_phase[:, 1] + quadrature[:, 0]
    pressure *= _per_velocity(pistons, omega, medium)
    return pressure.reshape(points.shape[1:])


def radiation_matrix(
    pistons: Pistons, omega: float, medium: Medium = AIR, rows: slice = slice(None)
) -> Array:
    """Return the radiation resistance R = ω²ρ₀A_e²/(4πc) · sin(kr)/(kr), shape (rows, pistons).

    The power of velocities v is W = vᴴRv (Elliott and Johnson 1993); the matrix is symmetric and
    positive semi-definite, in W s²/m². `rows` selects some of its rows.
    """
    k = wavenumber(omega, medium)
    check_pistons(pistons, omega, medium)
    x, y = pistons.centres
    r = np.hypot(x[rows, None] - x, y[rows, None] - y)
    scale = omega**2 * medium.density * pistons.area**2 / (4 * np.pi * medium.speed_of_sound)
    return scale * np.sinc(k * r / np.pi)


def resistive_forces(
    pistons: Pistons, velocity: ArrayLike, omega: float, medium: Medium = AIR
) -> Array:
    """Return R v of velocities (pistons, ...) by blocks of rows of R, which stay in cache."""
    v = np.asarray(velocity)
    step = max(1, _BLOCK_PAIRS // len(v))
    blocks = [slice(first, first + step) for first in range(0, len(v), step)]
    return np.concatenate([radiation_matrix(pistons, omega, medium, rows) @ v for rows in blocks])


def sound_power(pistons: Pistons, velocity: ArrayLike, omega: float, medium: Medium = AIR) -> float:
    """Return the radiated power vᴴRv in W."""
    v = np.asarray(velocity)
    return float(np.real(np.conj(v) @ resistive_forces(pistons, v, omega, medium)))


def radiation_efficiency(
    pistons: Pistons, velocity: ArrayLike, omega: float, medium: Medium = AIR
) -> float:
    """Return W / (ρ₀ c S v² / 2), power over that of a plane wave of the same area and v²."""
    v = np.asarray(velocity)
    area = pistons.area * len(v)
    plane = medium.density * medium.speed_of_sound * area * np.mean(np.abs(v) ** 2) / 2
    return sound_power(pistons, v, omega, medium) / float(plane)


def pressure_level(pressure: ArrayLike) -> Array:
    """Return the sound pressure level in dB re 20 µPa of complex amplitudes in Pa."""
    rms = np.abs(np.asarray(pressure)) / np.sqrt(2)
    with np.errstate(divide="ignore"):
        return np.asarray(20 * np.log10(rms / REFERENCE_PRESSURE))


def power_level(power: ArrayLike) -> Array:
    """Return the sound power level in dB re 1 pW of a power in W."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(np.asarray(power, float) / REFERENCE_POWER))


_MAX_RELATIVE_ERROR = 1e-5  # at the worst point; over all nodes it is a hundredth of that
_EXTRA_NODES = 10  # for the mode shape and the sound wave


def enough_nodes(plate: Plate, height: float) -> tuple[int, int]:
    """Return the nodes along and across for an error below 1e-6 at points `height` (m) above.

    Examples
    --------
    >>> from thesis_lib.facts import setups
    >>> enough_nodes(setups.thesis_plate(), 0.0445)
    (54, 39)
    """
    rate = 2 * np.arcsinh(height / (np.array(plate.extent) / 2))
    nx, ny = np.ceil(-np.log(_MAX_RELATIVE_ERROR) / rate).astype(int) + _EXTRA_NODES
    return int(nx), int(ny)


def integrate_pressure(
    plate: Plate,
    velocity: Callable[[Array], Array],
    points: ArrayLike,
    omega: float,
    medium: Medium = AIR,
    nodes: tuple[int, int] | None = None,
) -> ComplexArray:
    """Return the pressure (...) in Pa of a plate with a continuous velocity (eq. 6.4).

    `velocity` returns normal velocities (n,) in m/s at points (2, n) in m of the plate's frame.
    `nodes` are the numbers along and across, by default those of :func:`enough_nodes`.
    """
    points = np.asarray(points, float)
    count = nodes or enough_nodes(plate, float(points[2].min()))
    extent = np.array(plate.extent)
    (x, along), (y, across) = map(np.polynomial.legendre.leggauss, count)
    places = np.stack(np.meshgrid(x, y, indexing="ij")).reshape(2, -1) * extent[:, None] / 2
    weights = np.outer(along * count[0], across * count[1]).ravel() / 4  # 1 on average
    even = Pistons(places, (plate.length / count[0], plate.width / count[1]))
    moving = velocity(places + extent[:, None] / 2)
    return rayleigh_pressure(even, moving * weights, points, omega, medium)


def radiation_modes(factor: ArrayLike) -> Array:
    """Return the rows √λₖ qₖ, the loudest first: a factor of the same form with orthogonal rows.

    For the `factor` F (rows, pistons), ‖F v‖ is the rms pressure of real velocities v. There are as
    many modes as rows or pistons, whichever is less.
    """
    _, strength, ways = np.linalg.svd(np.asarray(factor, float), full_matrices=False)
    return np.asarray(strength[:, None] * ways)


def mean_squares(modes: ArrayLike, covariance: ArrayLike) -> Array:
    """Return the mean square pressure (modes,) of errors with a covariance, by radiation mode.

    `modes` (modes, pistons) are those of :func:`radiation_modes`, or any rows: their sum is the
    mean of ‖F v‖². The covariance (pistons, pistons) is that of the velocities, or of deflections
    if the result is to be multiplied by ω².
    """
    F = np.asarray(modes, float)
    return np.asarray(np.sum((F @ np.asarray(covariance, float)) * F, axis=1))


def coherence_ratio(factor: ArrayLike, covariance: ArrayLike) -> float:
    """Return the rms pressure over that of independent errors that are as large on average.

    √(tr QC / (tr Q · mean of C's diagonal)): 1 if errors are independent and of equal size, up to
    the square root of the number of pistons if all have the one error that radiates most.
    """
    F, C = np.asarray(factor, float), np.asarray(covariance, float)
    alone = np.sum(F**2) * np.trace(C) / len(C)
    return float(np.sqrt(np.sum(mean_squares(F, C)) / alone))
