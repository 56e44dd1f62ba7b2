"""Edges blurred by a Gaussian, as pixels see them, from tables.

A pixel has a width of 1 px, so that an edge at x, seen from its centre, with all beyond it white
gives it the share A(x) = ∫ Φ((t − x)/σ) dt over −½ < t < ½. Needed are A and its slope, or that and
its own, mostly in all the pixels of a row at once: they are one row of a table, in which edges are
1/256 px apart. Between them values go straight on, which misses less than 2 · 10⁻⁵.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from thesis_lib.arrays import Array

FINE = 256  # edges to a px
BEYOND = 2  # px beyond a window's pixels up to which its edges may be
FAR = 6.0  # standard deviations from which nothing is seen of an edge

Pixels = NDArray[np.float32]


class Profiles:
    """Tables of blurred edges.

    Parameters
    ----------
    blur : float
        Standard deviation of the Gaussian in px.
    size : tuple of int
        Rows and columns of the windows.
    """

    def __init__(self, blur: float, size: tuple[int, int]) -> None:
        self.blur = blur
        self.half = int(np.ceil((FAR * blur + 0.5) * FINE))
        x = np.arange(-self.half - 1, self.half + 2) / FINE
        low, high = (-0.5 - x) / blur, (0.5 - x) / blur
        self.share = _means(blur * (_ramp(high) - _ramp(low)))
        self.slope = _means(ndtr(low) - ndtr(high))
        self.bend = _means((_bell(high) - _bell(low)) / blur)
        twist = _means((high * _bell(high) - low * _bell(low)) / blur**2)
        rows, columns = size
        self._along = self._rows(columns, self.share, self.slope, self.bend)
        self._across = self._rows(rows, -self.slope, -self.bend, -twist)

    def _rows(self, pixels: int, *profiles: Pixels) -> Pixels:
        edges = np.arange(-BEYOND * FINE, (pixels - 1 + BEYOND) * FINE + 1)
        at = edges[:, None] - FINE * np.arange(pixels) + self.half
        return np.concatenate([p.take(at, mode="clip") for p in profiles], axis=1)

    def along(self, edges: Array) -> Pixels:
        """Shares beyond edges in each pixel of a row, and their derivatives in the edge's place.

        Edges (...) count in px from the first pixel's centre; the result is (..., 2 columns).
        """
        return _between(self._along, edges)

    def across(self, places: Array) -> Pixels:
        """Shares of a blurred line in each pixel of a column, and their derivatives in its place.

        As :meth:`along`, (..., 2 rows); they sum to one.
        """
        return _between(self._across, places)

    def step(self, inward: Pixels) -> tuple[Pixels, Pixels]:
        """Shares of pixels so far, in px, behind an edge, and their derivatives in that."""
        at = np.float32(self.half) - np.float32(FINE) * inward
        nearest = np.rint(at)
        index, off = nearest.astype(np.int32), (at - nearest) * np.float32(1 / FINE)
        share, slope, bend = (
            table.take(index, mode="clip") for table in (self.share, self.slope, self.bend)
        )
        return share + off * slope, -slope - off * bend


def _between(table: Pixels, edges: Array) -> Pixels:
    """Rows of a table of values and slopes, from the nearest ones straight on."""
    at = FINE * (edges + BEYOND)
    nearest = np.rint(at)
    found = table.take(nearest.astype(np.int32), axis=0, mode="clip")
    pixels = table.shape[1] // 3
    off = ((at - nearest) / FINE).astype(np.float32)[..., None]
    return np.asarray(found[..., : 2 * pixels] + off * found[..., pixels:])


def _means(x: Array) -> Pixels:
    """Means over the cells around all entries but the outermost: tangents miss none on average."""
    return np.asarray(x[1:-1] + np.diff(x, 2) / 24, np.float32)


@lru_cache(maxsize=16)
def profiles(blur: float, size: tuple[int, int]) -> Profiles:
    """The tables for a blur in px and the size (rows, columns) of windows, made once."""
    return Profiles(blur, size)


def _bell(x: Array) -> Array:
    """The normal density."""
    return np.asarray(np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi))


def _ramp(x: Array) -> Array:
    """The integral of the normal distribution."""
    return np.asarray(x * ndtr(x) + _bell(x))
