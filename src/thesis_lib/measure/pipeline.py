"""The whole chain on a folder of recordings: check, calibrate, synchronise, track, fit, report."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib import __version__
from thesis_lib.files import staging
from thesis_lib.measure.calibration import uncertainty
from thesis_lib.measure.exchange import files, history
from thesis_lib.measure.exchange.cameras import OWN_FILE
from thesis_lib.measure.feasibility.assess import Assessment, assess_manifest, describe_assessment
from thesis_lib.measure.measured import Recorded, fit_deflection, record_tracks
from thesis_lib.measure.modes.result import modes_result
from thesis_lib.measure.radiation import files as radiation_files
from thesis_lib.measure.radiation.of_measurement import sound_of
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.text_files import write_csv
from thesis_lib.measure.report import animation, build
from thesis_lib.measure.report.diagnostics import collect_diagnostics
from thesis_lib.measure.response.result import estimate_response
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.outputs import check_cache, check_outputs, put_files
from thesis_lib.studies import storage
from thesis_lib.studies.schema import with_origin

STEPS_FOLDER = ".steps"  # folder of what is kept between runs
#: All that a measurement may write, as patterns
OUTPUT_FILES = (
    "report.html", "figures/*.*", "vtk/**/*.*", "measured.*", "shapes.*", "motion.*", "modes.*",
    "mode-*.*", "response.*", "radiated.*", "heard-*.wav", "calibration.nc", "cameras.*", "shape.*",
    "tracked.mp4",
)  # fmt: skip
_SOURCE_TEXT = f"measurement by thesis_lib {__version__}"
_NEVER_S = 1e6  # after all recordings


def measure_recordings(path: Path, out: Path, say: Callable[[str], object] = print) -> Path:
    """Measure the recordings that a manifest names.

    Parameters
    ----------
    path : Path
        The manifest.
    out : Path
        Folder for the results: ``report.html``, ``figures``, ``measured.nc``, ``shapes.csv`` and
        the files of :mod:`~thesis_lib.measure.exchange.files` and
        :mod:`~thesis_lib.measure.report.animation`; next to them steps that a second run need not
        repeat.
    say : callable
        Called, line by line, with the progress of the measurement.

    Returns
    -------
    Path
        The report.

    Raises
    ------
    ManifestError, MediaError
        If the manifest or a file cannot be used.
    CalibrationError, SynchronisationError, TrackingError, ChainError, FrequencyError, ModalError
        If the recordings do not suffice; one line that says what is missing.
    """
    manifest, folder = read_manifest(path), path.parent
    read = [one.file for one in (manifest.calibration, manifest.force) if one is not None]
    read += [manifest.truth] if manifest.truth else []
    there = chain.from_iterable(map(out.glob, OUTPUT_FILES))
    check_outputs(out, there, [folder / name for name in read])
    check_cache(out / STEPS_FOLDER)
    assessment = assess_manifest(manifest)
    for line in describe_assessment(assessment):
        say(line)
    inputs = record_tracks(manifest, folder, out / STEPS_FOLDER, say)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is never seen
        if manifest.excitation.behaviour.result == "shape":
            return measure_shape(manifest, folder, inputs, assessment, out, say)
        return measure_motion(manifest, folder, inputs, out, say)


def measure_shape(
    manifest: Manifest,
    folder: Path,
    inputs: Recorded,
    assessment: Assessment,
    out: Path,
    say: Callable[[str], object],
) -> Path:
    """Fit the shape of one frequency, and write report and files; return the report."""
    say("fitting the deflection")
    data, moved = fit_deflection(manifest, inputs)
    videos = [folder / camera.video for camera in manifest.cameras]
    firsts = [next(media.read_frames(video, 0, 1)) for video in videos]
    seen = collect_diagnostics(data, moved, manifest, inputs.recordings)
    radiated, sound = _radiate(data, manifest)
    report = build.build_shape(data, seen, manifest, assessment, firsts, sound)
    with staging(out) as part:
        storage.write_netcdf(data, part / "measured.nc")
        storage.write_netcdf(uncertainty.to_keep(inputs.calibration), part / OWN_FILE)
        write_csv(build.tabulate_shape(data), part / "shapes.csv")
        files.write_formats(part, files.Measured("shape", data, moved, inputs.recordings))
        animation.write_animations(part, data, inputs.recordings[0], videos[0])
        if radiated is not None:
            radiation_files.write_sound(part, radiated)
        report.write(part)
        put_files(part, out)
    _print_report(report, sound, say)
    return out / "report.html"


def measure_motion(
    manifest: Manifest, folder: Path, inputs: Recorded, out: Path, say: Callable[[str], object]
) -> Path:
    """Measure modes, motion over a force, or both; return the report.

    Raises
    ------
    ForceError, ChainError, MediaError, ModalError
        If force or tracks do not suffice; one line that says what would do.
    """
    response = None
    if manifest.force is not None:
        response = _measure_response(manifest, folder, inputs, out, say)
    if response is None or manifest.excitation.behaviour.result != "response":
        return measure_modes(manifest, inputs, out, say, response)
    report = build.build_response_alone(
        response,
        manifest,
        str(inputs.calibration.attrs["notes"]),
        inputs.sound.attrs["synchronisation"],
    )
    with staging(out) as part:
        report.write(part)
        put_files(part, out)
    return out / "report.html"


def _measure_response(
    manifest: Manifest, folder: Path, inputs: Recorded, out: Path, say: Callable[[str], object]
) -> build.Report:
    """Write motion over force into a folder; return the part of the report on it."""
    say("motion over force")
    data = with_origin(
        estimate_response(manifest, inputs.sound, inputs.recordings, folder), _SOURCE_TEXT
    )
    data.attrs.update(
        title=f"Motion of a {manifest.structure.kind} over a force",
        parameters=manifest.model_dump_json(),
        synchronisation=inputs.sound.attrs["synchronisation"],
    )
    response = build.build_response(data, manifest)
    with staging(out) as part:
        storage.write_netcdf(data, part / "response.nc")
        files.write_formats(part, files.Measured("response", data))
        put_files(part, out)
    _print_report(response, None, say)
    return response


def measure_modes(
    manifest: Manifest,
    inputs: Recorded,
    out: Path,
    say: Callable[[str], object],
    response: build.Report | None = None,
) -> Path:
    """Fit the modes, and write report and files into a folder; return the report."""
    say("fitting the modes")
    recordings, calibration = inputs.recordings, inputs.calibration
    covariance = uncertainty.covariance_of(calibration)
    data = with_origin(modes_result(manifest, inputs.sound, recordings, covariance), _SOURCE_TEXT)
    kind = manifest.excitation.behaviour.title
    data.attrs.update(
        title=f"{kind} of a {manifest.structure.kind}, measured with {len(recordings)} cameras",
        parameters=manifest.model_dump_json(),
        notes=calibration.attrs["notes"],
        synchronisation=inputs.sound.attrs["synchronisation"],
        repeats=inputs.sound.attrs.get("repeats", ""),
    )
    moved = _interpolate_motion(data, recordings, manifest.excitation.rest_duration_s)
    radiated, sound = _radiate(data, manifest)
    report = build.build_modes(data, manifest, response, sound)
    with staging(out) as part:
        storage.write_netcdf(data, part / "modes.nc")
        write_csv(build.tabulate_modes(data), part / "modes.csv")
        write_csv(build.tabulate_mode_shapes(data), part / "shapes.csv")
        files.write_formats(part, files.Measured("modes", data, moved, recordings))
        for k in range(data.sizes["mode"]):
            animation.write_shape(part / f"mode-{k + 1}", data.isel(mode=k))
        storage.write_netcdf(uncertainty.to_keep(calibration), part / OWN_FILE)
        if radiated is not None:
            radiation_files.write_sound(part, radiated)
        report.write(part)
        put_files(part, out)
    _print_report(report, sound, say)
    return out / "report.html"


def _radiate(
    data: xr.Dataset, manifest: Manifest
) -> tuple[xr.Dataset, build.Report] | tuple[None, None]:
    """Return the radiated sound and the part of the report on it, if the manifest asks for it."""
    if manifest.radiation is None:
        return None, None
    radiated = with_origin(sound_of(data, manifest), data.attrs["source"])
    return radiated, build.build_sound(radiated, manifest)


def _print_report(
    report: build.Report, sound: build.Report | None, say: Callable[[str], object]
) -> None:
    """Print what was found, of the sound, too, and the notes on it."""
    lines = [*report.summary, *(sound.summary if sound else []), *report.note_lines]
    for line in lines:
        say(line)


def _interpolate_motion(
    data: xr.Dataset, recordings: Sequence[Recording], rest_duration_s: float
) -> xr.Dataset | None:
    """Return every marker from frame to frame; None where a mode is too fast to interpolate."""
    highest = float(data["frequency"].max())
    if highest > history.MAX_INTERPOLATED_RATIO * min(own.rate for own in recordings):
        return None
    shape = data["lag"].size, data.sizes["marker"]
    plain = data.isel(mode=0).assign(
        centre_scatter=(("camera", "marker"), np.full(shape, float(data["noise"]))),
        steady=("end", [_NEVER_S, _NEVER_S + 1]),
        frequency=highest,
    )
    return with_origin(
        history.time_histories(plain, recordings, rest_duration_s), data.attrs["source"]
    )
