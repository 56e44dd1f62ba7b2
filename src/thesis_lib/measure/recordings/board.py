"""The calibration board: a checkerboard with a white margin (thesis 5.1.2, Appendix D).

Its frame has the origin at the board's centre, x along the columns, y along the rows, and z out of
the printed side, in m. Inner corners run fastest along x.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array


@dataclass(frozen=True)
class Board:
    """A checkerboard."""

    #: Tiles along x and y
    columns: int = 9
    rows: int = 9
    tile: float = 0.045  #: Side of a tile in m
    margin: float = 0.045  #: Width of the white margin around the tiles in m

    @property
    def shape(self) -> tuple[int, int]:
        """Inner corners along x and along y."""
        return self.columns - 1, self.rows - 1

    @property
    def corners(self) -> Array:
        """Inner corners in the board's frame, shape (3, corners), in m."""
        nx, ny = self.shape
        x = (np.arange(nx) - (nx - 1) / 2) * self.tile
        y = (np.arange(ny) - (ny - 1) / 2) * self.tile
        return np.stack([np.tile(x, ny), np.repeat(y, nx), np.zeros(nx * ny)])

    @property
    def dark_tiles(self) -> Array:
        """Vertices of the dark tiles, shape (tiles, 4, 2), in m; the tile at −x, −y is dark."""
        i, j = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        dark = (i + j) % 2 == 0
        low = np.stack([i[dark] - self.columns / 2, j[dark] - self.rows / 2], axis=-1)
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        vertices: Array = (low[:, None] + square) * self.tile
        return vertices

    @property
    def outline(self) -> Array:
        """Vertices of the whole board with its margin, shape (4, 2), in m."""
        x = self.columns * self.tile / 2 + self.margin
        y = self.rows * self.tile / 2 + self.margin
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
