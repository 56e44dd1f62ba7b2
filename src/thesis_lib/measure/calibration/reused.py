"""A calibration taken from elsewhere, as a whole or its lenses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, IntArray
from thesis_lib.measure.calibration.bundle_adjustment import LENS_UNKNOWNS, POSE_UNKNOWNS
from thesis_lib.measure.exchange.cameras import Found, read_cameras
from thesis_lib.measure.recordings.manifest import ManifestError
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.steps import CALIBRATION_VARIABLES
from thesis_lib.studies.cache import key_of
from thesis_lib.studies.schema import label_values


def reuse_calibration(manifest: Manifest, folder: Path) -> Found | None:
    """Return the manifest's cameras of the calibration that it reuses; None if it reuses none.

    Raises
    ------
    ManifestError
        If that cannot be read, or is not of these cameras, in one line.
    """
    asked = manifest.calibration
    if asked is None:
        return None
    path = folder / asked.file
    try:
        found = read_cameras(path, asked.unit)
        return _choose_cameras(found, manifest, path)
    except ManifestError as error:
        raise ManifestError(f"calibration: {error}") from None


def _choose_cameras(found: Found, manifest: Manifest, path: Path) -> Found:
    """Return the cameras that the manifest has, in its order."""
    names = [one.name for one in found.cameras]
    there = ", ".join(names)
    order = []
    for camera in manifest.cameras:
        if names.count(camera.name) != 1:
            what = "two cameras" if camera.name in names else "no camera"
            raise ManifestError(f"{path}: {what} {camera.name} in it; there are {there}")
        order.append(names.index(camera.name))
        if (given := found.cameras[order[-1]].size) != camera.size:
            raise ManifestError(
                f"{path}: camera {camera.name} is of {given[0]} × {given[1]} px, allowed: "
                f"{camera.size[0]} × {camera.size[1]} px as the manifest says"
            )
    assert manifest.calibration is not None
    if manifest.calibration.poses == "kept" and not found.placed:
        raise ManifestError(
            f"{path}: does not say where all cameras are, allowed: poses: anew, with images of "
            "the board"
        )
    covariance = found.covariance
    if covariance is not None:
        rows = _covariance_rows(np.array(order), len(names))
        covariance = covariance[np.ix_(rows, rows)]
    return Found([found.cameras[k] for k in order], found.placed, covariance)


def _covariance_rows(order: IntArray, count: int) -> IntArray:
    """Return the rows of the unknowns of some of a covariance's cameras."""
    poses = POSE_UNKNOWNS * order[:, None] + np.arange(POSE_UNKNOWNS)
    lenses = POSE_UNKNOWNS * count + LENS_UNKNOWNS * order[:, None] + np.arange(LENS_UNKNOWNS)
    return np.concatenate([poses.ravel(), lenses.ravel()])


def as_calibrated(found: Found) -> xr.Dataset:
    """Return reused cameras as :func:`thesis_lib.measure.steps.calibrate_rig` returns them."""
    n = len(found.cameras)
    nothing: Array = np.full((n, 1, 2, 1), np.nan)
    kept = ("K", "distortion", "R_camera_world", "centre", "size")
    values = {name: [getattr(one, name) for one in found.cameras] for name in kept} | {
        "reprojection_rms": np.nan,
        "single_rms": [np.nan] * n,
        "single_focal": [one.K[[0, 1], [0, 1]] for one in found.cameras],
        "focal_deviation": [np.nan] * n,
        "centre_deviation": [np.nan] * n,
        "corners": nothing,
        "residuals": nothing,
    }
    numbers = [np.asarray(values[name]).tolist() for name in kept]
    names = [one.name for one in found.cameras]
    attrs = {"notes": "", "key": key_of([names, numbers])}
    return xr.Dataset(label_values(values, CALIBRATION_VARIABLES), {"camera": names}, attrs)
