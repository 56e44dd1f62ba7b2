"""The sound of a plate on the thesis's two planes, XZ and YZ, and its power (thesis 6.1, 6.2).

Plate and plane have two symmetries: pistons at ±a across the plane are equally far from each of
its points, and the kernel of a point at −u is that of +u with the pistons mirrored. So a quarter
of the distances is enough: the velocities are folded across the plane, and the halves u > 0 and
u < 0 use the folded velocities and their mirror image.

:class:`PlateSound` computes the errors of both due to errors e of the deflection w. The pressure is
linear in w, so the rms error on a plane is ω ‖F e‖ with a small triangular factor F; the power is
ω² wᵀRw with the radiation resistance R.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from thesis_lib.acoustics import radiation
from thesis_lib.arrays import Array, ArrayLike, ComplexArray, NDArray
from thesis_lib.vibration.structure import Plate


@dataclass(frozen=True)
class Plane:
    """A plane through the plate's centre and its normal.

    Raises
    ------
    ValueError
        If the plane does not lie in front of the plate or has no points.
    """

    name: Literal["XZ", "YZ"]  #: ``XZ`` (along the length) or ``YZ`` (across)
    half_width: float  #: The points lie at |u| ≤ half_width in m, u being X or Y
    #: Lowest and highest Z in m; the lowest is above the plate
    bottom: float
    top: float
    shape: tuple[int, int]  #: Points along u and along Z

    def __post_init__(self) -> None:
        if not 0 < self.bottom <= self.top or not self.half_width > 0 or min(self.shape) < 1:
            raise ValueError(
                f"plane: given half width {self.half_width} m, Z {self.bottom} to {self.top} m, "
                f"{self.shape} points; needs half width > 0, 0 < bottom ≤ top, 1 or more points"
            )

    @property
    def u(self) -> Array:
        """Return X or Y of the columns in m, shape (columns,), symmetric about 0."""
        columns = self.shape[0]
        return self.half_width * np.linspace(-1, 1, columns) if columns > 1 else np.zeros(1)

    @property
    def z(self) -> Array:
        """Return Z of the rows in m, shape (rows,)."""
        return np.linspace(self.bottom, self.top, self.shape[1])

    @property
    def points(self) -> Array:
        """World coordinates, shape (3, columns, rows), in m."""
        u, z = np.meshgrid(self.u, self.z, indexing="ij")
        return np.stack([u, 0 * u, z] if self.name == "XZ" else [0 * u, u, z])


def plate_pistons(plate: Plate) -> radiation.Pistons:
    """Return the plate's cells as pistons, in the order of its markers."""
    centre = np.array(plate.extent)[:, None] / 2
    size = (plate.length / plate.grid[0], plate.width / plate.grid[1])
    return radiation.Pistons(plate.markers - centre, size)


@dataclass(frozen=True)
class PlaneOperator:
    """Linear operator from piston velocities to the pressure on a plane, at one frequency."""

    plane: Plane  #: Plane of the pressure
    grid: tuple[int, int]  #: Pistons along x and y
    #: Pressure per folded velocity at the points with u ≥ 0, in Pa s/m, complex, shape (right
    #: columns · rows, folded pistons)
    kernel: ComplexArray

    def fold(self, velocity: ArrayLike) -> tuple[NDArray[np.inexact], NDArray[np.inexact]]:
        """Fold velocities (..., pistons) across the plane; return them and their mirror image."""
        v = np.asarray(velocity)
        nx, ny = self.grid
        across_along = v.reshape((*v.shape[:-1], ny, nx))
        if self.plane.name == "YZ":
            across_along = np.swapaxes(across_along, -1, -2)
        n = int(np.shape(across_along)[-2])
        half = n // 2
        folded = across_along[..., n - half :, :] + across_along[..., :half, :][..., ::-1, :]
        if n % 2:  # the middle row lies in the plane and has no mirror image
            folded = np.concatenate([across_along[..., half : half + 1, :], folded], axis=-2)
        flat = (*v.shape[:-1], -1)
        return folded.reshape(flat), folded[..., ::-1].reshape(flat)

    def field(self, velocity: ArrayLike) -> ComplexArray:
        """Return the pressure (columns, rows) in Pa of velocities (pistons,) in m/s."""
        folded, mirrored = self.fold(velocity)
        columns, rows = self.plane.shape
        both = (self.kernel @ np.stack([folded, mirrored], axis=-1)).reshape(-1, rows, 2)
        right, left = both[..., 0], both[..., 1]
        return np.concatenate([left[columns % 2 :][::-1], right])


def plane_operator(
    plate: Plate, plane: Plane, omega: float, medium: radiation.Medium = radiation.AIR
) -> PlaneOperator:
    """Build the operator from a plate to a plane at a frequency.

    Parameters
    ----------
    plate : Plate
        The radiating plate; its cells are the pistons.
    plane : Plane
        Plane of the pressure.
    omega : float
        Angular frequency in rad/s.
    medium : Medium
        The fluid.

    Raises
    ------
    ValueError
        If the pistons are too large for the wavelength.
    """
    parts = plate_pistons(plate)
    radiation.check_pistons(parts, omega, medium)
    offsets = [
        size * (np.arange(n) - (n - 1) / 2) for size, n in zip(parts.size, plate.grid, strict=True)
    ]
    along, across = offsets if plane.name == "XZ" else offsets[::-1]
    across = across[len(across) // 2 :]
    right = plane.u[plane.shape[0] // 2 :]
    height = plane.z**2
    aside = across[:, None] ** 2 + (right[:, None, None, None] - along) ** 2
    R = np.sqrt(aside + height[:, None, None]).reshape(len(right) * len(height), -1)
    sine, cosine = radiation.outgoing_wave(omega / medium.speed_of_sound, R)
    kernel = np.empty(R.shape, complex)
    scale = omega * medium.density * parts.area / (2 * np.pi)
    np.multiply(sine, scale, out=kernel.real)
    np.multiply(cosine, scale, out=kernel.imag)
    return PlaneOperator(plane, plate.grid, kernel)


def full_factor(op: PlaneOperator) -> Array:
    """Return factor F of a plane: ‖F v‖ is the rms of |p| over it in Pa for real velocities v.

    ‖F v‖² = vᵀ Re(GᴴG) v / N, without the loss of digits of that quadratic form. Rows of G for
    u > 0 and u < 0 share the kernel: the mirrored half is the kernel with its columns mirrored.
    """
    columns, rows = op.plane.shape
    nx, ny = op.grid
    along = nx if op.plane.name == "XZ" else ny
    right = op.kernel
    left = right.reshape(len(right), -1, along)[:, :, ::-1].reshape(right.shape)
    left = left[rows:] if columns % 2 else left
    factor = np.linalg.qr(np.concatenate([right.real, right.imag]), mode="r")
    factor = np.linalg.qr(np.concatenate([factor, left.real, left.imag]), mode="r")
    folded, _ = op.fold(np.eye(nx * ny))
    return factor / np.sqrt(columns * rows) @ np.real(folded).T


# A plane is nodal if its reference pressure is below this share of the other's, or of that of
# pistons that move as far but incoherently: mode (2, 2) is silent on both planes.
MAX_NODAL_PRESSURE_RATIO = 1e-6


@dataclass(frozen=True)
class PlateSound:
    """Sound of a reference deflection shape, and errors of other shapes compared with it."""

    omega: float  #: Angular frequency in rad/s
    reference: Array  #: True deflection in m, shape (markers,)
    operators: tuple[PlaneOperator, ...]  #: From velocities to the pressure on each plane
    factors: tuple[Array, ...]  #: ‖F v‖ is the rms pressure on a plane in Pa for real velocities v
    #: Largest reference pressure on each plane in Pa; NaN where a plane is nodal, shape (planes,)
    largest: Array
    resistance: Array  #: Radiation resistance R in W s²/m², shape (markers, markers)

    @classmethod
    def from_shape(
        cls,
        plate: Plate,
        planes: tuple[Plane, ...],
        medium: radiation.Medium,
        omega: float,
        reference: Array,
    ) -> PlateSound:
        """Build from a true deflection (markers,) in m at an angular frequency in rad/s."""
        operators = tuple(plane_operator(plate, plane, omega, medium) for plane in planes)
        factors = tuple(full_factor(op) for op in operators)
        largest = np.array([np.abs(op.field(omega * reference)).max() for op in operators])
        disordered = [omega * np.linalg.norm(F) * np.abs(reference).max() for F in factors]
        nodal = largest <= MAX_NODAL_PRESSURE_RATIO * np.maximum(largest, disordered).max()
        largest = np.where(nodal, np.nan, largest)
        resistance = radiation.radiation_matrix(plate_pistons(plate), omega, medium)
        return cls(omega, reference, operators, factors, largest, resistance)

    def fields(self, deflection: ArrayLike) -> ComplexArray:
        """Return the pressure (planes, u, z) in Pa of a deflection (markers,) in m."""
        velocity = 1j * self.omega * np.asarray(deflection, float)
        return np.stack([op.field(velocity) for op in self.operators])

    def plane_errors(self, deflection: ArrayLike) -> Array:
        """Return rms pressure errors (..., planes) in % of each plane's largest reference."""
        error = np.asarray(deflection, float) - self.reference
        rms = [self.omega * np.linalg.norm(error @ F.T, axis=-1) for F in self.factors]
        return 100 * np.stack(rms, axis=-1) / self.largest

    def expected_plane_errors(self, covariance: ArrayLike) -> Array:
        """Return the rms plane errors (planes,) in % for a covariance (markers, markers) in m²."""
        C = np.asarray(covariance, float)
        rms = [self.omega * np.sqrt(np.sum(Q * C)) for Q in self._squares]
        return 100 * np.array(rms) / self.largest

    @cached_property
    def _squares(self) -> list[Array]:
        """Matrices Q = FᵀF (markers, markers), whose quadratic form is a plane's mean square."""
        return [F.T @ F for F in self.factors]

    @property
    def independent_ratios(self) -> Array:
        """Return plane error over deflection error for independent, equal errors of markers."""
        peak = np.abs(self.reference).max()
        return self.expected_plane_errors(np.eye(len(self.reference)) * peak**2) / 100

    def power(self, deflection: ArrayLike) -> Array:
        """Return the radiated power in W of deflections (..., markers) in m."""
        w = np.asarray(deflection, float)
        return np.asarray(self.omega**2 * np.sum((w @ self.resistance) * w, axis=-1))

    def power_errors(self, deflection: ArrayLike) -> Array:
        """Return the radiated power over that of the reference, less one, in %."""
        return 100 * (self.power(deflection) / self.power(self.reference) - 1)

    def expected_power_error(self, covariance: ArrayLike) -> float:
        """Return the rms power error in % for small unbiased errors of covariance C.

        C is (markers, markers); (tr RC)², of the errors' own power, adds to the variance 4 wᵀRCRw.
        """
        C, R = np.asarray(covariance, float), self.resistance
        slope = R @ self.reference
        variance = 4 * slope @ C @ slope + 2 * np.sum((R @ C) * (C @ R))
        own = np.sum(R * C)
        scale = 100 * self.omega**2 / float(self.power(self.reference))
        return float(scale * np.sqrt(variance + own**2))
