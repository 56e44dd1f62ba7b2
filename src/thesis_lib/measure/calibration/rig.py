"""Calibration of a camera rig from board images: each camera, then all together (Appendix D).

Zhang's method (Zhang 2000) estimates a camera's intrinsics, its distortion and the board's pose in
every image.

A square board of 9 × 9 tiles looks the same after quarter turns, and also from behind if it is
printed on both faces. The first corner is therefore ambiguous in each image. The cameras do not
move between board poses, so :func:`unify_corners` chooses, for each image, the one symmetry for
which the cameras are at rest. This replaces the operator of Appendix D, step 3, who clicks the same
origin in every image. A board with marks has no symmetry.
"""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, IntArray, Mask
from thesis_lib.measure.calibration import bundle_adjustment as bundle
from thesis_lib.measure.calibration.bundle_adjustment import CalibrationError
from thesis_lib.measure.calibration.corners import BoardNotFound, find_corners
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.recordings.manifest import Manifest, image_paths
from thesis_lib.measure.recordings.media import read_png
from thesis_lib.studies.workers import map_in_two_threads
from thesis_lib.vision.pinhole import HALF_PIXEL, Camera

# Two homographies already determine K without skew, but leave nothing to check
_MIN_BOARD_IMAGES = 3
_MIN_TILT_RAD = np.radians(4.0)  # least angle between the two most different board poses
# Largest standard deviation of a focal length over its value: real boards have 0.0006 (13 or 29
# images), a webcam 0.007, five images of a bent board 0.008.
_MAX_FOCAL_STD = 0.05
_THESIS_CORNERS = (6, 8)  # inner corners of the squares used in the thesis, Appendix D
_MAX_FIT_TILES = 0.2  # largest rms distance between a board's poses by two cameras, in tiles
_MIN_DISTINCT_RATIO = 2.0  # least ratio of the second-best rig's error to the best rig's
_ORDER_QUESTION = "do the k-th images of all cameras show one pose, and is board.two_sided right?"
_MAX_OUTLIER_SHARE = 1 / 3  # share of the shared poses above which the rig is wrong, not the poses
# Rms residual of the joint adjustment over that of each camera alone, above which the board moved
# between simultaneous images: 1.0 on rendered and 1.1 on photographed boards, 10 on a board held by
# hand in front of cameras that are up to 20 ms out of step.
MAX_CONTRADICTION = 3.0


@dataclass(frozen=True)
class Calibration:
    """One camera, calibrated separately."""

    lens: Camera  #: Its intrinsics and distortion, with k₃ = 0; the pose is not used
    rotations: Array  #: From each image's board to the camera, (poses, 3, 3); NaN without a board
    translations: Array  #: The board's centre in the camera frame, m, (poses, 3); NaN likewise
    rms: float  #: Root mean square residual per coordinate, px
    deviations: Array  #: Standard deviations of f_x, f_y, c_x and c_y in px, shape (4,)


def calibrate_camera(
    shots: Sequence[Array | None], board: Board, size: tuple[int, int], name: str = "camera"
) -> Calibration:
    """Calibrate one camera and its board poses by Zhang's method (Appendix D, step 4).

    Parameters
    ----------
    shots : sequence of ndarray, shape (2, corners), or None
        Corners in px; None where the board was not found, NaN where a corner is not visible.
    board : Board
    size : tuple of int
        Width and height of the sensor in px.
    name : str
        The camera's name, also for messages.

    Raises
    ------
    CalibrationError
        If fewer than three images show the board, if the boards are parallel to each other, or if
        the standard deviation of a focal length exceeds 5 %.
    """
    used = [i for i, uv in enumerate(shots) if uv is not None and np.isfinite(uv).any()]
    if len(used) < _MIN_BOARD_IMAGES:
        raise CalibrationError(
            f"{name}: {len(used)} of {len(shots)} board images show the board, needs "
            f"{_MIN_BOARD_IMAGES}"
        )
    every = [np.asarray(shots[i], float) for i in used]
    parts = [np.isfinite(uv).all(axis=0) for uv in every]
    images = [uv[:, part] for uv, part in zip(every, parts, strict=True)]
    seen = [board.corners[:, part] for part in parts]
    spread = _largest_tilt(seen, images, size)
    if spread < _MIN_TILT_RAD:
        raise CalibrationError(
            f"{name}: the boards are parallel to within {np.degrees(spread):.1f}°, "
            f"needs {np.degrees(_MIN_TILT_RAD):.0f}° to determine a focal length"
        )
    objects = [X.T.astype(np.float32) for X in seen]
    pixels = [(uv - HALF_PIXEL).T.astype(np.float32) for uv in images]
    rms, K, k, turns, moves, deviations, _, _ = cv2.calibrateCameraExtended(
        objects, pixels, size, np.eye(3), np.zeros(5), flags=cv2.CALIB_FIX_K3
    )
    ours = np.array(K, float)
    ours[:2, 2] += HALF_PIXEL
    sigma = np.ravel(np.asarray(deviations, float))[:4]
    relative = float(np.max(sigma[:2] / np.diag(ours)[:2]))
    if not 0 <= relative <= _MAX_FOCAL_STD:
        raise CalibrationError(
            f"{name}: the board images leave the focal length uncertain by {relative:.0%}, "
            f"allowed {_MAX_FOCAL_STD:.0%}"
        )
    rotations, translations = np.full((len(shots), 3, 3), np.nan), np.full((len(shots), 3), np.nan)
    rotations[used] = [cv2.Rodrigues(turn)[0] for turn in turns]
    translations[used] = np.reshape(moves, (-1, 3))
    distortion = np.ravel(np.asarray(k, float))[:5]
    lens = Camera(name, ours, distortion, np.eye(3), np.zeros(3), size)
    # OpenCV's rms is that of the distance of points, not of their coordinates.
    return Calibration(lens, rotations, translations, float(rms / np.sqrt(2)), sigma)


def central_corners(board: Board) -> IntArray:
    """Return the indices of the corners of the central 5 × 7 squares, the part the thesis used."""
    nx, ny = board.shape
    mx, my = _THESIS_CORNERS
    index = np.arange(nx * ny).reshape(ny, nx)
    left, top = (nx - mx) // 2, (ny - my) // 2
    return index[top : top + my, left : left + mx].ravel()


def _largest_tilt(points: Sequence[Array], images: Sequence[Array], size: tuple[int, int]) -> float:
    """Return the largest angle between the normals of the boards, rad.

    A board's vanishing line in the image, the last row of H⁻¹, is its normal seen through K. The
    angles hardly depend on K, so a focal length equal to the image's width is accurate enough.
    """
    K = np.array([[size[0], 0, size[0] / 2], [0, size[0], size[1] / 2], [0, 0, 1.0]])
    homographies = [
        cv2.findHomography(X[:2].T, uv.T)[0] for X, uv in zip(points, images, strict=True)
    ]
    normals = np.array([K.T @ np.linalg.inv(H)[2] for H in homographies])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    across = np.linalg.norm(np.cross(normals[:, None], normals[None]), axis=-1)
    return float(np.arcsin(np.clip(across.max(), 0, 1)))


def unify_corners(
    calibrations: Sequence[Calibration],
    shots: Sequence[Sequence[Array | None]],
    board: Board,
    two_sided: bool = False,
) -> tuple[Array, dict[int, float]]:
    """Put the corners in the same order for all cameras, which do not move between board images.

    In every pose the first camera that sees the board defines its axes. A rig is computed for each
    combination of symmetries of two images; the one that fits all poses is used.

    Parameters
    ----------
    calibrations : sequence of Calibration
        One per camera.
    shots : sequence of sequences of ndarray, shape (2, corners), or None
        The corners from which the cameras were calibrated, by camera and board pose.
    board : Board
    two_sided : bool
        Whether the pattern is on both faces with corners behind corners.

    Returns
    -------
    ndarray, shape (cameras, poses, 2, corners)
        Corners in px in the order of ``board.corners``; NaN where the board was not found, and in
        poses that were left out.
    dict of int to float
        Poses that were left out, because the board or a camera moved between their images, and
        their distance from the rig of the others, m.

    Raises
    ------
    CalibrationError
        If two cameras share too few images to distinguish the symmetries, or more than a third
        of the poses that several cameras see fit no rig.
    """
    symmetries = _list_symmetries(board, two_sided)
    X = np.vstack([board.corners, np.ones_like(board.corners[:1])])
    poses = np.zeros((len(calibrations), len(shots[0]), 4, 4))
    poses[..., :3, :3] = [one.rotations for one in calibrations]
    poses[..., :3, 3] = [one.translations for one in calibrations]
    poses[..., 3, 3] = 1
    boards = poses[:, :, None] @ symmetries
    seen = np.isfinite(poses[..., 0, 0])
    rig = _chain_cameras([c.lens.name for c in calibrations], boards, seen, X)
    result = np.full((*seen.shape, *X[:2].shape), np.nan)
    # Index of the corner to which a symmetry maps each corner
    apart = np.linalg.norm((symmetries @ X)[..., None] - X[:, None], axis=1)
    orders = np.argmin(apart, axis=2)
    left_out: dict[int, float] = {}
    for shot, camera in np.argwhere(seen.T).tolist():
        one = int(np.argmax(seen[:, shot]))  # the first camera
        first = rig[one] @ boards[one, shot, 0] @ X
        off = _rms_distance(rig[camera] @ boards[camera, shot] @ X - first)
        choice = int(np.argmin(off))
        if off[choice] > _MAX_FIT_TILES * board.tile:
            left_out[shot] = max(left_out.get(shot, 0.0), float(off[choice]))
        result[camera, shot] = np.asarray(shots[camera][shot])[:, orders[choice]]
    shared = np.count_nonzero(seen.sum(axis=0) > 1)
    if len(left_out) > _MAX_OUTLIER_SHARE * shared:
        raise CalibrationError(
            f"{len(left_out)} of {shared} poses are up to {1e3 * max(left_out.values()):.1f} mm "
            f"off the rig of the others, allowed {1e3 * _MAX_FIT_TILES * board.tile:.1f} mm: "
            f"{_ORDER_QUESTION}"
        )
    result[:, list(left_out)] = np.nan
    return result, left_out


def _list_symmetries(board: Board, two_sided: bool) -> Array:
    """Return the board's symmetries, rigid motions (symmetries, 4, 4), the identity first.

    Turning the board over rotates it about an axis in its middle plane, half a thickness behind the
    visible side.
    """
    half, flip = np.diag([-1.0, -1.0, 1.0, 1.0]), np.diag([1.0, -1.0, -1.0, 1.0])
    flip[2, 3] = -board.thickness
    quarter = np.eye(4)
    quarter[:2, :2] = [[0, -1], [1, 0]]
    turns = np.array([np.eye(4), half])
    if board.columns == board.rows:
        turns = np.concatenate([turns, turns @ quarter])
    if two_sided:
        turns = np.concatenate([turns, turns @ flip])
    return turns[:1] if board.mark else turns


def _rms_distance(differences: Array) -> Array:
    """Return the rms over the corners of the lengths of `differences` (..., 4, corners)."""
    return np.sqrt(np.mean(np.sum(differences**2, axis=-2), axis=-1))


def _chain_cameras(names: Sequence[str], boards: Array, seen: Mask, X: Array) -> dict[int, Array]:
    """Return the motion (4, 4) from each camera to the first, by pairs that share most images.

    `boards` (cameras, poses, symmetries, 4, 4) are the motions of the corners X (4, n) into the
    frame of the camera, where `seen` (cameras, poses).
    """
    rig = {0: np.eye(4)}
    while len(rig) < len(names):
        pairs = [(i, j) for i in rig for j in range(len(names)) if j not in rig]
        i, j = max(pairs, key=lambda pair: np.count_nonzero(seen[pair[0]] & seen[pair[1]]))
        shared, motion = seen[i] & seen[j], None
        if (count := np.count_nonzero(shared)) > 1:
            motion = _fit_relative_motion(boards[j, shared], boards[i, shared, 0], X)
        if motion is None:
            why = "needs 2 or more that distinguish the board's symmetries"
            if count > 2:  # more than two that only symmetries leave ambiguous are rare
                why = f"which fit no position of it: {_ORDER_QUESTION}"
            raise CalibrationError(
                f"{names[j]}: shares {count} board images with {names[i]}, {why}"
            )
        rig[j] = rig[i] @ motion
    return rig


def _fit_relative_motion(boards: Array, others: Array, X: Array) -> Array | None:
    """Return the motion of `boards` onto `others` (poses, 4, 4) in all poses, or None if ambiguous.

    Each of the boards (poses, symmetries, 4, 4) is matched under its nearest symmetry. The error
    of a pose is limited to the difference between rigs, so that outliers do not decide; they are
    identified later.
    """
    source, target = boards @ X, others @ X
    size = np.linalg.norm(target[0, :, 0] - target[0, :, -1]) / 4
    trials = (others[:, None] @ np.linalg.inv(boards)).reshape(-1, 4, 4)
    missed = [_rms_distance(one @ source - target[:, None]).min(axis=1) for one in trials]
    scores = np.mean(np.minimum(missed, size), axis=1)
    best = trials[int(np.argmin(scores))]
    other = _rms_distance((trials - best) @ source[0, 0]) > size
    rival = scores[other].min(initial=np.inf)
    return best if rival > max(_MIN_DISTINCT_RATIO * scores.min(), 1e-9) else None


@contextlib.contextmanager
def single_threaded_opencv() -> Iterator[None]:
    """Run OpenCV with one thread, for bitwise reproducible results; cameras run in parallel."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


@single_threaded_opencv()
def adjust_cameras(
    manifest: Manifest, folder: Path, tick: Callable[[], object], lenses: Sequence[Camera]
) -> tuple[Array, list[str], list[Calibration], bundle.Adjustment]:
    """Adjust all cameras together to the board's corners; call `tick` once per image.

    Given `lenses` are held fixed, and only the cameras' poses are estimated. If the cameras
    contradict each other by more than :data:`MAX_CONTRADICTION`, each lens stays as calibrated
    separately. Returns the corners (cameras, poses, 2, corners) in px, in one order and NaN where
    the board was not found; the images that were not used, with reasons; each camera's calibration;
    and the adjustment, with the residuals of all poses, and the boards of the poses that were used.
    """
    board = manifest.board.board

    def read_board(path: Path | None) -> Array | BoardNotFound | None:
        try:
            return None if path is None else find_corners(read_png(path), board)
        except BoardNotFound as error:
            return error
        finally:
            tick()

    paths = [image_paths(camera, folder) for camera in manifest.cameras]
    corners_in = iter(map_in_two_threads(read_board, [path for row in paths for path in row]))
    lost, shots, single = [], [], []
    for k, (camera, row) in enumerate(zip(manifest.cameras, paths, strict=True)):
        found = [(path, next(corners_in)) for path in row]
        refused = {path.name: str(uv) for path, uv in found if path and isinstance(uv, Exception)}
        lost += [f"{camera.name}, {file}: {why}" for file, why in refused.items()]
        shots.append(images := [None if isinstance(uv, BoardNotFound) else uv for _, uv in found])
        if lenses:
            single.append(pose_camera(images, board, lenses[k]))
            continue
        try:
            single.append(calibrate_camera(images, board, camera.size, camera.name))
        except CalibrationError as error:
            for file, why in [*refused.items()][:1]:
                tiles = f"{manifest.board.kind} of {board.columns} × {board.rows} tiles"
                note = f" ({len(refused)} are refused, as {file}: {why}; is the board a {tiles}?)"
                raise CalibrationError(f"{error}{note}") from None
            raise
    corners, moved = unify_corners(single, shots, board, manifest.board.two_sided)
    seen = np.isfinite(corners).any(axis=(0, 2, 3))
    for pose in np.flatnonzero(~seen):
        off = moved.get(int(pose))
        why = f"{1e3 * off:.1f} mm off the rig of the others" if off else "no camera sees the board"
        files = ", ".join(path.name for row in paths if (path := row[pose]))
        lost.append(f"pose {pose + 1} ({files or 'no image'}): {why}; it is left out")
    cameras = [one.lens for one in single]
    used = corners[:, seen]
    points = board.corners_in_images(used)
    full = bundle.adjust_bundle(used, points, cameras, lenses=not lenses)
    alone = float(np.sqrt(np.mean(np.square([one.rms for one in single]))))
    if not lenses and full.rms / alone > MAX_CONTRADICTION:
        full = bundle.adjust_bundle(used, points, cameras, lenses=False)
    residuals = np.full(corners.shape, np.nan)
    residuals[:, seen] = full.residuals
    return corners, lost, single, replace(full, residuals=residuals)


def pose_camera(shots: Sequence[Array | None], board: Board, lens: Camera) -> Calibration:
    """Return a camera with a known lens, and the board's pose in each of its calibration images."""
    rotations, translations = np.full((len(shots), 3, 3), np.nan), np.full((len(shots), 3), np.nan)
    for shot, uv in enumerate(shots):
        if uv is not None:
            rotations[shot], translations[shot] = bundle.planar_pose(lens, board.corners, uv)
    return Calibration(lens, rotations, translations, np.nan, np.full(4, np.nan))


def cameras_in(calibration: xr.Dataset) -> list[Camera]:
    """Return the cameras of a calibration dataset."""
    fields = ("camera", "K", "distortion", "R_camera_world", "centre", "size")
    return [
        Camera(str(name), K, distortion, R, centre, (int(width), int(height)))
        for name, K, distortion, R, centre, (width, height) in zip(
            *(calibration[field].values for field in fields), strict=True
        )
    ]
