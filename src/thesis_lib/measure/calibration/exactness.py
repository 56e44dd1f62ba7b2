"""A calibration with its standard deviations as its pictures of the board tell them, kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.measure.calibration.alignment import camera_deviations
from thesis_lib.measure.calibration.bundle_adjustment import adjust
from thesis_lib.measure.calibration.jackknife import jackknife
from thesis_lib.measure.calibration.rig import cameras_in
from thesis_lib.measure.recordings.board import Board
from thesis_lib.studies.cache import kept, key_of
from thesis_lib.studies.variables import declared, labelled

VARIABLES = declared("""
    board_poses() [1] poses of the board that were used
    focal_deviation(camera) [px] standard deviation of the focal length
    centre_deviation(camera) [m] standard deviation of the centre of projection
    covariance(unknown, other) [1] of all cameras' poses (rotation in rad, centre in m), then their
        lenses (f_x, f_y, c_x, c_y in px, k1, k2, p1, p2), up to where the world lies
""")


def exact(calibration: xr.Dataset, board: Board, steps: Path) -> xr.Dataset:
    """The calibration, its deviations by a jackknife over shots, and its ``covariance``.

    Parameters
    ----------
    calibration : xarray.Dataset
        What :func:`thesis_lib.measure.steps.calibrated` returns.
    board : Board
        The board.
    steps : Path
        Folder in which the result is kept, all of the calibration with it.

    Returns
    -------
    xarray.Dataset
        With :data:`VARIABLES` by :func:`~thesis_lib.measure.calibration.jackknife.jackknife`.
    """

    def compute() -> xr.Dataset:
        corners = calibration["corners"].values
        corners = corners[:, np.isfinite(corners).any(axis=(0, 2, 3))]  # of poses that were used
        full = adjust(corners, board.corners, cameras_in(calibration))
        cameras = jackknife(corners, board.corners, full)
        values = {
            "board_poses": corners.shape[1],
            "focal_deviation": cameras.deviations[:, 0],
            "centre_deviation": np.linalg.norm(camera_deviations(cameras)[0], axis=1),
            "covariance": cameras.covariance,
        }
        return calibration.load().assign(labelled(values, VARIABLES))

    return kept(steps / "cameras.nc", compute, key_of([calibration.attrs["key"]]))
