"""A simply supported Kirchhoff plate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, IntArray
from thesis_lib.vibration.structure import numbers_from_one


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
    grid: tuple[int, int]  #: Markers along x and y: the centres of so many equal cells

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
        nx, ny = self.grid
        x = (np.arange(nx) + 0.5) * self.length / nx
        y = (np.arange(ny) + 0.5) * self.width / ny
        return np.stack([np.tile(x, ny), np.repeat(y, nx)])

    def mode_indices(self, n_modes: int) -> IntArray:
        """Return index pairs (m₁, m₂) of the first modes in order of frequency, shape (n_modes, 2).

        The order is that of the natural frequencies; the thesis's Table 4.2 departs from it from
        its fourth mode on.
        """
        if n_modes < 1:
            raise ValueError(f"n_modes: given {n_modes}, needs 1 or more")
        return np.array(_plate_indices(self.length / self.width, int(n_modes)))

    def angular_frequencies(self, n_modes: int) -> Array:
        """Return the first natural frequencies in rad/s, shape (n_modes,) (eq. 4.6)."""
        waves = np.pi * self.mode_indices(n_modes) / self.extent
        return np.sqrt(self.bending_stiffness / self.mass_per_area) * np.sum(waves**2, axis=1)

    def modal_density(self, omega: ArrayLike) -> Array:
        """Return the modes per rad/s, S/(4π) √(m/D), at any frequency the same."""
        area = self.length * self.width
        density = area / (4 * np.pi) * np.sqrt(self.mass_per_area / self.bending_stiffness)
        return np.full_like(np.asarray(omega, float), density)

    def shape_peak(self, mode: int) -> float:
        """Return the largest absolute value of a mode shape: 2, at the antinodes."""
        return 2.0

    def mode_shapes(self, modes: Sequence[int], points: ArrayLike) -> Array:
        """Return mode shapes 2 sin(m₁πx/Lx) sin(m₂πy/Ly) at `points` (2, ...) (eq. 4.4)."""
        x, y = np.asarray(points, float)
        m = self.mode_indices(max(modes))[numbers_from_one(modes) - 1].T
        m1, m2 = m.reshape((2, -1) + (1,) * x.ndim)
        return 2 * np.sin(m1 * np.pi * x / self.length) * np.sin(m2 * np.pi * y / self.width)


@lru_cache
def _plate_indices(aspect: float, n_modes: int) -> tuple[tuple[int, int], ...]:
    # A mode among the first n has m₁ m₂ ≤ n: the modes below it fill the rectangle to it.
    pairs = [(m1, m2) for m1 in range(1, n_modes + 1) for m2 in range(1, n_modes // m1 + 1)]
    return tuple(sorted(pairs, key=lambda m: ((m[0] / aspect) ** 2 + m[1] ** 2, m))[:n_modes])
