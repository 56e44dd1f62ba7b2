"""The whole chain on a folder of recordings: check, calibrate, listen, track, fit, report."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from itertools import chain
from pathlib import Path

from thesis_lib.files import staging
from thesis_lib.measure.calibration import exactness
from thesis_lib.measure.exchange import files, reading
from thesis_lib.measure.exchange.tables import write_csv
from thesis_lib.measure.feasibility.assess import assess
from thesis_lib.measure.feasibility.describe import describe
from thesis_lib.measure.measured import Recorded, deflection, recorded
from thesis_lib.measure.modes.write import several
from thesis_lib.measure.radiation import files as radiation_files
from thesis_lib.measure.radiation import report as radiation_report
from thesis_lib.measure.radiation.of_measurement import sound_of
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.force_fields import FORCED
from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import html, moving
from thesis_lib.measure.report import page as report
from thesis_lib.measure.report.notes import notes
from thesis_lib.measure.report.shown import shown
from thesis_lib.measure.response.write import alone, over_force
from thesis_lib.outputs import check_cache, check_outputs, put_files
from thesis_lib.studies import storage
from thesis_lib.studies.attributes import with_origin

STEPS = ".steps"  # folder of what is kept between runs
#: All that a measurement may write, as patterns
OUTPUTS = (
    "report.html", "figures/*.*", "vtk/**/*.*", "measured.*", "shapes.*", "motion.*", "modes.*",
    "mode-*.*", "response.*", "radiated.*", "heard-*.wav", "calibration.nc", "cameras.*", "shape.*",
    "tracked.mp4",
)  # fmt: skip


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
    read = [one.file for one in (manifest.calibration, manifest.force) if one is not None]
    read += [manifest.truth] if manifest.truth else []
    there = chain.from_iterable(map(out.glob, OUTPUTS))
    check_outputs(out, there, [folder / name for name in read])
    check_cache(out / STEPS)
    assessment = assess(manifest)
    for line in describe(assessment):
        say(line)
    of = recorded(manifest, folder, out / STEPS, say)
    if manifest.excitation.kind != "tone":
        return _not_one_tone(manifest, folder, of, out, say)
    say("fitting the deflection")
    data, moved = deflection(manifest, of)
    videos = [folder / camera.video for camera in manifest.cameras]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is never seen
        radiated = None
        if manifest.radiation is not None:
            radiated = with_origin(sound_of(data, manifest), data.attrs["source"])
        seen = shown(data, moved, manifest, of.recordings)
        firsts = [next(media.read_frames(video, 0, 1)) for video in videos]
        pictures = report.figures(data, seen, manifest, firsts)
        page = report.page(data, manifest, assessment, pictures, radiated)
    with staging(out) as part:
        storage.write(data, part / "measured.nc")
        storage.write(exactness.to_keep(of.calibration), part / reading.OWN)
        html.write_pictures(part, pictures)
        write_csv(report.table(data), part / "shapes.csv")
        files.write(part, data, moved, of.recordings)
        moving.write(part, data, of.recordings[0], videos[0])
        if radiated is not None:
            radiation_files.write(part, radiated)
        (part / "report.html").write_text(page, encoding="utf-8")
        put_files(part, out)
    for line in [*report.summary(data), *radiation_report.summary(radiated)]:
        say(line)
    for note in notes(data):
        say(f"note: {note.text} [{note.code}]")
    return out / "report.html"


def _not_one_tone(
    manifest: Manifest, folder: Path, of: Recorded, out: Path, say: Callable[[str], object]
) -> Path:
    """Modes, motion over a force, or both; returns the report."""
    section, pictures = "", report.Pictures()
    if manifest.force is not None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is never seen
            section, pictures = over_force(manifest, of.sound, of.recordings, folder, out, say)
    if manifest.excitation.kind in FORCED[1:]:
        left_out = str(of.calibration.attrs["notes"])
        return alone(manifest, of.sound, left_out, section, pictures, out)
    return several(manifest, of.sound, of.calibration, of.recordings, out, say, section, pictures)
