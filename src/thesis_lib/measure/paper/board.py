"""The calibration board on paper: a checkerboard, or one with ArUco marks in its white tiles."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.paper.page import SIZES, Draw, PaperError, area, polygons, rectangle, write
from thesis_lib.measure.recordings.board import DICTIONARY, MARK, Board

BITS = 7  # along a mark with its black frame
MARKS = 1000  # that the dictionary has


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
        is turned like a page of a book. Marks would be mirrored, too, so not of a board with them.

    Returns
    -------
    str
        What the manifest says of this board, and OpenCV of one with marks.

    Raises
    ------
    PaperError
        If the board with a white margin of half a tile does not fit the paper, or has more marks
        than the dictionary, or marks on both sides.
    """
    if charuco and two_sided:
        raise PaperError(
            "--two-sided: given with --charuco, allowed: for a checkerboard, as no program reads "
            "marks that are mirrored"
        )
    if charuco and columns * rows // 2 > MARKS:
        raise PaperError(
            f"--columns, --rows: given {columns} × {rows} tiles, allowed with --charuco: at most "
            f"{2 * MARKS + 1}, {DICTIONARY} has no more marks"
        )
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
    kind = "kind: charuco, " if charuco else ""
    said = (
        f"in the manifest: board: {{{kind}columns: {columns}, rows: {rows}, tile_mm: {tile_mm:g}, "
        f"margin_mm: {np.floor(margin):g}, two_sided: {str(two_sided).lower()}}}"
    )
    if charuco:
        dark = dark * [1, -1] + [0, rows * tile_mm]  # OpenCV begins with a dark tile at the top
        dark = np.concatenate([dark[:, ::-1], _marks(columns, rows, tile_mm)])
        said += (
            f"\nfor OpenCV: CharucoBoard(({columns}, {rows}), {tile_mm:g}, {MARK * tile_mm:g}, "
            f"{DICTIONARY})"
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
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
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
