"""The calibration board on paper: a checkerboard, or one with ArUco marks in its white tiles."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.paper.page import SIZES, Draw, PaperError, area, polygons, rectangle, write
from thesis_lib.measure.recordings.board import Board

DICTIONARY = cv2.aruco.DICT_5X5_1000  # of 5 × 5 bits
MARK = 0.7  # side of a mark over that of its tile
BITS = 7  # along a mark with its black frame


def write_board(
    path: Path,
    columns: int = 7,
    rows: int = 5,
    tile_mm: float = 25.0,
    paper: str = "A4",
    charuco: bool = False,
    two_sided: bool = False,
) -> str:
    """Write a board as a PDF to true scale.

    The tile at its lower left is dark, or with marks that at its upper left.

    Parameters
    ----------
    path : Path
        The file.
    columns, rows : int
        Tiles.
    tile_mm : float
        Side of a tile.
    paper : str
        Size of the page.
    charuco : bool
        Whether white tiles carry ArUco marks, as OpenCV's ``CharucoBoard`` has them.
    two_sided : bool
        Whether a second page has the mirror image, for the back: tile behind tile when the sheet
        is turned like a page of a book.

    Returns
    -------
    str
        What the manifest says of this board, or OpenCV.

    Raises
    ------
    PaperError
        If the board with a white margin of half a tile does not fit the paper.
    """
    landscape = columns >= rows
    wide, high = area(paper, landscape)
    need = (columns + 1) * tile_mm, (rows + 1) * tile_mm  # with half a tile all around
    if need[0] > wide + 1e-9 or need[1] > high + 1e-9:
        most = min(wide / (columns + 1), high / (rows + 1))
        larger = [
            name
            for name in SIZES
            if all(n <= a + 1e-9 for n, a in zip(need, area(name, landscape), strict=True))
        ]
        or_paper = f", or --paper {larger[0]}" if larger else ""
        raise PaperError(
            f"--tile-mm: given {tile_mm:g}, allowed: at most {most:.4g} for {columns} × {rows} "
            f"tiles on {paper}{or_paper}"
        )
    margin = min(wide - columns * tile_mm, high - rows * tile_mm) / 2
    board = Board(columns, rows, tile_mm / 1000, margin / 1000)
    left, low = (wide - columns * tile_mm) / 2, (high - rows * tile_mm) / 2
    dark = 1000 * board.dark_tiles + [columns * tile_mm / 2, rows * tile_mm / 2]
    said = (
        f"in the manifest: board: {{columns: {columns}, rows: {rows}, tile_mm: {tile_mm:g}, "
        f"margin_mm: {np.floor(margin):g}, two_sided: {str(two_sided).lower()}}}"
    )
    if charuco:
        dark = dark * [1, -1] + [0, rows * tile_mm]  # OpenCV begins with a dark tile at the top
        dark = np.concatenate([dark[:, ::-1], _marks(columns, rows, tile_mm)])
        said = (
            f"for OpenCV: CharucoBoard(({columns}, {rows}), {tile_mm:g}, {MARK * tile_mm:g}, "
            "DICT_5X5_1000)"
        )
    dark = dark + [left, low]
    sides = [("", dark)]
    if two_sided:
        sides = [("front: ", dark), ("back: ", (dark * [-1, 1] + [wide, 0])[:, ::-1])]

    write(path, paper, landscape, [(_drawing(tiles), side + said) for side, tiles in sides])
    return said


def _drawing(tiles: Array) -> Draw:
    return lambda axes: polygons(axes, tiles)


def _marks(columns: int, rows: int, tile: float) -> Array:
    """Dark cells of the marks, (cells, 4, 2), mm from the board's lower left corner.

    OpenCV counts the white tiles from the upper left, row by row; each mark is in a middle.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARY)
    side, cells, number = MARK * tile, [], 0
    for row in range(rows):
        for column in range(columns):
            if (column + row) % 2 == 0:  # dark
                continue
            bits = dictionary.generateImageMarker(number, BITS) == 0
            number += 1
            x = column * tile + (tile - side) / 2
            y = (rows - row) * tile - (tile - side) / 2
            step = side / BITS
            for i, j in np.argwhere(bits):
                cells.append(rectangle(x + j * step, y - (i + 1) * step, step, step))
    return np.array(cells)
