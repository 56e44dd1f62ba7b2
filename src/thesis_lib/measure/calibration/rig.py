"""The cameras of a rig as adjusted together."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust
from thesis_lib.measure.calibration.corners import find_corners
from thesis_lib.measure.calibration.grids import BoardNotFound
from thesis_lib.measure.calibration.reprojection import planar_pose
from thesis_lib.measure.calibration.symmetry import unify
from thesis_lib.measure.calibration.zhang import Calibration, CalibrationError, zhang
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.recordings.manifest import shot_paths
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.pictures import read_png
from thesis_lib.studies.parallel import abreast
from thesis_lib.vision.lens import Camera


@contextlib.contextmanager
def alike() -> Iterator[None]:
    """OpenCV with one thread, which makes the same bits in every run; the cameras run abreast."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


@alike()
def adjusted(
    manifest: Manifest,
    folder: Path,
    tick: Callable[[], object] = lambda: None,
    lenses: Sequence[Camera] = (),
) -> tuple[Array, list[str], list[Calibration], Adjustment]:
    """All cameras from all corners of the board, adjusted together; `tick` is called per picture.

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
        All corners, intrinsics and distortion adjusted, too. Its residuals are of all poses, its
        boards those of the poses that were used.

    Raises
    ------
    CalibrationError
        If the shots do not determine the cameras.
    MediaError
        If a picture cannot be read.
    """
    board = manifest.board.board

    lost: list[str] = []

    def one(path: Path | None) -> Array | BoardNotFound | None:
        try:
            return None if path is None else find_corners(read_png(path), board)
        except BoardNotFound as error:
            return error
        finally:
            tick()

    paths = [shot_paths(camera, folder) for camera in manifest.cameras]
    found = iter(abreast(one, [path for row in paths for path in row]))
    shots: list[list[Array | None]] = []
    for camera, row in zip(manifest.cameras, paths, strict=True):
        shots.append([])
        for path in row:
            corners_of = next(found)
            if isinstance(corners_of, BoardNotFound):
                lost.append(f"{camera.name}, {path.name if path else '—'}: {corners_of}")
                corners_of = None
            shots[-1].append(corners_of)
    try:
        single = [posed(row, board, lens) for row, lens in zip(shots, lenses, strict=False)] or [
            zhang(row, board, camera.size, True, camera.name)
            for camera, row in zip(manifest.cameras, shots, strict=True)
        ]
    except CalibrationError as error:
        tiles = f"{manifest.board.kind} of {board.columns} × {board.rows} tiles"
        hint = f" ({lost[0]}; is the board a {tiles}?)" if lost else ""
        raise CalibrationError(f"{error}{hint}") from None
    corners, moved = unify(single, shots, board, manifest.board.two_sided)
    seen = np.isfinite(corners).any(axis=(0, 2, 3))
    for pose in np.flatnonzero(~seen):
        off = moved.get(int(pose))
        why = f"{1e3 * off:.1f} mm off the rig of the others" if off else "no camera sees the board"
        files = ", ".join(path.name for row in paths if (path := row[pose]))
        lost.append(f"pose {pose + 1} ({files or 'no picture'}): {why}; it is left out")
    cameras = [one.camera() for one in single]
    used = corners[:, seen]
    full = adjust(used, board.shown(used), cameras, not lenses, not lenses)
    residuals = np.full(corners.shape, np.nan)
    residuals[:, seen] = full.residuals
    return corners, lost, single, replace(full, residuals=residuals)


def posed(shots: Sequence[Array | None], board: Board, lens: Camera) -> Calibration:
    """A camera with a known lens, and the board's pose in each of its shots."""
    poses = [(None, None) if uv is None else planar_pose(lens, board.corners, uv) for uv in shots]
    rotations, translations = zip(*poses, strict=True)
    size, unknown = lens.size, np.full(4, np.nan)
    return Calibration(
        lens.name, size, lens.K, lens.distortion, rotations, translations, np.nan, unknown
    )


def cameras_in(calibration: xr.Dataset) -> list[Camera]:
    """The cameras of one calibration."""
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
