"""Where the board's corners are in an image, to a fraction of a pixel, by OpenCV.

Module :mod:`~thesis_lib.measure.calibration.corners` makes them exact.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np

from thesis_lib.arrays import Array, Image, Mask
from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision.lens import HALF_PIXEL

_MIN_BORDER_PX = 4.0  # least distance of a corner from the image's border, px
# Corners of a board with marks that must be seen, or half of a small one's
_MIN_MARKED_CORNERS = 12
_DICTIONARY_SIZES = (
    50,
    100,
    250,
    1000,
)  # of OpenCV's dictionaries, which begin with the same marks
_REDUCED_PX = 640  # longer side of the smaller image in which large tiles are looked for
_COMMON_DICTIONARIES = (
    "4X4_250",
    "5X5_250",
    "6X6_250",
    "7X7_250",
    "ARUCO_ORIGINAL",
    "APRILTAG_36H11",
)


# Least contrast of tiles beyond the outermost ones, over theirs, by which a board goes on. Margins
# and backgrounds have up to 0.2.
_MIN_CONTINUED_SHARE = 0.5
Finder = Callable[[Image, Board], tuple[Image, Array]]


class BoardNotFound(ValueError):  # noqa: N818 - no mistake, an image without a board
    """An image in which no trustworthy board is seen; the message says why."""


def board_finders(board: Board) -> tuple[Finder, ...]:
    """Return the ways of finding a board, to be tried one after the other.

    Each returns the image in which it saw the board, the given one or its negative, and the inner
    corners, shape (2, rows − 1, columns − 1), px from the image's top-left corner, with x and y as
    seen from the printed side; NaN where a corner of a board with marks is not seen. A checkerboard
    is seen as a whole. It raises :class:`BoardNotFound` if the image shows no board, or too little
    of it.
    """
    ways = (_find_marks,) if board.mark else (_by_quads, _by_reduced_quads, _by_sectors)
    return tuple(partial(_find, way, negative) for negative in (False, True) for way in ways)


def _find(
    way: Callable[[Image, Board], Array], negative: bool, image: Image, board: Board
) -> tuple[Image, Array]:
    """Find the corners in an image or in its negative, as of a board printed white on black."""
    shown = 255 - image if negative else image
    return shown, way(shown, board)


def _by_quads(image: Image, board: Board) -> Array:
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    # No fast check: it gives up on most views that are steep or have a narrow margin.
    return _order_corners(*cv2.findChessboardCorners(image, board.shape, flags=flags), image, board)


def _by_reduced_quads(image: Image, board: Board) -> Array:
    """Find large tiles, whose edges the finder loses in noise and texture, on a smaller image."""
    height, width = image.shape
    factor = max(image.shape) / _REDUCED_PX
    if factor <= 1:
        raise BoardNotFound("no checkerboard seen")
    size = round(width / factor), round(height / factor)
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    scale = np.array([width / size[0], height / size[1]])
    return scale[:, None, None] * _by_quads(small, board)


def _by_sectors(image: Image, board: Board) -> Array:
    """Find corners by OpenCV's other finder, which is sure of large tiles but not of small ones."""
    return _order_corners(*cv2.findChessboardCornersSB(image, board.shape), image, board)


def _order_corners(found: bool, raw: Any, image: Image, board: Board) -> Array:
    """Return a finder's corners with y up where x is right."""
    if not found:
        raise BoardNotFound("no checkerboard seen")
    nx, ny = board.shape
    corners = np.asarray(raw, float).reshape(ny, nx, 2).transpose(2, 0, 1) + HALF_PIXEL
    nearest = float(_to_border(corners, image).min())
    if nearest < _MIN_BORDER_PX:
        raise BoardNotFound(
            f"a corner is {nearest:.1f} px from the border, needs {_MIN_BORDER_PX:.0f}"
        )
    (xu, xv), (yu, yv) = (np.gradient(corners, axis=axis).mean((1, 2)) for axis in (2, 1))
    corners = corners if xu * yv - xv * yu < 0 else corners[:, ::-1]
    if _continues(image, corners):
        raise BoardNotFound(
            f"the tiles go on beyond a board of {nx + 1} × {ny + 1}: are there more than that?"
        )
    return corners


def _continues(image: Image, corners: Array) -> bool:
    """Return whether tiles alternate beyond those about corners (2, ny, nx), on any side."""
    _, ny, nx = corners.shape
    y, x = np.mgrid[:ny, :nx].astype(float)
    found, _ = cv2.findHomography(np.stack([x.ravel(), y.ravel()], 1), corners.reshape(2, -1).T)
    if found is None:
        return False
    H = np.asarray(found, float)
    for length, width, across in ((nx, ny, False), (ny, nx, True)):
        along = np.arange(-0.5, length)
        parity = 1 - 2 * (np.arange(length + 1) % 2) * 1.0
        parity -= parity.mean()
        for last, beyond in ((-0.5, -1.5), (width - 0.5, width + 0.5)):
            rows = []
            for off in (last, beyond):
                places = np.stack([along, np.full_like(along, off)])
                grey = _grey(image, H, places[::-1] if across else places)
                rows.append(float(parity @ grey))
            if -rows[1] * np.sign(rows[0]) > _MIN_CONTINUED_SHARE * abs(rows[0]):
                return True
    return False


def _grey(image: Image, H: Array, places: Array) -> Array:
    """Average grey levels about places (2, n) of a plane; NaN where any is outside the image."""
    spread = 0.2 * np.array([[-1, 1, -1, 1, 0], [-1, -1, 1, 1, 0]])  # of a tile, about its middle
    points = (places[:, :, None] + spread[:, None]).reshape(2, -1)
    u, v, w = H @ np.vstack([points, np.ones_like(points[:1])])
    height, width = image.shape
    column, row = np.floor(u / w), np.floor(v / w)
    inside = (w > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    column, row = (np.where(inside, c, 0).astype(int) for c in (column, row))
    grey = np.where(inside, image[row, column].astype(float), np.nan)
    return np.asarray(grey.reshape(-1, spread.shape[1]).mean(axis=1))


def _find_marks(image: Image, board: Board) -> Array:
    """Return the visible corners between marks; the marks identify the corners."""
    count = board.columns * board.rows // 2
    bits = board.dictionary.rpartition("_")[0]
    size = next(
        size for size in _DICTIONARY_SIZES if size >= count
    )  # of fewer marks more errors are mended
    dictionary, marks, numbers = _read(image, f"{bits}_{size}")
    nx, ny = board.shape
    corners = np.full((nx * ny, 2), np.nan)
    # Before OpenCV 4.6 a board began with a light tile. Its check refuses some steep views, too.
    for legacy, checked in ((False, True), (True, True), (False, False)):
        layout = cv2.aruco.CharucoBoard((nx + 1, ny + 1), board.tile, board.mark, dictionary)
        layout.setLegacyPattern(legacy)
        parameters = cv2.aruco.CharucoParameters()
        parameters.checkMarkers = checked
        detector = cv2.aruco.CharucoDetector(layout, parameters)
        places, which, _, _ = detector.detectBoard(image, None, None, marks, numbers)
        if which is not None:
            corners[np.ravel(which)] = np.reshape(places, (-1, 2)) + HALF_PIXEL
            break
    corners = corners.reshape(ny, nx, 2).transpose(2, 0, 1)[:, ::-1]  # OpenCV's rows run down
    corners[:, _to_border(corners, image) < _MIN_BORDER_PX] = np.nan
    corners[:, _off_plane(corners, board)] = np.nan
    seen, least = int(np.isfinite(corners[0]).sum()), min(_MIN_MARKED_CORNERS, nx * ny // 2)
    if seen < least:
        others = _others(image, f"{bits}_{size}", count) if 2 * len(marks) < count else ""
        raise BoardNotFound(
            f"{len(marks)} marks of {board.dictionary} seen{others}; {seen} corners between them "
            f"as on a board of {nx + 1} × {ny + 1} tiles, needs {least}"
        )
    return corners


def _off_plane(corners: Array, board: Board) -> Mask:
    """Return which corners (2, ny, nx) are off the plane of most corners; all, if most are."""
    off = np.isfinite(corners[0])
    if np.count_nonzero(off) > 4:
        plane = board.corners[:2].reshape(corners.shape)[:, off]
        _, right = cv2.findHomography(corners[:, off].T, plane.T, cv2.RANSAC, board.tile / 4)
        if 2 * np.count_nonzero(right) > right.size:
            off[off] = np.ravel(right) == 0
    return off


def _read(image: Image, name: str) -> tuple[cv2.aruco.Dictionary, Any, Any]:
    """Return a dictionary, the corners of its visible marks, and their numbers."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    parameters = cv2.aruco.DetectorParameters()
    parameters.errorCorrectionRate = 1.0  # of what tells marks apart; a false one fits no board
    marks, numbers, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    return dictionary, marks, numbers


def _others(image: Image, name: str, count: int) -> str:
    """Say which marks are seen instead on a board that has so many; fewer may be by chance."""
    mirrored = len(_read(np.ascontiguousarray(image[:, ::-1]), name)[1])
    if 2 * mirrored >= count:
        return f", but {mirrored} mirrored: it is seen from the back, or the camera mirrors"
    for other in _COMMON_DICTIONARIES:
        if 2 * (seen := len(_read(image, f"DICT_{other}")[1])) >= count:
            return f", but {seen} of DICT_{other}"
    return ""


def _to_border(corners: Array, image: Image) -> Array:
    """Return the distances (ny, nx) of corners from the image's border, px; NaN where they are."""
    height, width = image.shape
    u, v = corners
    return np.minimum.reduce([u, v, width - u, height - v])
