"""Measurement pipeline: check, calibrate, synchronise, track, fit and report recordings."""

import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib import __version__
from thesis_lib.files import check_cache, check_outputs, lock_folder, put_files, staging
from thesis_lib.measure import steps as measuring
from thesis_lib.measure.calibration.bundle_adjustment import LENS_UNKNOWNS
from thesis_lib.measure.exchange import cameras, files, history
from thesis_lib.measure.feasibility.assess import assess_manifest, describe_assessment
from thesis_lib.measure.fitting import frequency, result
from thesis_lib.measure.modes.identify import modes_result
from thesis_lib.measure.radiation.of_measurement import sound_of, write_sound
from thesis_lib.measure.recordings import media, media_info, text_files, validation
from thesis_lib.measure.recordings.manifest import Manifest, read_manifest
from thesis_lib.measure.report import animation, build, figures
from thesis_lib.measure.response.result import estimate_response
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies import schema, storage

Say = Callable[[str], object]  # called with each line of progress
STEPS_FOLDER = ".steps"  # cache folder
#: Patterns of all files that a measurement may write
OUTPUT_FILES = (
    "report.html", "figures/*.*", "vtk/**/*.*", "measured.*", "shapes.*", "motion.*", "modes.*",
    "mode-*.*", "response.*", "radiated.*", "heard-*.wav", "calibration.nc", "cameras.*", "shape.*",
    "tracked.mp4",
)  # fmt: skip
_SOURCE_TEXT = f"measurement by thesis_lib {__version__}"
_NEVER_S = 1e6  # after all recordings
UNSTORED_VARIABLES = {
    "single_focal", "R_camera_world", "centre", "covariance", "adjusted_centre_deviation",
    "frequency", "of_sound", "of_sound_deviation",
}  # fmt: skip


@dataclass(frozen=True)
class Inputs:
    """Inputs of the fits: synchronisation, calibration and tracks."""

    sound: xr.Dataset  #: Cameras' start times, and frequency and phase from the audio
    calibration: xr.Dataset  #: Calibrated cameras
    recordings: Sequence[Recording]  #: Tracks of each camera

    @property
    def repeats(self) -> list[str]:
        """Return a sentence for each camera with frames that repeat the previous one."""
        lines = [
            validation.describe_repeats(one.camera.name, one.repeats) for one in self.recordings
        ]
        return [line for line in lines if line]


def record_tracks(manifest: Manifest, folder: Path, steps: Path, say: Say) -> Inputs:
    """Check files, estimate delays, calibrate and track; cache each step in the folder `steps`.

    Errors are those of :func:`measure_recordings`.
    """
    say(f"checking {len(manifest.cameras)} videos")
    clocks = validation.check_files(manifest, folder)  # before any file is written
    given = cameras.reuse_calibration(manifest, folder)
    filmed_cameras = tuple(  # with the frame rates of the videos, the mean where they vary
        camera.model_copy(update={"frame_rate_hz": media_info.rate_of(clock, camera.rate_hz)})
        for camera, clock in zip(manifest.cameras, clocks, strict=True)
    )
    filmed = manifest.model_copy(update={"cameras": filmed_cameras})
    # The audio comes before the calibration: its checks may still refuse the manifest.
    sound = measuring.read_sound(filmed, folder, steps, say)
    calibration = _calibrate(manifest, folder, steps, given, say)
    recordings = measuring.track_markers(filmed, folder, steps, calibration, sound, clocks)
    found = Inputs(sound, calibration, recordings)
    for line in found.repeats:
        say(f"Frames repeat: {line}")
    return found


def fit_deflection(manifest: Manifest, of: Inputs) -> tuple[xr.Dataset, xr.Dataset]:
    """Fit the shape at one frequency, and return the datasets ``measured.nc`` and ``motion.nc``.

    The first includes calibration and synchronisation. Raise ChainError or FrequencyError if the
    markers at rest, or the motion, do not suffice.
    """
    excitation, sound = manifest.excitation, of.sound
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # of unseen markers
        covariance = cameras.covariance_of(of.calibration)
        data = result.shape_result(manifest, sound, of.recordings, covariance)
        still = excitation.rest_duration_s or float(sound["steady"][1])  # else mean position
        for found in (of.calibration, sound):
            stored = found.drop_vars(UNSTORED_VARIABLES, errors="ignore").drop_encoding()
            data = data.merge(stored)
        data = _complete(data, manifest, of, "Deflection")
        moved = history.time_histories(data, frequency.in_step(data, of.recordings), still)
        return data, schema.with_origin(moved, data.attrs["source"])


def _complete(data: xr.Dataset, manifest: Manifest, of: Inputs, what: str) -> xr.Dataset:
    """Return a result with its origin and title, the manifest, and notes on its inputs."""
    kind, count = manifest.structure.kind, len(of.recordings)
    return schema.with_origin(data, _SOURCE_TEXT).assign_attrs(
        title=f"{what} of a {kind}, measured with {count} cameras",
        parameters=manifest.model_dump_json(),
        notes=of.calibration.attrs["notes"],
        synchronisation=of.sound.attrs["synchronisation"],
        repeats="\n".join(of.repeats),
    )


def _calibrate(
    manifest: Manifest, folder: Path, steps: Path, given: cameras.ReusedCameras | None, say: Say
) -> xr.Dataset:
    """Return the cameras, calibrated by images of the board or reused, with uncertainties."""
    if given is None or manifest.calibration is None:
        return measuring.calibrate_rig(manifest, folder, steps, say)
    if manifest.calibration.poses == "kept":
        return cameras.describe_reused(given.cameras, given.covariance)
    n = LENS_UNKNOWNS * len(given.cameras)
    held = np.full((n, n), np.nan) if given.covariance is None else given.covariance[-n:, -n:]
    return measuring.calibrate_rig(manifest, folder, steps, say, given.cameras, held)


def measure_recordings(path: Path, out: Path, say: Say = print) -> build.Report:
    """Measure the recordings that a manifest names.

    Parameters
    ----------
    path : Path
        The manifest.
    out : Path
        Folder for the results: ``report.html``, ``figures``, ``measured.nc``, ``shapes.csv`` and
        the files of :mod:`~thesis_lib.measure.exchange.files` and
        :mod:`~thesis_lib.measure.report.animation`; ``.steps`` caches steps for a second run.
    say : callable
        Called, line by line, with the progress of the measurement.

    Returns
    -------
    Report
        The page ``report.html``, a summary of the results, and notes on them.

    Raises
    ------
    ManifestError, MediaError
        If the manifest or a file cannot be used.
    CalibrationError, SynchronisationError, TrackingError, ChainError, FrequencyError, ModalError
        If the recordings do not suffice; the message names what is missing.
    FailedError
        If another command writes to the folder.
    """
    manifest, folder = read_manifest(path), path.parent
    read = [one.file for one in (manifest.calibration, manifest.force) if one is not None]
    read += [manifest.truth] if manifest.truth else []
    with lock_folder(out):  # another measurement would replace tracks that this one reads
        there = chain.from_iterable(map(out.glob, OUTPUT_FILES))
        check_outputs(out, there, [folder / name for name in read])
        check_cache(out / STEPS_FOLDER)
        for line in describe_assessment(assess_manifest(manifest)):
            say(line)
        inputs = record_tracks(manifest, folder, out / STEPS_FOLDER, say)
        with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # of unseen markers
            if manifest.excitation.behaviour.result == "shape":
                return measure_shape(manifest, folder, inputs, out, say)
            return measure_motion(manifest, folder, inputs, out, say)


def measure_shape(
    manifest: Manifest, folder: Path, inputs: Inputs, out: Path, say: Say
) -> build.Report:
    """Fit the shape of one frequency, and write report and files; return the report."""
    say("fitting the deflection")
    data, moved = fit_deflection(manifest, inputs)
    videos = [folder / camera.video for camera in manifest.cameras]
    own, slow = inputs.recordings[0], min(1.0, 1 / (2 * float(data["frequency"])))
    rings = animation.draw_tracks(own, videos[0], float(data["steady"][0]))
    with staging(out) as part, ThreadPoolExecutor(1) as thread:
        # Slowed so that a period of the vibration takes two seconds at least
        film = part / "tracked.mp4", rings, max(slow * own.rate, 1.0)
        filmed = thread.submit(animation.write_mp4, *film)  # concurrently
        firsts = [next(media.read_frames(video, 0, 1)) for video in videos]
        seen = figures.collect_diagnostics(data, moved, manifest, inputs.recordings)
        radiated, sound = _radiate(data, manifest)
        report = build.build_shape(data, seen, manifest, firsts, sound)
        storage.write_netcdf(data, part / "measured.nc")
        text_files.write_csv(build.tabulate_shape(data), part / "shapes.csv")
        files.write_formats(part, data, moved, inputs.recordings)
        animation.write_shape(part / "shape", data)
        filmed.result()
        _put_results(part, out, say, report, inputs, radiated)
    return report


def measure_motion(
    manifest: Manifest, folder: Path, inputs: Inputs, out: Path, say: Say
) -> build.Report:
    """Measure modes, receptances, or both; return the report."""
    if manifest.force is None:
        return measure_modes(manifest, inputs, out, say)
    say("motion over force")
    found = estimate_response(manifest, inputs.recordings, folder)
    data = _complete(found, manifest, inputs, "Motion over a force")
    report = build.build_response(data, manifest)
    alone = manifest.excitation.behaviour.result == "response"
    with staging(out) as part:
        storage.write_netcdf(data, part / "response.nc")
        files.write_formats(part, data)
        _put_results(part, out, say, report, inputs if alone else None)
    if alone:
        return report
    printed = _lines_of(report)
    return measure_modes(manifest, inputs, out, lambda line: line in printed or say(line), report)


def measure_modes(
    manifest: Manifest, inputs: Inputs, out: Path, say: Say, response: build.Report | None = None
) -> build.Report:
    """Fit the modes, and write report and files into a folder; return the report."""
    say("fitting the modes")
    recordings, covariance = inputs.recordings, cameras.covariance_of(inputs.calibration)
    fitted = modes_result(manifest, inputs.sound, recordings, covariance)
    data = _complete(fitted, manifest, inputs, manifest.excitation.behaviour.title)
    moved, highest = None, float(data["frequency"].max())
    if highest <= history.MAX_INTERPOLATED_RATIO * min(own.rate for own in recordings):
        shape = data["lag"].size, data.sizes["marker"]
        plain = data.isel(mode=0).assign(
            centre_scatter=(("camera", "marker"), np.full(shape, float(data["noise"]))),
            steady=("end", [_NEVER_S, _NEVER_S + 1]),
            frequency=highest,
        )
        fixed = recordings
        if data["lag"].any() or data["pace"].any():  # else times would differ by rounding
            clocks = data.assign(steady=data["window"], corrected=data["pace"] != 0)
            fixed = frequency.in_step(clocks, recordings)
        found = history.time_histories(plain, fixed, manifest.excitation.rest_duration_s)
        moved = schema.with_origin(found, data.attrs["source"])
    radiated, sound = _radiate(data, manifest)
    report = build.build_modes(data, manifest, response, sound)
    with staging(out) as part:
        storage.write_netcdf(data, part / "modes.nc")
        text_files.write_csv(build.tabulate_modes(data), part / "modes.csv")
        text_files.write_csv(build.tabulate_mode_shapes(data), part / "shapes.csv")
        files.write_formats(part, data, moved, recordings)
        for k in range(data.sizes["mode"]):
            animation.write_shape(part / f"mode-{k + 1}", data.isel(mode=k))
        _put_results(part, out, say, report, inputs, radiated)
    return report


def _put_results(
    part: Path,
    out: Path,
    say: Say,
    report: build.Report,
    inputs: Inputs | None,
    radiated: xr.Dataset | None = None,
) -> None:
    """Move all files of `part` to `out`, with the report if there are inputs; print its lines."""
    if inputs is not None:  # else the report is a section of another one
        storage.write_netcdf(
            cameras.select_reusable(inputs.calibration), part / cameras.CALIBRATION_FILE
        )
        report.write_files(part)
    if radiated is not None:
        write_sound(part, radiated)
    put_files(part, out)
    for line in _lines_of(report):
        say(line)


def _lines_of(report: build.Report) -> list[str]:
    return [*report.summary, *(f"note: {text} [{code}]" for code, text in report.notes)]


def _radiate(
    data: xr.Dataset, manifest: Manifest
) -> tuple[xr.Dataset, build.Report] | tuple[None, None]:
    """Return the radiated sound and its section of the report, if the manifest requests them."""
    if manifest.radiation is None:
        return None, None
    radiated = schema.with_origin(sound_of(data, manifest), data.attrs["source"])
    return radiated, build.build_sound(radiated, manifest)
