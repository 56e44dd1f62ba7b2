"""Each camera's calibration by itself, from board images (Appendix D).

Zhang's method (Zhang 2000) finds a camera's intrinsics, its distortion and the board's pose in
every shot. Which of the corners that look alike is the first is each image's own idea; module
:mod:`~thesis_lib.measure.calibration.rig` brings the images of several cameras together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from thesis_lib.arrays import Array, IntArray
from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision.lens import HALF_PIXEL, Camera

_LEAST_SHOTS = 3  # two homographies already determine K without skew, but leave nothing to check
_LEAST_TILT = np.radians(4.0)  # between the two boards that differ most
# Largest standard deviation of a focal length over it: real boards leave 0.0006 (13 or 29 images),
# a webcam 0.007, five images of a bent board 0.008.
_LEAST_PRECISION = 0.05
_LITERAL_TILES = (5, 7)  # squares used in the thesis, Appendix D


class CalibrationError(ValueError):
    """Shots that do not determine a camera or a rig; the message says which and why."""


@dataclass(frozen=True)
class Calibration:
    """One camera, calibrated by itself."""

    name: str  #: The camera's name
    size: tuple[int, int]  #: Width and height of the sensor in px
    K: Array  #: Intrinsic matrix in px, shape (3, 3)
    distortion: Array  #: Coefficients k₁, k₂, p₁, p₂, k₃, the last always 0, shape (5,)
    #: The board's pose in the camera in each shot: rotation (3, 3) from board to camera and the
    #: board's centre (3,) in m; None where the board was not found
    rotations: tuple[Array | None, ...]
    translations: tuple[Array | None, ...]
    rms: float  #: Root mean square residual per coordinate, px
    deviations: Array  #: Standard deviations of f_x, f_y, c_x and c_y in px, shape (4,)

    def camera(self, shot: int = 0) -> Camera:
        """Return the camera in the board's frame of one image; at the origin without it."""
        R, t = self.rotations[shot], self.translations[shot]
        if R is None or t is None:
            R, t = np.eye(3), np.zeros(3)
        return Camera(self.name, self.K, self.distortion, R, -R.T @ t, self.size)


def calibrate_camera(
    shots: Sequence[Array | None],
    board: Board,
    size: tuple[int, int],
    distortion: bool = True,
    name: str = "camera",
) -> Calibration:
    """Calibrate one camera and its board poses by Zhang's method (Appendix D, step 4).

    Parameters
    ----------
    shots : sequence of ndarray, shape (2, corners), or None
        Corners in px, None where the board was not found, NaN where a corner is not seen.
    board : Board
        The board.
    size : tuple of int
        Width and height of the sensor in px.
    distortion : bool
        Whether k₁, k₂, p₁, p₂ are estimated, else they are 0.
    name : str
        The camera's name, for messages too.

    Raises
    ------
    CalibrationError
        If fewer than three shots show the board, if the boards are parallel to each other, or if
        the board images leave a focal length uncertain by more than 5 %.
    """
    used = [i for i, uv in enumerate(shots) if uv is not None and np.isfinite(uv).any()]
    if len(used) < _LEAST_SHOTS:
        raise CalibrationError(
            f"{name}: {len(used)} of {len(shots)} board images show the board, needs {_LEAST_SHOTS}"
        )
    images = [np.asarray(shots[i], float) for i in used]
    parts = [np.isfinite(uv).all(axis=0) for uv in images]
    images = [uv[:, part] for uv, part in zip(images, parts, strict=True)]
    seen = [board.corners[:, part] for part in parts]
    spread = _largest_tilt(seen, images, size)
    if spread < _LEAST_TILT:
        raise CalibrationError(
            f"{name}: the boards are parallel to within {np.degrees(spread):.1f}°, "
            f"needs {np.degrees(_LEAST_TILT):.0f}° to determine a focal length"
        )
    flags = cv2.CALIB_FIX_K3
    if not distortion:
        flags |= cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST
    objects = [X.T.astype(np.float32) for X in seen]
    pixels = [(uv - HALF_PIXEL).T.astype(np.float32) for uv in images]
    rms, K, k, turns, moves, deviations, _, _ = cv2.calibrateCameraExtended(
        objects, pixels, size, np.eye(3), np.zeros(5), flags=flags
    )
    ours = np.asarray(K, float) + HALF_PIXEL * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
    sigma = np.ravel(np.asarray(deviations, float))[:4]
    relative = float(np.max(sigma[:2] / np.diag(ours)[:2]))
    if not 0 <= relative <= _LEAST_PRECISION:
        raise CalibrationError(
            f"{name}: the board images leave the focal length uncertain by {relative:.0%}, "
            f"allowed {_LEAST_PRECISION:.0%}"
        )
    rotations: list[Array | None] = [None] * len(shots)
    translations: list[Array | None] = [None] * len(shots)
    for shot, turn, move in zip(used, turns, moves, strict=True):
        rotations[shot] = np.asarray(cv2.Rodrigues(turn)[0], float)
        translations[shot] = np.ravel(move)
    # OpenCV's rms is per point: of the distance, not of its two coordinates.
    return Calibration(
        name,
        size,
        ours,
        np.ravel(np.asarray(k, float))[:5],
        tuple(rotations),
        tuple(translations),
        float(rms / np.sqrt(2)),
        sigma,
    )


def central_corners(board: Board) -> IntArray:
    """Return indices of the corners of the central 5 × 7 squares, the part the thesis used.

    Raises
    ------
    CalibrationError
        If the board has fewer corners.
    """
    nx, ny = board.shape
    mx, my = _LITERAL_TILES[0] + 1, _LITERAL_TILES[1] + 1
    if nx < mx or ny < my:
        raise CalibrationError(f"board: given {nx} by {ny} corners, needs {mx} by {my} or more")
    index = np.arange(nx * ny).reshape(ny, nx)
    left, top = (nx - mx) // 2, (ny - my) // 2
    return index[top : top + my, left : left + mx].ravel()


def _largest_tilt(points: Sequence[Array], images: Sequence[Array], size: tuple[int, int]) -> float:
    """Return the largest angle between the normals of the boards, rad.

    A board's vanishing line in the image, the last row of H⁻¹, is its normal seen through K. How
    much the normals differ hardly depends on K, so a focal length of the image's width will do.
    """
    K = np.array([[size[0], 0, size[0] / 2], [0, size[0], size[1] / 2], [0, 0, 1.0]])
    homographies = [
        cv2.findHomography(X[:2].T, uv.T)[0] for X, uv in zip(points, images, strict=True)
    ]
    normals = np.array([K.T @ np.linalg.inv(H)[2] for H in homographies])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    across = np.linalg.norm(np.cross(normals[:, None], normals[None]), axis=-1)
    return float(np.arcsin(np.clip(across.max(), 0, 1)))
