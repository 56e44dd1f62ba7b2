"""Flat radiators of any outline, whose motion is known at some points.

The outline is covered by equal cells. A cell radiates with the share of it that lies inside, as a
piston of that part of the velocity. What moves between the points that are known is a linear
function of what they do, so that all sound is linear, or a quadratic form, in *their* amplitudes.

A cell moves as the mean of what moves in it. That of its middle is larger where the surface bends:
by a share of k²Δ²/24 for a side Δ and a flexural wavenumber k, which for 1600 cells and a plate's
first mode makes 0.1 % of the power.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.acoustics.radiation import radiation_matrix
from thesis_lib.acoustics.sources import AIR, Medium, Pistons, transfer
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.vibration.polygons import area, contains

FINE = 6  # places along each side of a cell by which its share inside is counted
WHOLE = 1 - 1e-9  # share from which on a cell lies inside


@dataclass(frozen=True)
class Surface:
    """A flat surface in a rigid baffle, as cells."""

    pistons: Pistons  #: The cells, each at the middle of what lies inside, from the origin
    share: Array  #: Of each cell, what lies inside the outline, shape (cells,)
    places: Array  #: The same middles in the outline's own frame, m, shape (2, cells)

    @classmethod
    def of(
        cls, outline: ArrayLike, cells: int, origin: tuple[float, float] = (0.0, 0.0)
    ) -> Surface:
        """The surface inside corners (n, 2) in m, with about so many cells in the box around it.

        Sound is told from an origin in the outline's frame.
        """
        corners = np.asarray(outline, float)
        low, extent = corners.min(axis=0), np.ptp(corners, axis=0)
        counts = np.maximum(np.rint(np.sqrt(cells * extent / extent[::-1])), 2).astype(int)
        size = extent / counts
        x, y = (low[i] + (np.arange(counts[i]) + 0.5) * size[i] for i in range(2))
        centres = np.stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        steps = (np.arange(FINE) + 0.5) / FINE - 0.5
        parts = np.stack(np.meshgrid(*[steps, steps])).reshape(2, -1) * size[:, None]
        fine = centres[:, :, None] + parts[:, None]
        inside = contains(corners, fine.reshape(2, -1)).reshape(fine.shape[1:])
        on, share = inside.any(axis=1), inside.mean(axis=1)
        places = np.sum(fine * inside, axis=2)[:, on] / inside.sum(axis=1)[on]
        share = share[on] * abs(area(corners)) / (np.sum(share) * np.prod(size))  # the exact area
        own = Pistons(places - np.array(origin)[:, None], (float(size[0]), float(size[1])))
        return cls(own, share, places)

    @cached_property
    def spots(self) -> Array:
        """Four places in each cell, whose mean is the cell's (Gauss), shape (2, cells, 4), in m.

        Where the outline cuts a cell, all are the middle of what lies inside.
        """
        aside = np.array([[-1, 1, -1, 1], [-1, -1, 1, 1]]) / np.sqrt(12)
        off = np.array(self.pistons.size)[:, None] * aside
        whole = self.share > WHOLE
        return np.asarray(self.places[:, :, None] + off[:, None] * whole[:, None], float)

    @cached_property
    def area(self) -> float:
        """Area in m²."""
        return float(self.pistons.area * self.share.sum())

    def power_form(self, moving: ArrayLike, omega: float, medium: Medium = AIR) -> Array:
        """Form A of the radiated power wᴴAw in W of amplitudes w (points,) in m.

        Parameters
        ----------
        moving : array_like, shape (cells, points) or (cells, 4, points)
            Displacement of the cells, or of their :attr:`spots`, by that of the points.
        omega, medium
            Frequency in rad/s, and the fluid.
        """
        B = omega * self.share[:, None] * _mean(moving)
        return np.asarray(B.T @ radiation_matrix(self.pistons, omega, medium) @ B)

    def plane_wave_form(self, moving: ArrayLike, omega: float, medium: Medium = AIR) -> Array:
        """Form of the power ρ₀cS⟨v²⟩/2 that a plane wave of the same area and motion carries."""
        B = omega * np.asarray(moving, float)
        scale = medium.density * medium.speed_of_sound * self.pistons.area / 2
        many = 1 if B.ndim == 2 else B.shape[1]
        each = B.reshape(-1, B.shape[-1])
        return np.asarray(scale / many * each.T @ (np.repeat(self.share, many)[:, None] * each))

    def pressure_matrix(
        self, moving: ArrayLike, points: ArrayLike, omega: float, medium: Medium = AIR
    ) -> ComplexArray:
        """Pressure in Pa at points (3, n) in front, by amplitudes in m, shape (n, points)."""
        B = 1j * omega * self.share[:, None] * _mean(moving)
        return np.asarray(transfer(self.pistons, points, omega, medium) @ B)


def _mean(moving: ArrayLike) -> Array:
    """Displacement of cells by that of points, (cells, points), of theirs or of their spots'."""
    B = np.asarray(moving, float)
    return B if B.ndim == 2 else np.asarray(B.mean(axis=1), float)
