"""The cameras of a rig, adjusted together to images of a board.

A square board of 9 × 9 tiles looks the same after quarter turns, and from behind too when it is
printed on both faces, so each image has its own idea of which corner is the first. The cameras do
not move between the shots: :func:`unify_corners` chooses, per image, the one symmetry under
which they stand still. Where the operator of Appendix D, step 3, clicks the same origin in every
image, this is what stands in for the operator. A board with marks has no symmetry.
"""

from __future__ import annotations

import contextlib
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, IntArray
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust_bundle, planar_pose
from thesis_lib.measure.calibration.corners import BoardNotFound, find_corners
from thesis_lib.measure.calibration.zhang import Calibration, CalibrationError, calibrate_camera
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.recordings.manifest import shot_paths
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.media import read_png
from thesis_lib.studies.workers import map_in_pairs
from thesis_lib.vision.lens import Camera

Pose = tuple[Array, Array]

_MAX_FIT_TILES = 0.2  # most rms distance between one board seen by two cameras, over a tile
_MIN_DISTINCT_RATIO = 2.0  # how many times worse the next best rig has to be
_MOST_OFF = 1 / 3  # share of the shared poses from which on it is not they that are wrong


def unify_corners(
    calibrations: Sequence[Calibration],
    shots: Sequence[Sequence[Array | None]],
    board: Board,
    two_sided: bool = False,
) -> tuple[Array, dict[int, float]]:
    """Order corners alike for all cameras, which do not move between board images.

    In every shot the first camera that sees the board decides on its axes. A rig of cameras is
    tried for each way in which two images can belong together; the one that fits all shots holds.

    Parameters
    ----------
    calibrations : sequence of Calibration
        One per camera.
    shots : sequence of sequences of ndarray, shape (2, corners), or None
        The corners that the calibrations were made from, by camera and shot.
    board : Board
        The board.
    two_sided : bool
        Whether the pattern is on both faces with corners behind corners, so that cameras may see
        the board from either side.

    Returns
    -------
    ndarray, shape (cameras, shots, 2, corners)
        Corners in px in the order of ``board.corners``, NaN where the board was not found, and in
        poses that were left out.
    dict of int to float
        Poses that were left out, as the board or a camera moved between their images, and by how
        much these are then off the rig of the others, m.

    Raises
    ------
    CalibrationError
        If two cameras share too few images to distinguish the symmetries, or more than a third
        of the poses that several cameras see fit no rig.
    """
    symmetries = _list_symmetries(board, two_sided)
    points = [_place_boards(c, board, symmetries) for c in calibrations]
    rig = _chain_cameras(calibrations, points)
    result = np.full((len(shots), len(shots[0]), 2, board.corners.shape[1]), np.nan)
    orders = [_reorder_corners(board, S) for S in symmetries]
    left_out: dict[int, float] = {}
    for shot in range(result.shape[1]):
        seen = [c for c in range(len(shots)) if points[c][shot] is not None]
        for camera in seen:
            first = _move_points(rig[seen[0]], points[seen[0]][shot])[0]
            off = _rms_distance(_move_points(rig[camera], points[camera][shot]) - first)
            choice = int(np.argmin(off))
            if off[choice] > _MAX_FIT_TILES * board.tile:
                left_out[shot] = max(left_out.get(shot, 0.0), float(off[choice]))
            uv = shots[camera][shot]
            assert uv is not None
            result[camera, shot] = uv[:, orders[choice]]
    shared = sum(sum(row[shot] is not None for row in points) > 1 for shot in range(len(shots[0])))
    if len(left_out) > _MOST_OFF * shared:
        raise CalibrationError(
            f"{len(left_out)} of {shared} poses are up to {1e3 * max(left_out.values()):.1f} mm "
            f"off the rig of the others, allowed {1e3 * _MAX_FIT_TILES * board.tile:.1f} mm: do "
            "the k-th images of all cameras show one pose, and is board.two_sided right?"
        )
    result[:, list(left_out)] = np.nan
    return result, left_out


def _list_symmetries(board: Board, two_sided: bool) -> Array:
    """Return rotations (symmetries, 3, 3) to corners that look alike, the identity first."""
    if board.mark:
        return np.eye(3)[None]
    half, flip = np.diag([-1.0, -1.0, 1.0]), np.diag([1.0, -1.0, -1.0])
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = np.array([np.eye(3), half])
    if board.columns == board.rows:
        turns = np.concatenate([turns, turns @ quarter])
    return np.concatenate([turns, turns @ flip]) if two_sided else turns


def _reorder_corners(board: Board, symmetry: Array) -> IntArray:
    """Return the index to which each of the board's corners goes under a symmetry."""
    X = board.corners
    apart = np.linalg.norm((symmetry @ X)[:, :, None] - X[:, None], axis=0)
    return np.argmin(apart, axis=1)


def _place_boards(calibration: Calibration, board: Board, symmetries: Array) -> list[Array | None]:
    """Return the board's corners in the camera, (symmetries, 3, corners) in m, per shot.

    The side that the camera sees is half a thickness before the middle, about which a board that
    is turned over turns.
    """
    middle = np.array([[0.0], [0.0], [board.thickness / 2]])
    X = symmetries @ (board.corners + middle) - middle
    return [
        None if R is None or t is None else R @ X + t[:, None]
        for R, t in zip(calibration.rotations, calibration.translations, strict=True)
    ]


def _rms_distance(differences: Array) -> Array:
    """Return the root mean square distance over the corners of (..., 3, corners)."""
    return np.sqrt(np.mean(np.sum(differences**2, axis=-2), axis=-1))


def _move_points(pose: Pose, points: Array | None) -> Array:
    """Return the points (..., 3, n) of a camera in the rig's frame."""
    R, t = pose
    assert points is not None
    return R @ points + t[:, None]


def _chain_cameras(
    calibrations: Sequence[Calibration], points: Sequence[list[Array | None]]
) -> list[Pose]:
    """Return every camera's pose in the first one's frame, from pairs sharing most images."""
    n = len(calibrations)
    seen = [{s for s, p in enumerate(images) if p is not None} for images in points]
    rig: dict[int, Pose] = {0: (np.eye(3), np.zeros(3))}
    while len(rig) < n:
        pairs = [(i, j) for i in rig for j in range(n) if j not in rig]
        i, j = max(pairs, key=lambda pair: len(seen[pair[0]] & seen[pair[1]]))
        shared = sorted(seen[i] & seen[j])
        if len(shared) < 2:
            raise CalibrationError(
                f"{calibrations[j].name}: shares {len(shared)} board images with "
                f"{calibrations[i].name}, needs 2 to distinguish the board's symmetries"
            )
        source, target = (np.array([points[k][s] for s in shared]) for k in (j, i))
        pose, distinct = _fit_relative_pose(source, target[:, 0])
        if not distinct:
            raise CalibrationError(
                f"{calibrations[j].name}: its board images with {calibrations[i].name} do not "
                "distinguish the board's symmetries"
            )
        R, t = rig[i]
        rig[j] = R @ pose[0], R @ pose[1] + t
    return [rig[i] for i in range(n)]


def _fit_relative_pose(source: Array, target: Array) -> tuple[Pose, bool]:
    """Return the pose that takes points to their targets in all shots, and whether only one does.

    The points (shots, symmetries, 3, n) count under whichever symmetry brings them nearest to the
    targets (shots, 3, n). A shot can miss by no more than rigs differ, so that a bad one does not
    decide; which one it is shows later.
    """
    size = np.linalg.norm(target[0, :, 0] - target[0, :, -1]) / 4
    trials = [_fit_rigid_motion(p, q) for ps, q in zip(source, target, strict=True) for p in ps]
    missed = [
        _rms_distance(_move_points(pose, source) - target[:, None]).min(axis=1) for pose in trials
    ]
    scores = np.array([np.mean(np.minimum(miss, size)) for miss in missed])
    best = trials[int(np.argmin(scores))]
    X = source[0, 0]
    other = np.array(
        [_rms_distance(_move_points(pose, X) - _move_points(best, X)) > size for pose in trials]
    )
    rival = scores[other].min(initial=np.inf)
    return best, bool(rival > _MIN_DISTINCT_RATIO * scores.min() and rival > 1e-9)


def _fit_rigid_motion(points: Array, target: Array) -> Pose:
    """Return the rotation and translation that take points (3, n) to their targets (Kabsch)."""
    a, b = points.mean(axis=1), target.mean(axis=1)
    U, _, Vt = np.linalg.svd((target - b[:, None]) @ (points - a[:, None]).T)
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return R, b - R @ a


# Rms residual of all cameras together over that of each alone, from which on the board moved
# between their images: 1.0 on rendered and 1.1 on photographed boards, 10 on a board held by hand
# before cameras that are up to 20 ms out of step.
MAX_CONTRADICTION = 3.0


@contextlib.contextmanager
def single_threaded_opencv() -> Iterator[None]:
    """Run OpenCV with one thread, for the same bits in every run; cameras run in parallel."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


@single_threaded_opencv()
def adjust_cameras(
    manifest: Manifest,
    folder: Path,
    tick: Callable[[], object] = lambda: None,
    lenses: Sequence[Camera] = (),
) -> tuple[Array, list[str], list[Calibration], Adjustment]:
    """Adjust all cameras together to the board's corners; call `tick` once per image.

    With `lenses` of the cameras these are kept, and only their places are found.

    Returns
    -------
    corners : ndarray, shape (cameras, shots, 2, corners)
        In px, in one order; NaN where the board was not found.
    lost : list of str
        Which shots were not used, and why.
    single : list of Calibration
        Zhang's method, camera by camera, with all corners.
    full : Adjustment
        All corners, intrinsics and distortion adjusted, too; but not if the cameras contradict each
        other by more than :data:`MAX_CONTRADICTION`: lenses then stay as of each camera alone. Its
        residuals are of all poses, its boards those of the poses that were used.

    Raises
    ------
    CalibrationError
        If the shots do not determine the cameras.
    MediaError
        If an image cannot be read.
    """
    board = manifest.board.board

    def read_board(path: Path | None) -> Array | BoardNotFound | None:
        try:
            return None if path is None else find_corners(read_png(path), board)
        except BoardNotFound as error:
            return error
        finally:
            tick()

    paths = [shot_paths(camera, folder) for camera in manifest.cameras]
    corners_in = iter(map_in_pairs(read_board, [path for row in paths for path in row]))
    found = [[(path, next(corners_in)) for path in row] for row in paths]
    shots = [[None if isinstance(uv, BoardNotFound) else uv for _, uv in row] for row in found]
    refused = [
        {path.name: str(uv) for path, uv in row if path and isinstance(uv, BoardNotFound)}
        for row in found
    ]
    lost = [
        f"{camera.name}, {file}: {why}"
        for camera, reasons in zip(manifest.cameras, refused, strict=True)
        for file, why in reasons.items()
    ]
    single = [pose_camera(row, board, lens) for row, lens in zip(shots, lenses, strict=False)]
    for camera, seen_by, reasons in zip(manifest.cameras, shots, refused, strict=True):
        if lenses:
            break
        try:
            single.append(calibrate_camera(seen_by, board, camera.size, True, camera.name))
        except CalibrationError as error:
            raise CalibrationError(f"{error}{_describe_refusals(reasons, manifest)}") from None
    corners, moved = unify_corners(single, shots, board, manifest.board.two_sided)
    seen = np.isfinite(corners).any(axis=(0, 2, 3))
    for pose in np.flatnonzero(~seen):
        off = moved.get(int(pose))
        why = f"{1e3 * off:.1f} mm off the rig of the others" if off else "no camera sees the board"
        files = ", ".join(path.name for row in paths if (path := row[pose]))
        lost.append(f"pose {pose + 1} ({files or 'no image'}): {why}; it is left out")
    cameras = [one.camera() for one in single]
    used = corners[:, seen]
    full = adjust_bundle(used, board.corners_in_images(used), cameras, not lenses, not lenses)
    if (
        not lenses
        and contradiction_ratio(full.rms, [one.rms for one in single]) > MAX_CONTRADICTION
    ):
        full = adjust_bundle(
            used, board.corners_in_images(used), cameras, intrinsics=False, distortion=False
        )
    residuals = np.full(corners.shape, np.nan)
    residuals[:, seen] = full.residuals
    return corners, lost, single, replace(full, residuals=residuals)


def contradiction_ratio(together: float, alone: Iterable[float]) -> float:
    """Return the rms residual of cameras adjusted together over that of each camera alone."""
    return together / float(np.sqrt(np.mean(np.square(list(alone)))))


def _describe_refusals(refused: Mapping[str, str], manifest: Manifest) -> str:
    """Name the commonest reason for which a camera's images were refused, with its count."""
    if not refused:
        return ""
    kinds = {file: re.sub(r"[0-9.]+", "", why) for file, why in refused.items()}
    kind, count = Counter(kinds.values()).most_common(1)[0]
    first = next(file for file, other in kinds.items() if other == kind)
    tiles = f"{manifest.board.kind} of {manifest.board.columns} × {manifest.board.rows} tiles"
    return (
        f" ({count} of {len(refused)} refused images for one reason, as {first}: {refused[first]}; "
        f"is the board a {tiles}?)"
    )


def pose_camera(shots: Sequence[Array | None], board: Board, lens: Camera) -> Calibration:
    """Return a camera with a known lens, and the board's pose in each of its calibration images."""
    poses = [(None, None) if uv is None else planar_pose(lens, board.corners, uv) for uv in shots]
    rotations, translations = zip(*poses, strict=True)
    size, unknown = lens.size, np.full(4, np.nan)
    return Calibration(
        lens.name, size, lens.K, lens.distortion, rotations, translations, np.nan, unknown
    )


def cameras_in(calibration: xr.Dataset) -> list[Camera]:
    """Return the cameras of one calibration."""
    return [
        Camera(
            str(name),
            calibration["K"].values[i],
            calibration["distortion"].values[i],
            calibration["R_camera_world"].values[i],
            calibration["centre"].values[i],
            (int(calibration["size"].values[i, 0]), int(calibration["size"].values[i, 1])),
        )
        for i, name in enumerate(calibration["camera"].values)
    ]
