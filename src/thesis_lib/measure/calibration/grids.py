"""Where the board's corners are in an image, to a fraction of a pixel, by OpenCV.

Module :mod:`~thesis_lib.measure.calibration.corners` makes them exact.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from thesis_lib.arrays import Array, Image, Mask
from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision.lens import HALF

_CLEAR = 4.0  # least distance of a corner from the image's border, px
_FEWEST = 12  # corners of a board with marks that must be seen, or half of a small one's
_SIZES = (50, 100, 250, 1000)  # of OpenCV's dictionaries, which begin with the same marks
_COMMON = ("4X4_250", "5X5_250", "6X6_250", "7X7_250", "ARUCO_ORIGINAL", "APRILTAG_36H11")


class BoardNotFound(ValueError):  # noqa: N818 - no mistake, an image without a board
    """An image in which no trustworthy board is seen; the message says why."""


def grid_of(image: Image, board: Board) -> Array:
    """Inner corners of a board.

    Parameters
    ----------
    image : ndarray of uint8, shape (h, w)
        Grey levels.
    board : Board
        The board to look for.

    Returns
    -------
    ndarray, shape (2, rows − 1, columns − 1)
        Pixels from the image's top-left corner, with x and y as seen from the printed side; NaN
        where a corner of a board with marks is not seen. A checkerboard is seen as a whole.

    Raises
    ------
    BoardNotFound
        If the image shows no board, or too little of it.
    """
    return _marked(image, board) if board.mark else _checkered(image, board)


def _checkered(image: Image, board: Board) -> Array:
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    # No fast check: it gives up on most views that are steep or have a narrow margin.
    found, raw = cv2.findChessboardCorners(image, board.shape, flags=flags)
    if not found:
        raise BoardNotFound("no checkerboard seen")
    nx, ny = board.shape
    corners = np.asarray(raw, float).reshape(ny, nx, 2).transpose(2, 0, 1) + HALF
    nearest = float(_to_border(corners, image).min())
    if nearest < _CLEAR:
        raise BoardNotFound(f"a corner is {nearest:.1f} px from the border, needs {_CLEAR:.0f}")
    (xu, xv), (yu, yv) = (np.gradient(corners, axis=axis).mean((1, 2)) for axis in (2, 1))
    return corners if xu * yv - xv * yu < 0 else corners[:, ::-1]  # y is up where x is right


def _marked(image: Image, board: Board) -> Array:
    """The corners between marks that are seen; which corner is which the marks tell."""
    count = board.columns * board.rows // 2
    bits = board.dictionary.rpartition("_")[0]
    size = next(size for size in _SIZES if size >= count)  # of fewer marks more errors are mended
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
            corners[np.ravel(which)] = np.reshape(places, (-1, 2)) + HALF
            break
    corners = corners.reshape(ny, nx, 2).transpose(2, 0, 1)[:, ::-1]  # OpenCV's rows run down
    corners[:, _to_border(corners, image) < _CLEAR] = np.nan
    corners[:, _off_plane(corners, board)] = np.nan
    seen, least = int(np.isfinite(corners[0]).sum()), min(_FEWEST, nx * ny // 2)
    if seen < least:
        others = _others(image, count) if 2 * len(marks) < count else ""
        raise BoardNotFound(
            f"{len(marks)} marks of {board.dictionary} seen{others}; {seen} corners between them "
            f"as on a board of {nx + 1} × {ny + 1} tiles, needs {least}"
        )
    return corners


def _off_plane(corners: Array, board: Board) -> Mask:
    """Which corners (2, ny, nx) are not where most are on a plane; all, if most are not."""
    off = np.isfinite(corners[0])
    if np.count_nonzero(off) > 4:
        plane = board.corners[:2].reshape(corners.shape)[:, off]
        _, right = cv2.findHomography(corners[:, off].T, plane.T, cv2.RANSAC, board.tile / 4)
        if 2 * np.count_nonzero(right) > right.size:
            off[off] = np.ravel(right) == 0
    return off


def _read(image: Image, name: str) -> tuple[cv2.aruco.Dictionary, Any, Any]:
    """A dictionary, the corners of the marks of it that are seen, and their numbers."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    parameters = cv2.aruco.DetectorParameters()
    parameters.errorCorrectionRate = 1.0  # of what tells marks apart; a false one fits no board
    marks, numbers, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    return dictionary, marks, numbers


def _others(image: Image, count: int) -> str:
    """Which marks are seen instead on a board that has so many."""
    for name in _COMMON:
        marks = _read(image, f"DICT_{name}")[1]
        if 2 * len(marks) >= count:  # fewer may be by chance
            return f", but {len(marks)} of DICT_{name}"
    return ""


def _to_border(corners: Array, image: Image) -> Array:
    """Distances (ny, nx) of corners from the image's border, px; NaN where they are."""
    height, width = image.shape
    u, v = corners
    return np.minimum.reduce([u, v, width - u, height - v])
