"""What errors of a plate's deflection do to its sound: two planes and the radiated power.

The pressure is linear in the deflection, so the rms error on a plane is ω ‖F e‖ with a small
triangular factor F; the power is ω² wᵀRw with the radiation resistance R.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.acoustics.planes import (
    Plane,
    PlaneOperator,
    full_factor,
    plane_operator,
    plate_pistons,
)
from thesis_lib.acoustics.radiation import radiation_matrix
from thesis_lib.acoustics.sources import Medium
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.vibration.plate import Plate

# A plane whose reference is below this share of the other's, or of the pressure of pistons that
# move as much but without order, has none: mode (2, 2) is silent on both planes.
MAX_NODAL_PRESSURE_RATIO = 1e-6


@dataclass(frozen=True)
class PlateSound:
    """The sound of one deflection shape, and of others held against it."""

    omega: float  #: Angular frequency in rad/s
    reference: Array  #: True deflection in m, shape (markers,)
    operators: tuple[PlaneOperator, ...]  #: From velocities to the pressure on each plane
    factors: tuple[Array, ...]  #: ‖F v‖ is the rms pressure on a plane in Pa for real velocities v
    #: Largest reference pressure on each plane in Pa; NaN where a plane is nodal, shape (planes,)
    largest: Array
    resistance: Array  #: Radiation resistance R in W s²/m², shape (markers, markers)

    @classmethod
    def from_shape(
        cls, plate: Plate, planes: tuple[Plane, ...], medium: Medium, omega: float, reference: Array
    ) -> PlateSound:
        """Build from a true deflection (markers,) in m at an angular frequency in rad/s."""
        operators = tuple(plane_operator(plate, plane, omega, medium) for plane in planes)
        factors = tuple(full_factor(op) for op in operators)
        largest = np.array([np.abs(op.field(omega * reference)).max() for op in operators])
        disordered = [omega * np.linalg.norm(F) * np.abs(reference).max() for F in factors]
        nodal = largest <= MAX_NODAL_PRESSURE_RATIO * np.maximum(largest, disordered).max()
        resistance = radiation_matrix(plate_pistons(plate), omega, medium)
        return cls(
            omega, reference, operators, factors, np.where(nodal, np.nan, largest), resistance
        )

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
        """Plane error over deflection error for errors of equal size, marker by marker."""
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
        """Return the rms power error in % by small unbiased errors, (markers, markers) covariance.

        Their own power, tr RC, adds to what they make the reference's vary, 4 wᵀRCRw.
        """
        C, R = np.asarray(covariance, float), self.resistance
        slope = R @ self.reference
        variance = 4 * slope @ C @ slope + 2 * np.sum((R @ C) * (C @ R))
        own = np.sum(R * C)
        scale = 100 * self.omega**2 / float(self.power(self.reference))
        return float(scale * np.sqrt(variance + own**2))
