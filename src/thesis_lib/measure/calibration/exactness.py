"""A calibration with its standard deviations as its pictures of the board tell them, kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.linalg import block_diag

from thesis_lib import __version__
from thesis_lib.arrays import Array
from thesis_lib.measure.calibration.alignment import camera_deviations
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust
from thesis_lib.measure.calibration.jackknife import jackknife, with_lenses
from thesis_lib.measure.calibration.reprojection import LENS, POSE
from thesis_lib.measure.calibration.rig import MAX_CONTRADICTION, cameras_in, contradiction
from thesis_lib.measure.recordings.board import Board
from thesis_lib.studies.cache import kept, key_of
from thesis_lib.studies.schema import declared, labelled, with_origin
from thesis_lib.vision.lens import Camera

VARIABLES = declared("""
    board_poses() [1] poses of the board that were used; 0 of a calibration that is reused
    focal_deviation(camera) [px] standard deviation of the focal length
    centre_deviation(camera) [m] standard deviation of the centre of projection
    covariance(unknown, other) [1] covariance of all cameras' poses (rotation in rad, centre in m),
        then of all lenses (f_x, f_y, c_x, c_y in px, k1, k2, p1, p2), up to where the world lies
""")


def exact(
    calibration: xr.Dataset, board: Board, steps: Path, held: Array | None = None
) -> xr.Dataset:
    """The calibration, its deviations by a jackknife over shots, and its ``covariance``.

    Parameters
    ----------
    calibration : xarray.Dataset
        What :func:`thesis_lib.measure.steps.calibrated` returns.
    board : Board
        The board.
    steps : Path
        Folder in which the result is kept, all of the calibration with it.
    held : ndarray, shape (8 n, 8 n), optional
        Covariance of lenses that the calibration held fixed; NaN where it is unknown.

    Returns
    -------
    xarray.Dataset
        With :data:`VARIABLES` by :func:`~thesis_lib.measure.calibration.jackknife.jackknife`.
    """

    def compute() -> xr.Dataset:
        corners = calibration["corners"].values
        corners = corners[:, np.isfinite(corners).any(axis=(0, 2, 3))]  # of poses that were used
        points, lenses = board.shown(corners), held
        if lenses is None and contradict(calibration):
            lenses = _alone(corners, points, cameras_in(calibration))
        free = lenses is None
        full = adjust(corners, points, cameras_in(calibration), free, free)
        cameras = jackknife(corners, points, full)
        if lenses is not None and np.isfinite(lenses).all():
            covariance = with_lenses(corners, points, full, lenses, cameras.covariance)
            cameras = replace(cameras, covariance=covariance)
        focal = cameras.deviations[:, 0] if lenses is None else np.sqrt(np.diag(lenses)[::LENS])
        values = {
            "board_poses": corners.shape[1],
            "focal_deviation": focal,
            "centre_deviation": np.linalg.norm(camera_deviations(cameras)[0], axis=1),
            "covariance": cameras.covariance,
        }
        return calibration.load().assign(labelled(values, VARIABLES))

    return kept(
        steps / "cameras.nc",
        compute,
        key_of([calibration.attrs["key"], held is not None and held.tolist()]),
    )


def contradict(calibration: xr.Dataset) -> bool:
    """Whether the lenses are those of each camera alone, as the cameras contradict each other."""
    together, alone = calibration["reprojection_rms"], calibration["single_rms"].values
    return contradiction(float(together), alone) > MAX_CONTRADICTION


def _alone(corners: Array, points: Array, cameras: Sequence[Camera]) -> Array:
    """Covariance of the lenses, (8 n, 8 n), as each camera's own images determine them."""
    blocks = []
    for k, camera in enumerate(cameras):
        seen = np.isfinite(corners[k]).any(axis=(1, 2))
        own, of = corners[[k]][:, seen], points if points.ndim == 2 else points[[k]][:, seen]
        blocks.append(jackknife(own, of, adjust(own, of, [camera])).covariance[POSE:, POSE:])
    return block_diag(*blocks)


def stated(calibration: xr.Dataset, covariance: Array | None) -> xr.Dataset:
    """A calibration that is reused, with the deviations of its covariance; NaN without one."""
    cameras = cameras_in(calibration)
    n = len(cameras)
    known = np.full([(POSE + LENS) * n] * 2, np.nan) if covariance is None else covariance
    none = np.zeros((0, 3, 3)), np.zeros((0, 3))
    bare = Adjustment(tuple(cameras), *none, np.zeros(0), 0, 0, np.zeros((n, LENS)), known, 0)
    values = {
        "board_poses": 0,
        "focal_deviation": np.sqrt(np.diag(known)[POSE * n :: LENS]),
        "centre_deviation": np.linalg.norm(camera_deviations(bare)[0], axis=1),
        "covariance": known,
    }
    return calibration.assign(labelled(values, VARIABLES))


def covariance_of(calibration: xr.Dataset) -> Array | None:
    """The covariance of the cameras; None if it is not known."""
    covariance = calibration["covariance"].values
    return covariance if np.isfinite(covariance).all() else None


def to_keep(calibration: xr.Dataset) -> xr.Dataset:
    """What of a calibration another measurement can reuse, as a dataset of its own."""
    names = ["K", "distortion", "size", "R_camera_world", "centre", *VARIABLES]
    own = calibration[names].drop_attrs(deep=False).assign_attrs(title="Calibrated cameras")
    return with_origin(own, f"measurement by thesis_lib {__version__}")
