"""The whole chain on a folder of recordings: check, calibrate, listen, track, fit, report."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from tqdm import tqdm

from thesis_lib import __version__
from thesis_lib.files import staging
from thesis_lib.measure.calibration.alignment import camera_deviations
from thesis_lib.measure.calibration.rig import adjusted, alike, cameras_in
from thesis_lib.measure.exchange import files, history
from thesis_lib.measure.feasibility.assess import assess
from thesis_lib.measure.feasibility.describe import describe
from thesis_lib.measure.fitting.result import result
from thesis_lib.measure.recordings import check as recordings_check
from thesis_lib.measure.recordings.check import ChainError, markers_of
from thesis_lib.measure.recordings.manifest import (
    ManifestError,
    on_one_line,
    read_manifest,
    shot_paths,
)
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import moving
from thesis_lib.measure.report import page as report
from thesis_lib.measure.synchronisation.listen import listen
from thesis_lib.measure.tracking.tracks import Recording, record
from thesis_lib.studies import storage
from thesis_lib.studies.attributes import with_origin
from thesis_lib.studies.cache import kept, key_of
from thesis_lib.studies.parallel import abreast
from thesis_lib.studies.variables import declared, labelled

STEPS = ".steps"  # folder of what is kept between runs
CALIBRATION = declared("""
    reprojection_rms() [px] rms residual of a coordinate of the board's corners
    single_rms(camera) [px] the same of each camera calibrated alone
    focal_deviation(camera) [px] standard deviation of the focal length
    centre_deviation(camera) [m] standard deviation of the centre of projection
    K(camera, i, j) [px] intrinsic matrix
    distortion(camera, coefficient) [1] k1, k2, p1, p2, k3
    size(camera, side) [px] width and height of the pictures
    residuals(camera, shot, side, corner) [px] corners seen minus computed
    corners(camera, shot, side, corner) [px] corners of the board as they were found
    R_camera_world(camera, i, j) [1] rotation from the first board to the camera
    centre(camera, i) [m] centre of projection in the first board's frame
""")
SOUND = declared("""
    delay(camera) [s] start after the first camera's
    steady(end) [s] steady part on the first camera's clock
    ambiguous() [1] whether the delays are in doubt by whole periods
    signal_to_noise() [1] signal over noise of the sound, power
    force(part) [1] amplitude of the force's signal over full scale, real and imaginary part
    frequency() [Hz] frequency of the force
    of_sound() [Hz] frequency of the force's signal
    of_sound_deviation() [Hz] its standard error
""")
SHOTS = declared("shots_used(camera) [1] pictures of the board that were used")
UNKEPT = {"R_camera_world", "centre", "frequency", "of_sound", "of_sound_deviation"}


class StoppedError(RuntimeError):
    """What tells the thread of one camera that another has failed, or the user wants to stop."""


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
    CalibrationError, SynchronisationError, TrackingError, ChainError, FrequencyError
        If what was recorded does not suffice; one line that says what is missing.
    """
    manifest, folder = read_manifest(path), path.parent
    assessment = assess(manifest)
    for line in describe(assessment):
        say(line)
    say(f"checking {len(manifest.cameras)} videos")
    counts = recordings_check.check(manifest, folder)  # what it refuses leaves no trace
    steps = out / STEPS
    sound = heard(manifest, folder, steps, say)  # first: it may refuse more of the manifest
    calibration = calibrated(manifest, folder, steps, say)
    recordings = tracked(manifest, folder, steps, calibration, sound, counts)
    say("fitting the deflection")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is never seen
        data = result(manifest, sound, recordings)
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
            history.motion(data, recordings, manifest.excitation.rest_s), data.attrs["source"]
        )
        pictures = report.figures(data, moved, manifest, recordings, folder)
        page = report.page(data, manifest, assessment, pictures)
    with staging(out) as part:
        (part / "figures").mkdir()
        storage.write(data, part / "measured.nc")
        for name, (kind, content) in pictures.items():
            (part / "figures" / f"{name}.{kind}").write_bytes(content)
        report.table(data).to_csv(part / "shapes.csv", index=False)
        files.write(part, data, moved)
        moving.write(part, data, recordings[0], folder / manifest.cameras[0].video)
        (part / "report.html").write_text(page, encoding="utf-8")
        move(part, out)
    for line in report.summary(data):
        say(line)
    return out / "report.html"


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


def move(part: Path, out: Path) -> None:
    """Move all files of a folder to another, each in place of the one that is there."""
    files = [path.relative_to(part) for path in part.rglob("*") if path.is_file()]
    for folder in {file.parent for file in files}:
        (out / folder).mkdir(parents=True, exist_ok=True)
    for file in files:
        (part / file).replace(out / file)


def calibrated(
    manifest: Manifest, folder: Path, steps: Path, say: Callable[[str], object]
) -> xr.Dataset:
    """The cameras, adjusted together from all pictures of the board."""
    rows = [shot_paths(camera, folder) for camera in manifest.cameras]
    shots = [shot for row in rows for shot in row if shot]
    what = [manifest.board.model_dump(mode="json")] + [
        [c.name, c.size, [shot and shot.name for shot in row]]
        for c, row in zip(manifest.cameras, rows, strict=True)
    ]

    def compute() -> xr.Dataset:
        say(f"calibrating from {len(shots)} pictures of the board")
        with tqdm(total=len(shots), unit="picture", disable=None, leave=False) as bar:
            corners, lost, single, full = adjusted(manifest, folder, lambda: bar.update())
        poses = ("K", "distortion", "R_camera_world", "centre", "size")
        values = {name: [getattr(c, name) for c in full.cameras] for name in poses} | {
            "reprojection_rms": full.rms,
            "single_rms": [c.rms for c in single],
            "focal_deviation": full.deviations[:, 0],
            "centre_deviation": np.linalg.norm(camera_deviations(full)[0], axis=1),
            "corners": corners,
            "residuals": full.residuals,
        }
        names = {"camera": [c.name for c in manifest.cameras]}
        return xr.Dataset(labelled(values, CALIBRATION), names, {"notes": "\n".join(lost)})

    return kept(steps, "calibration", key_of(what, shots), compute)


def heard(
    manifest: Manifest, folder: Path, steps: Path, say: Callable[[str], object]
) -> xr.Dataset:
    """When the cameras started, and what the sound tells of the vibration."""
    videos = [folder / c.video for c in manifest.cameras]
    what = [
        manifest.excitation.model_dump(mode="json"),
        [c.name for c in manifest.cameras],
        [c.frame_rate_hz for c in manifest.cameras],
    ]

    def compute() -> xr.Dataset:
        say(f"listening to {len(videos)} sound tracks")
        sound = listen(manifest, folder)
        found, rest = sound.synchronisation, manifest.excitation.rest_s
        most = max(sound.steady[0] - max(float(found.delays.max()), 0.0), 0.0)
        if manifest.excitation.steady_s is None and rest > most + 1e-6:
            raise ManifestError(
                f"excitation.rest_s: given {rest:.6g}, allowed: at most the {most:.3f} s after "
                "which the vibration is steady"
            )
        force = sound.force or 0j
        values = {
            "delay": found.delays,
            "frequency": sound.frequency or np.nan,
            "of_sound": sound.found_frequency or np.nan,
            "of_sound_deviation": sound.frequency_deviation or np.nan,
            "force": [force.real, force.imag],
            "steady": sound.steady,
            "ambiguous": int(found.ambiguous),
            "signal_to_noise": found.snr,
        }
        data = xr.Dataset(labelled(values, SOUND))
        return data.assign_attrs(
            synchronisation="\n".join(found.describe([c.name for c in manifest.cameras]))
        )

    return kept(steps, "sound", key_of(what, videos), compute)


def tracked(
    manifest: Manifest,
    folder: Path,
    steps: Path,
    calibration: xr.Dataset,
    sound: xr.Dataset,
    counts: list[int],
) -> list[Recording]:
    """The markers followed through all videos of so many frames, two cameras at a time."""
    markers, cameras = markers_of(manifest), cameras_in(calibration)
    frequency = float(np.nan_to_num(sound["frequency"]))
    visible = manifest.structure.model_dump(
        mode="json", include={"length_mm", "width_mm", "markers"}
    )
    stop = threading.Event()
    with tqdm(total=sum(counts), unit="frame", desc="tracking", disable=None, leave=False) as bar:

        def tick(frames: int) -> None:
            if stop.is_set():
                raise StoppedError
            bar.update(frames)

        def one(index: int) -> Recording:
            files = manifest.cameras[index]
            path = steps / f"tracks-{index:02d}.npy"
            turn = round(2 * np.pi * frequency / files.frame_rate_hz, 3)  # to look near the place
            what = [files.corners_px, turn, visible, index, calibration.attrs["key"]]
            key = key_of(what, [folder / files.video])
            record(files, folder, counts[index], cameras[index], markers, turn, path, key, tick)
            return Recording(
                cameras[index],
                files.frame_rate_hz,
                float(sound["delay"][index]),
                files.exposure_s,
                files.readout_s,
                path,
            )

        with alike():
            return abreast(one, range(len(cameras)), stop.set)


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
