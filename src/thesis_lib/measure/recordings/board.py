"""The calibration board: a checkerboard with a white margin (thesis 5.1.2, Appendix D).

A ChArUco board has an ArUco mark in each light tile, by which its corners are told apart.

Its frame has the origin at the board's centre, x along the columns, y along the rows, and z out of
the printed side, in m. Inner corners run fastest along x.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array

DICTIONARY = "DICT_5X5_1000"  # OpenCV's name of the marks on boards that are printed here
MARK = 0.7  # side of such a mark over that of its tile


@dataclass(frozen=True)
class Board:
    """A checkerboard, with ArUco marks or without."""

    #: Tiles along x and y
    columns: int = 9
    rows: int = 9
    tile: float = 0.045  #: Side of a tile in m
    margin: float = 0.045  #: Width of the white margin around the tiles in m
    thickness: float = 0.0  #: Distance of the printed sides, of a board that has two, in m
    mark: float = 0.0  #: Side of the marks in m; 0 if there are none
    dictionary: str = DICTIONARY  #: OpenCV's name of the dictionary that marks are of

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

    def shown(self, images: Array) -> Array:
        """Corners in the frame of a side, as pictures show them, in m.

        Corners of the other side lie a thickness behind, and run in a picture from it the other
        way round.

        Parameters
        ----------
        images : ndarray, shape (..., 2, corners)
            Pixels in the order of :attr:`corners`; NaN where a picture is absent.

        Returns
        -------
        ndarray, shape (3, corners) of a thin board, else (..., 3, corners)
        """
        if self.thickness == 0:
            return self.corners
        nx, ny = self.shape
        grid = images.reshape(*images.shape[:-1], ny, nx)
        along, up = (np.gradient(grid, axis=axis).mean((-2, -1)) for axis in (-1, -2))
        turn = along[..., 0] * up[..., 1] - along[..., 1] * up[..., 0]  # rows of pixels run down
        behind = np.where(turn > 0, self.thickness, 0.0)[..., None, None]
        return self.corners - behind * np.array([[0.0], [0.0], [1.0]])

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
