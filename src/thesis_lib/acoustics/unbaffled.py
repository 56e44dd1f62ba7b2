"""Sound power of a thin flat structure without a wall, around whose edges the air flows.

Both sides move together, so that the pressure in front is the negative of that behind, and 0 beside
the structure in its plane. The pressure difference μ follows from the velocity v by

    −jωρ₀ v(x) = ∫ μ(y) (1 + jkR) e^{−jkR} / (4πR³) dS,    R = |x − y|,

in Hadamard's sense (A. D. Pierce, Acoustics, section 4.6), and the power of one side is
¼ Re ∫ μ v* dS. The difference is taken as constant in each of equal cells, of which the static part
is integrated exactly, as of a lattice of ring vortices. Such a lattice acts as if it were larger by
a quarter of a cell at each edge, so that much is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.acoustics.sources import AIR, Medium, wavenumber
from thesis_lib.arrays import Array, ComplexArray, IntArray
from thesis_lib.vibration.polygons import edge_distances, polygon_contains

MAX_CELL_RAD = 1.5  # wavenumber of the air times a cell's side, above which cells are too coarse


@dataclass(frozen=True)
class Screen:
    """A thin flat structure that no wall surrounds, as equal cells."""

    places: Array  #: Middles of the cells in the outline's frame, m, shape (2, cells)
    numbers: IntArray  #: Their columns and rows, shape (2, cells)
    size: Array  #: Length and width of a cell in m, shape (2,)

    @classmethod
    def from_outline(cls, outline: ArrayLike, cells: int) -> Screen:
        """Cover corners (n, 2) in m, with about so many cells in the box around them."""
        corners = np.asarray(outline, float)
        low, extent = corners.min(axis=0), np.ptp(corners, axis=0)
        counts = np.maximum(np.rint(np.sqrt(cells * extent / extent[::-1])), 2).astype(int)
        size = extent / (counts + 0.5)
        numbers = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij")).reshape(2, -1)
        places = low[:, None] + (numbers + 0.75) * size[:, None]
        inside = edge_distances(corners, places).min(axis=0) > size.min() / 4
        on = inside & polygon_contains(corners, places)
        return cls(places[:, on], numbers[:, on], size)

    def power_form(self, moving: ArrayLike, omega: float, medium: Medium = AIR) -> Array:
        """Form A of the power wᴴAw in W that one side radiates, of amplitudes w (points,) in m.

        Parameters
        ----------
        moving : array_like, shape (cells, points)
            Displacement of the cells by that of the points.
        omega, medium
            Frequency in rad/s, and the fluid.

        Returns
        -------
        ndarray, shape (points, points)
            NaN where cells are too coarse for the sound's wavelength.
        """
        B, k = np.asarray(moving, float), wavenumber(omega, medium)
        if k * self.size.max() > MAX_CELL_RAD:
            return np.full((B.shape[1], B.shape[1]), np.nan)
        apart = np.abs(self.numbers[:, :, None] - self.numbers[:, None])
        columns, rows = self.numbers.max(axis=1) + 1
        kernel = cell_kernel((int(columns), int(rows)), self.size, k)
        jump = np.linalg.solve(kernel[tuple(apart)], B)
        scale = omega**3 * medium.density * np.prod(self.size) / 4
        return np.asarray(scale * np.imag(B.T @ jump))


def cell_kernel(counts: tuple[int, int], size: Array, k: float) -> ComplexArray:
    """Integrate (1 + jkR) e^{−jkR} / 4πR³ over cells in columns and rows, from the first's middle.

    The parts 1/R³ + k²/2R are integrated exactly, the rest, which is smooth, by the middles.
    """
    steps = (np.arange(count) * side for count, side in zip(counts, size, strict=True))
    x, y = np.meshgrid(*steps, indexing="ij")
    static, near = np.zeros(x.shape), np.zeros(x.shape)
    for sign, a, b in (
        (across * along, x + along * size[0] / 2, y + across * size[1] / 2)
        for along in (-1, 1)
        for across in (-1, 1)
    ):
        static -= sign * np.hypot(a, b) / (a * b)
        near += sign * (a * np.arcsinh(b / np.abs(a)) + b * np.arcsinh(a / np.abs(b)))
    R = np.hypot(x, y)
    R[0, 0] = 1.0
    smooth = ((1 + 1j * k * R) * np.exp(-1j * k * R) - 1) / R**3 - k**2 / (2 * R)
    smooth[0, 0] = -1j * k**3 / 3
    return np.asarray((static + k**2 / 2 * near + smooth * np.prod(size)) / (4 * np.pi))
