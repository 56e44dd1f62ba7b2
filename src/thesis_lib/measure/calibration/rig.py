"""The cameras of a rig as adjusted together."""

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

from thesis_lib.arrays import Array
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust_bundle
from thesis_lib.measure.calibration.corners import find_corners
from thesis_lib.measure.calibration.grids import BoardNotFound
from thesis_lib.measure.calibration.reprojection import planar_pose
from thesis_lib.measure.calibration.symmetry import unify_corners
from thesis_lib.measure.calibration.zhang import Calibration, CalibrationError, calibrate_camera
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.recordings.manifest import shot_paths
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.media import read_png
from thesis_lib.studies.parallel import map_in_pairs
from thesis_lib.vision.lens import Camera

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
    found = iter(map_in_pairs(read_board, [path for row in paths for path in row]))
    shots, refused = list[list[Array | None]](), list[dict[str, str]]()
    for row in paths:
        seen_in = [(path, next(found)) for path in row]
        shots.append([None if isinstance(uv, BoardNotFound) else uv for _, uv in seen_in])
        refused.append(
            {p.name: str(uv) for p, uv in seen_in if p and isinstance(uv, BoardNotFound)}
        )
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
            raise CalibrationError(f"{error}{_commonest(reasons, manifest)}") from None
    corners, moved = unify_corners(single, shots, board, manifest.board.two_sided)
    seen = np.isfinite(corners).any(axis=(0, 2, 3))
    for pose in np.flatnonzero(~seen):
        off = moved.get(int(pose))
        why = f"{1e3 * off:.1f} mm off the rig of the others" if off else "no camera sees the board"
        files = ", ".join(path.name for row in paths if (path := row[pose]))
        lost.append(f"pose {pose + 1} ({files or 'no picture'}): {why}; it is left out")
    cameras = [one.camera() for one in single]
    used = corners[:, seen]
    full = adjust_bundle(used, board.shown(used), cameras, not lenses, not lenses)
    if (
        not lenses
        and contradiction_ratio(full.rms, [one.rms for one in single]) > MAX_CONTRADICTION
    ):
        full = adjust_bundle(used, board.shown(used), cameras, intrinsics=False, distortion=False)
    residuals = np.full(corners.shape, np.nan)
    residuals[:, seen] = full.residuals
    return corners, lost, single, replace(full, residuals=residuals)


def contradiction_ratio(together: float, alone: Iterable[float]) -> float:
    """Return the rms residual of cameras adjusted together over that of each camera alone."""
    return together / float(np.sqrt(np.mean(np.square(list(alone)))))


def _commonest(refused: Mapping[str, str], manifest: Manifest) -> str:
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
