"""Flat radiators of any outline, in a rigid wall or without one, whose motion is known at points.

Motion between these points is a linear function of theirs, so pressures are linear, and powers
quadratic forms, in *their* amplitudes.

*In a wall* (:class:`Surface`) the outline is covered by equal cells, each with the four nodes of
Gauss's rule. Where the outline cuts a cell, nodes have the area, the centre and the variances of
the part inside. The error falls with the fourth power of a cell's side Δ, as (kΔ)⁴/4320 for a
wavenumber k in the surface or the air.

*Without a wall* (:class:`Screen`) air flows around the edges. Both sides move together, so that the
pressure in front is the negative of that behind, and 0 in its plane outside the structure. The
pressure difference μ follows from the velocity v by

    −jωρ₀ v(x) = ∫ μ(y) (1 + jkR) e^{−jkR} / (4πR³) dS,    R = |x − y|,

in Hadamard's sense (A. D. Pierce, Acoustics, section 4.6), and the power of one side is
¼ Re ∫ μ v* dS. The difference is taken as constant in each of equal cells; the static part of the
integral is exact, as for a lattice of ring vortices. Such a lattice acts as if it were larger by a
quarter of a cell at each edge, so the cells end that far inside the outline.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thesis_lib.acoustics import radiation
from thesis_lib.arrays import Array, ArrayLike, ComplexArray, IntArray
from thesis_lib.vibration import polygons

# Nodes in standard deviations: UNIT_SQUARE in whole cells, the first shape that fits in cut cells.
UNIT_SQUARE = np.array([[-1, 1, -1, 1], [-1, -1, 1, 1]])
UNIT_CROSS = np.sqrt(2 - 1e-6) * np.array([[-1, 1, 0, 0], [0, 0, -1, 1]])
CELL_SHAPES = (
    UNIT_CROSS,
    UNIT_SQUARE[:, [0, 3, 0, 3]],
    UNIT_SQUARE[:, [1, 2, 1, 2]],
    0 * UNIT_SQUARE,
)
MIN_AREA_RATIO = 1e-9  # share of a cell's area below which a part of it is left out
# Relative standard uncertainty of a power or an efficiency due to the sum over 1600 nodes, and its
# increase per area share of cut cells: from errors against Gauss's rule of high order for
# rectangles, an L and a disc, with up to four half-waves a side.
SUM_STD, CUT_STD = 1e-4, 4e-3


@dataclass(frozen=True)
class Surface:
    """A flat surface in a rigid wall, as nodes."""

    pistons: radiation.Pistons  #: Nodes relative to the origin, each with a quarter of a cell
    share: Array  #: Area of each node over that of its piston, shape (nodes,)
    places: Array  #: Nodes in the outline's frame, m, shape (2, nodes)

    @classmethod
    def from_outline(
        cls, outline: ArrayLike, nodes: int, origin: tuple[float, float] = (0.0, 0.0)
    ) -> Surface:
        """Cover an outline (corners, 2) in m, with about `nodes` nodes in the box around it.

        The coordinates of the sound start at `origin`, a point in the outline's frame.
        """
        corners = np.asarray(outline, float)
        low, extent = corners.min(axis=0), np.ptp(corners, axis=0)
        counts = np.maximum(np.rint(np.sqrt(nodes / 4 * extent / extent[::-1])), 1).astype(int)
        size = extent / counts
        grid = np.indices(counts).reshape(2, -1)
        centres = low[:, None] + (grid + 0.5) * size[:, None]
        depths, reach = polygons.polygon_depths(corners, centres), np.hypot(*size) / 2
        near, whole = np.abs(depths) < reach, centres[:, depths >= reach].T
        square = size[:, None] / np.sqrt(12) * UNIT_SQUARE
        parts = [(1.0, middle[:, None] + square) for middle in whole]
        parts += [_cut_cell(corners, middle, size) for middle in centres[:, near].T]
        parts = [one for one in parts if one[0] > MIN_AREA_RATIO]
        at = np.concatenate([nodes for _, nodes in parts], axis=1)
        half = float(size[0] / 2), float(size[1] / 2)
        pistons = radiation.Pistons(at - np.array(origin)[:, None], half)
        return cls(pistons, np.repeat([share for share, _ in parts], 4), at)

    @cached_property
    def area(self) -> float:
        """Return the area in m²."""
        return float(self.pistons.area * self.share.sum())

    @cached_property
    def sum_std(self) -> float:
        """Relative standard uncertainty of a power or an efficiency due to the sum over nodes."""
        cut = self.share[self.share < 1 - MIN_AREA_RATIO].sum() / self.share.sum()
        return float(SUM_STD + CUT_STD * cut)

    def power_form(
        self, moving: ArrayLike, omega: float, medium: radiation.Medium = radiation.AIR
    ) -> Array:
        """Return the form A of the radiated power wᴴAw in W for amplitudes w (points,) in m.

        Parameters
        ----------
        moving : array_like, shape (nodes, points)
            Displacement of the nodes per displacement of the points.
        omega, medium
            Frequency in rad/s, and the fluid.
        """
        B = omega * self.share[:, None] * np.asarray(moving, float)
        return np.asarray(B.T @ radiation.resistive_forces(self.pistons, B, omega, medium))

    def plane_wave_form(
        self, moving: ArrayLike, omega: float, medium: radiation.Medium = radiation.AIR
    ) -> Array:
        """Return the form of the power ρ₀cS⟨v²⟩/2 of a plane wave of the same area and motion."""
        B = omega * np.asarray(moving, float)
        scale = medium.density * medium.speed_of_sound * self.pistons.area / 2
        return np.asarray(scale * B.T @ (self.share[:, None] * B))

    def wavenumber_forms(self, moving: ArrayLike) -> tuple[Array, Array]:
        """Return forms of summed squared slopes and displacements; their ratio is wavenumber².

        For sines along both sides it is that of the flexural wave, (mπ/a)² + (nπ/b)². Only whole
        cells contribute.
        """
        B = np.asarray(moving, float)
        cells = B.reshape(-1, 4, B.shape[1])[self.share[::4] > 1 - MIN_AREA_RATIO]
        apart = 4 / np.sqrt(12) * np.array(self.pistons.size)  # between two nodes, along and across
        along = (cells[:, [1, 3]] - cells[:, [0, 2]]) / apart[0]
        across = (cells[:, [2, 3]] - cells[:, [0, 1]]) / apart[1]
        slopes = np.concatenate([along, across], axis=1).reshape(-1, B.shape[1])
        every = cells.reshape(-1, B.shape[1])
        return 2 * slopes.T @ slopes, every.T @ every

    def pressure_matrix(
        self,
        moving: ArrayLike,
        points: ArrayLike,
        omega: float,
        medium: radiation.Medium = radiation.AIR,
    ) -> ComplexArray:
        """Return the pressure in Pa per metre at points (3, n) in front, shape (n, points)."""
        B = 1j * omega * self.share[:, None] * np.asarray(moving, float)
        return np.asarray(radiation.transfer_pressure(self.pistons, points, omega, medium) @ B)


def _cut_cell(corners: Array, middle: Array, size: Array) -> tuple[float, Array]:
    """Return the share of a cell's area inside an outline, and its nodes (2, 4)."""
    inner = polygons.clip_polygon(corners - middle, -size / 2, size / 2)
    area, centre, variances = polygons.polygon_moments(inner)
    share, std = area / float(np.prod(size)), np.sqrt(np.maximum(variances, 0))[:, None]
    if share > 1 - MIN_AREA_RATIO:
        return 1.0, middle[:, None] + std * UNIT_SQUARE
    nodes = [(middle + centre)[:, None] + std * one for one in CELL_SHAPES]
    inside = (one for one in nodes if (polygons.polygon_depths(corners, one) > 0).all())
    return share, next(inside, nodes[-1])


MAX_CELL_RAD = 1.5  # wavenumber of the air times a cell's side, above which cells are too coarse


@dataclass(frozen=True)
class Screen:
    """A thin flat structure without a wall around it, as equal cells."""

    places: Array  #: Middles of the cells in the outline's frame, m, shape (2, cells)
    numbers: IntArray  #: Their columns and rows, shape (2, cells)
    size: Array  #: Length and width of a cell in m, shape (2,)

    @classmethod
    def from_outline(cls, outline: ArrayLike, cells: int) -> Screen:
        """Cover an outline (corners, 2) in m, with about `cells` cells in the box around it."""
        corners = np.asarray(outline, float)
        low, extent = corners.min(axis=0), np.ptp(corners, axis=0)
        counts = np.maximum(np.rint(np.sqrt(cells * extent / extent[::-1])), 2).astype(int)
        size = extent / (counts + 0.5)
        numbers = np.indices(counts).reshape(2, -1)
        places = low[:, None] + (numbers + 0.75) * size[:, None]
        on = polygons.polygon_depths(corners, places) > size.min() / 4
        return cls(places[:, on], numbers[:, on], size)

    def power_form(
        self, moving: ArrayLike, omega: float, medium: radiation.Medium = radiation.AIR
    ) -> Array:
        """Return the form A of one side's power wᴴAw in W for amplitudes w (points,) in m.

        Parameters
        ----------
        moving : array_like, shape (cells, points)
            Displacement of the cells per displacement of the points.
        omega, medium
            Frequency in rad/s, and the fluid.

        Returns
        -------
        ndarray, shape (points, points)
            NaN where cells are too coarse for the sound's wavelength, or none fits the outline.
        """
        B, k = np.asarray(moving, float), radiation.wavenumber(omega, medium)
        if not self.places.size or k * self.size.max() > MAX_CELL_RAD:
            return np.full((B.shape[1], B.shape[1]), np.nan)
        apart = np.abs(self.numbers[:, :, None] - self.numbers[:, None])
        columns, rows = self.numbers.max(axis=1) + 1
        kernel = cell_kernel((int(columns), int(rows)), self.size, k)
        jump = np.linalg.solve(kernel[tuple(apart)], B)
        scale = omega**3 * medium.density * np.prod(self.size) / 4
        return np.asarray(scale * np.imag(B.T @ jump))


def cell_kernel(counts: tuple[int, int], size: Array, k: float) -> ComplexArray:
    """Integrate (1 + jkR) e^{−jkR} / 4πR³ over cells in columns and rows, R from the first cell.

    The parts 1/R³ + k²/2R are integrated exactly, the smooth remainder by the midpoint rule.
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
