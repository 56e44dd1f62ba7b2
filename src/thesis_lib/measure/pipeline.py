"""The whole chain on a folder of recordings: check, calibrate, listen, track, fit, report."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib import __version__
from thesis_lib.arrays import Array
from thesis_lib.files import staging
from thesis_lib.measure.calibration.bundle_adjustment import adjust
from thesis_lib.measure.calibration.rig import cameras_in
from thesis_lib.measure.exchange import files, history
from thesis_lib.measure.feasibility.assess import assess
from thesis_lib.measure.feasibility.describe import describe
from thesis_lib.measure.fitting.calibration_error import of_cameras
from thesis_lib.measure.fitting.clocks import in_step
from thesis_lib.measure.fitting.result import result
from thesis_lib.measure.modes.write import several
from thesis_lib.measure.radiation import files as radiation_files
from thesis_lib.measure.radiation import report as radiation_report
from thesis_lib.measure.radiation.of_measurement import sound_of
from thesis_lib.measure.recordings import check as recordings_check
from thesis_lib.measure.recordings.check import ChainError, on_one_line
from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import moving
from thesis_lib.measure.report import page as report
from thesis_lib.measure.steps import CALIBRATION, SOUND, calibrated, heard, tracked
from thesis_lib.studies import storage
from thesis_lib.studies.attributes import with_origin
from thesis_lib.studies.variables import declared, labelled

STEPS = ".steps"  # folder of what is kept between runs
SHOTS = declared("shots_used(camera) [1] pictures of the board that were used")
UNKEPT = {"single_focal", "R_camera_world", "centre", "frequency", "of_sound", "of_sound_deviation"}


def measure(path: Path, out: Path, say: Callable[[str], object] = print) -> Path:
    """Measure the recordings that a manifest names.

    Parameters
    ----------
    path : Path
        The manifest.
    out : Path
        Folder for the results: ``report.html``, ``figures``, ``measured.nc``, ``shapes.csv`` and
        what :mod:`~thesis_lib.measure.exchange.files` and :mod:`~thesis_lib.measure.report.moving`
        write; beside them steps that a second run need not repeat.
    say : callable
        Told, line by line, how far the measurement is.

    Returns
    -------
    Path
        The report.

    Raises
    ------
    ManifestError, MediaError
        If the manifest or a file cannot be used.
    CalibrationError, SynchronisationError, TrackingError, ChainError, FrequencyError, ModalError
        If what was recorded does not suffice; one line that says what is missing.
    """
    manifest, folder = read_manifest(path), path.parent
    assessment = assess(manifest)
    for line in describe(assessment):
        say(line)
    say(f"checking {len(manifest.cameras)} videos")
    clocks = recordings_check.check(manifest, folder)  # what it refuses leaves no trace
    steps, filmed = out / STEPS, recordings_check.timed(manifest, clocks)
    sound = heard(filmed, folder, steps, say)  # first: it may refuse more of the manifest
    calibration = calibrated(manifest, folder, steps, say)
    recordings = tracked(filmed, folder, steps, calibration, sound, clocks)
    if manifest.excitation.kind != "tone":
        return several(manifest, sound, calibration, recordings, out, say)
    say("fitting the deflection")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is never seen
        data = result(manifest, sound, recordings, _covariance(manifest, calibration))
        still = manifest.excitation.rest_s or float(sound["steady"][1])  # else about its middle
        _check_plane(data, manifest)
        data = with_origin(
            data.merge(_kept_of(calibration, sound)), f"measurement by thesis_lib {__version__}"
        )
        data.attrs.update(
            title=f"Deflection of a {manifest.structure.kind}, "
            f"measured with {len(recordings)} cameras",
            parameters=manifest.model_dump_json(),
            notes=calibration.attrs["notes"],
            synchronisation=sound.attrs["synchronisation"],
        )
        moved = with_origin(
            history.motion(data, in_step(data, recordings), still),
            data.attrs["source"],
        )
        radiated = None
        if manifest.radiation is not None:
            radiated = with_origin(sound_of(data, manifest), data.attrs["source"])
        pictures = report.figures(data, moved, manifest, recordings, folder)
        page = report.page(data, manifest, assessment, pictures, radiated)
    with staging(out) as part:
        (part / "figures").mkdir()
        storage.write(data, part / "measured.nc")
        for name, (kind, content) in pictures.items():
            (part / "figures" / f"{name}.{kind}").write_bytes(content)
        report.table(data).to_csv(part / "shapes.csv", index=False)
        files.write(part, data, moved, recordings)
        moving.write(part, data, recordings[0], folder / manifest.cameras[0].video)
        if radiated is not None:
            radiation_files.write(part, radiated)
        (part / "report.html").write_text(page, encoding="utf-8")
        files.move(part, out)
    for line in [
        *report.summary(data),
        *(radiation_report.summary(radiated) if radiated is not None else []),
    ]:
        say(line)
    return out / "report.html"


def _covariance(manifest: Manifest, calibration: xr.Dataset) -> Array | None:
    """Of the cameras, as their pictures of the board leave them, if sound is asked for."""
    if manifest.radiation is None:
        return None
    board = manifest.board.board
    corners = calibration["corners"].values
    corners = corners[:, np.isfinite(corners).any(axis=(0, 2, 3))]  # of poses that were used
    return of_cameras(adjust(corners, board.corners, cameras_in(calibration)))


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


def _kept_of(calibration: xr.Dataset, sound: xr.Dataset) -> xr.Dataset:
    """What of calibration and sound belongs to the result."""
    values = {
        name: (calibration if name in CALIBRATION else sound)[name].values
        for name in (*CALIBRATION, *SOUND)
        if name not in UNKEPT
    }
    seen = np.isfinite(values["corners"][:, :, 0, 0]).sum(axis=1)
    table = CALIBRATION | SOUND | SHOTS
    names = {"camera": calibration["camera"]}
    return xr.Dataset(labelled(values | {"shots_used": seen}, table), names)
