"""A calibration with its standard deviations as its pictures of the board tell them, kept."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib import __version__
from thesis_lib.arrays import Array
from thesis_lib.measure.calibration.alignment import camera_deviations
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust
from thesis_lib.measure.calibration.jackknife import jackknife, with_lenses
from thesis_lib.measure.calibration.reprojection import LENS, POSE
from thesis_lib.measure.calibration.rig import cameras_in
from thesis_lib.measure.recordings.board import Board
from thesis_lib.studies.attributes import with_origin
from thesis_lib.studies.cache import kept, key_of
from thesis_lib.studies.variables import declared, labelled

VARIABLES = declared("""
    board_poses() [1] poses of the board that were used; 0 of a calibration that is reused
    focal_deviation(camera) [px] standard deviation of the focal length
    centre_deviation(camera) [m] standard deviation of the centre of projection
    covariance(unknown, other) [1] of all cameras' poses (rotation in rad, centre in m), then their
        lenses (f_x, f_y, c_x, c_y in px, k1, k2, p1, p2), up to where the world lies
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
        points, free = board.shown(corners), held is None
        full = adjust(corners, points, cameras_in(calibration), free, free)
        cameras = jackknife(corners, points, full)
        if held is not None and np.isfinite(held).all():
            covariance = with_lenses(corners, points, full, held, cameras.covariance)
            cameras = replace(cameras, covariance=covariance)
        lenses = np.diag(cameras.covariance if held is None else held)[-LENS * len(full.cameras) :]
        values = {
            "board_poses": corners.shape[1],
            "focal_deviation": np.sqrt(lenses[::LENS]),
            "centre_deviation": np.linalg.norm(camera_deviations(cameras)[0], axis=1),
            "covariance": cameras.covariance,
        }
        return calibration.load().assign(labelled(values, VARIABLES))

    return kept(
        steps / "cameras.nc",
        compute,
        key_of([calibration.attrs["key"], held is not None and held.tolist()]),
    )


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
