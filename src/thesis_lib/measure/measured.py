"""Cameras, clocks and tracks of a folder of recordings, and the deflection fitted to them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib import __version__
from thesis_lib.measure.calibration import uncertainty
from thesis_lib.measure.calibration.reprojection import LENS_UNKNOWNS
from thesis_lib.measure.calibration.reused import as_calibrated, reuse_calibration
from thesis_lib.measure.exchange import history
from thesis_lib.measure.exchange.cameras import Found
from thesis_lib.measure.fitting.clocks import in_step
from thesis_lib.measure.fitting.result import shape_result
from thesis_lib.measure.recordings import validation as recordings_check
from thesis_lib.measure.recordings.manifest import ManifestError
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.validation import ChainError, on_one_line
from thesis_lib.measure.steps import (
    CALIBRATION_VARIABLES,
    SOUND_VARIABLES,
    calibrate_rig,
    inspect_videos,
    read_sound,
    track_markers,
)
from thesis_lib.measure.tracking.follow import DETECTORS
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies.schema import label_values, parse_variables, with_origin
from thesis_lib.text import one_line

SHOT_VARIABLES = parse_variables("shots_used(camera) [1] board images that were used")
UNSTORED_VARIABLES = {
    "single_focal", "R_camera_world", "centre", "covariance",
    "frequency", "of_sound", "of_sound_deviation",
}  # fmt: skip


@dataclass(frozen=True)
class Recorded:
    """Inputs of a measurement, before anything is fitted."""

    sound: xr.Dataset  #: When the cameras started, and what their sound tells
    calibration: xr.Dataset  #: The cameras
    recordings: Sequence[Recording]  #: Their tracks


def record_tracks(
    manifest: Manifest, folder: Path, steps: Path, say: Callable[[str], object]
) -> Recorded:
    """Check, listen, calibrate and track; each step is kept in the folder `steps`.

    Raises
    ------
    ManifestError, MediaError, CalibrationError, SynchronisationError, TrackingError
        If a file cannot be used, or what was recorded does not suffice.
    """
    detector = manifest.structure.markers.detector
    if detector not in DETECTORS:
        allowed = " or ".join(DETECTORS)
        raise ManifestError(
            f"structure.markers.detector: given {one_line(detector)}, allowed: {allowed}"
        )
    say(f"checking {len(manifest.cameras)} videos")
    clocks = recordings_check.check_files(manifest, folder)  # what it refuses leaves no trace
    given, filmed = (
        reuse_calibration(manifest, folder),
        recordings_check.add_frame_rates(manifest, clocks),
    )
    sound = read_sound(filmed, folder, steps, say)  # first: it may refuse more of the manifest
    reading, repeats = inspect_videos(manifest, folder, steps, clocks)
    for line in [*reading, *(f"Frames repeat: {line}" for line in repeats)]:
        say(line)
    sound.attrs["repeats"] = "\n".join(repeats)
    calibration = _calibration(manifest, folder, steps, given, say)
    recordings = track_markers(filmed, folder, steps, calibration, sound, clocks)
    return Recorded(sound, calibration, recordings)


def fit_deflection(manifest: Manifest, of: Recorded) -> tuple[xr.Dataset, xr.Dataset]:
    """Fit the shape of one frequency, with all that it rests on, and every marker's motion.

    Returns
    -------
    tuple of xarray.Dataset
        What ``measured.nc`` and ``motion.nc`` hold.

    Raises
    ------
    ChainError, FrequencyError
        If the markers at rest, or the motion, do not suffice.
    """
    excitation, sound = manifest.excitation, of.sound
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is never seen
        data = shape_result(
            manifest, sound, of.recordings, uncertainty.covariance_of(of.calibration)
        )
        still = excitation.rest_duration_s or float(sound["steady"][1])  # else about its middle
        _check_plane(data, manifest)
        data = with_origin(
            data.merge(_stored_variables(of.calibration, sound)),
            f"measurement by thesis_lib {__version__}",
        )
        data.attrs.update(
            title=f"Deflection of a {manifest.structure.kind}, "
            f"measured with {len(of.recordings)} cameras",
            parameters=manifest.model_dump_json(),
            notes=of.calibration.attrs["notes"],
            synchronisation=sound.attrs["synchronisation"],
            repeats=sound.attrs.get("repeats", ""),
        )
        moved = history.time_histories(data, in_step(data, of.recordings), still)
        return data, with_origin(moved, data.attrs["source"])


def _calibration(
    manifest: Manifest, folder: Path, steps: Path, given: Found | None, say: Callable[[str], object]
) -> xr.Dataset:
    """Return the cameras, calibrated by images of the board or reused, with uncertainties."""
    board = manifest.board.board
    if given is None:
        return uncertainty.jackknife_calibration(
            calibrate_rig(manifest, folder, steps, say), board, steps
        )
    assert manifest.calibration is not None
    if manifest.calibration.poses == "kept":
        return uncertainty.read_deviations(as_calibrated(given), given.covariance)
    n = LENS_UNKNOWNS * len(given.cameras)
    held = np.full((n, n), np.nan) if given.covariance is None else given.covariance[-n:, -n:]
    placed = calibrate_rig(manifest, folder, steps, say, given.cameras)
    return uncertainty.jackknife_calibration(placed, board, steps, held)


def _check_plane(data: xr.Dataset, manifest: Manifest) -> None:
    """Refuse markers at rest whose places do not tell the structure's plane."""
    seen = np.isfinite(data["rest_position"].values).all(axis=0)
    places = 1e3 * np.array([data["x"].values, data["y"].values])[:, seen]
    if on_one_line(places, manifest.structure.markers.diameter_mm):
        raise ChainError(
            f"the {places.shape[1]} of {len(seen)} markers that two cameras see at rest are on one "
            "line, which does not tell how the structure is turned about it: move a camera, or "
            "add markers beside the line"
        )


def _stored_variables(calibration: xr.Dataset, sound: xr.Dataset) -> xr.Dataset:
    """Return the variables of calibration and sound that belong to the result."""
    of_cameras = CALIBRATION_VARIABLES | uncertainty.VARIABLES
    values = {
        name: (calibration if name in of_cameras else sound)[name].values
        for name in (*of_cameras, *SOUND_VARIABLES)
        if name not in UNSTORED_VARIABLES
    }
    seen = np.isfinite(values["corners"]).any(axis=(2, 3)).sum(axis=1)
    table = of_cameras | SOUND_VARIABLES | SHOT_VARIABLES
    names = {"camera": calibration["camera"]}
    return xr.Dataset(label_values(values | {"shots_used": seen}, table), names)
