"""Cached steps from recordings to tracks: calibrate, estimate delays from audio, track."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from tqdm import tqdm

from thesis_lib.arrays import Array
from thesis_lib.files import mark_cache
from thesis_lib.measure.calibration import bundle_adjustment as bundle, rig, uncertainty
from thesis_lib.measure.recordings.manifest import Manifest, image_paths
from thesis_lib.measure.recordings.validation import markers_of
from thesis_lib.measure.synchronisation.listen import estimate_delays
from thesis_lib.measure.tracking.tracks import Recording, record_track
from thesis_lib.studies import schema, storage, workers
from thesis_lib.vision.pinhole import Camera

CALIBRATION_VARIABLES = schema.read_variables(__file__, "calibration")


def calibrate_rig(
    manifest: Manifest,
    folder: Path,
    steps: Path,
    say: Callable[[str], object] = str,
    lenses: Sequence[Camera] = (),
    lens_covariance: Array | None = None,
) -> xr.Dataset:
    """Calibrate all cameras jointly from board images; with given `lenses`, only their poses.

    Standard deviations and covariance are those of
    :func:`thesis_lib.measure.calibration.uncertainty.jackknife_rig`.
    """
    rows = [image_paths(camera, folder) for camera in manifest.cameras]
    shots = [shot for row in rows for shot in row if shot]
    what = [manifest.board.model_dump(mode="json")] + [
        [c.name, c.size, [shot and shot.name for shot in row]]
        for c, row in zip(manifest.cameras, rows, strict=True)
    ]
    what += [[lens.K.tolist(), lens.distortion.tolist()] for lens in lenses]
    what += [[] if lens_covariance is None else lens_covariance.tolist()]

    def compute_calibration() -> xr.Dataset:
        say(f"calibrating from {len(shots)} images of the board")
        with tqdm(total=len(shots), unit="picture", disable=None, leave=False) as bar:
            corners, lost, single, full = rig.adjust_cameras(manifest, folder, bar.update, lenses)
        jackknifed = uncertainty.jackknife_rig(corners, manifest.board.board, full, lens_covariance)
        used = np.isfinite(corners).any(axis=(2, 3))
        poses = ("K", "distortion", "R_camera_world", "centre", "size")
        values = {name: [getattr(c, name) for c in full.cameras] for name in poses} | {
            "reprojection_rms": full.rms,
            "single_rms": [c.rms for c in single],
            "single_focal": [c.lens.K[[0, 1], [0, 1]] for c in single],
            "adjusted_centre_deviation": _centre_deviations(full),
            "focal_deviation": jackknifed.deviations[:, 0],
            "centre_deviation": _centre_deviations(jackknifed),
            "covariance": jackknifed.covariance,
            "corners": corners,
            "residuals": full.residuals,
            "board_poses": used.any(axis=0).sum(),
            "shots_used": used.sum(axis=1),
        }
        variables = schema.label_values(values, CALIBRATION_VARIABLES)
        names = {"camera": [c.name for c in manifest.cameras]}
        return xr.Dataset(variables, names, {"notes": "\n".join(lost)})

    return storage.load_or_compute(
        steps / "calibration.nc", compute_calibration, storage.key_of(what, shots)
    )


def _centre_deviations(adjustment: bundle.Adjustment) -> Array:
    """Return the standard deviation of each camera's centre of projection, m."""
    return np.linalg.norm(bundle.camera_deviations(adjustment, adjustment.covariance)[0], axis=1)


def read_sound(
    manifest: Manifest, folder: Path, steps: Path, say: Callable[[str], object] = str
) -> xr.Dataset:
    """Return the cameras' start times, and the vibration's frequency and phase from the audio."""
    videos = [folder / c.video for c in manifest.cameras]
    names = [c.name for c in manifest.cameras]
    rates = [c.frame_rate_hz for c in manifest.cameras]
    what = [manifest.excitation.model_dump(mode="json"), names, rates]

    def compute_sound() -> xr.Dataset:
        if manifest.excitation.sound != "none":
            say(f"listening to {len(videos)} sound tracks")
        data = estimate_delays(manifest, folder)
        mark_cache(steps)  # after all checks have passed
        return data

    return storage.load_or_compute(steps / "sound.nc", compute_sound, storage.key_of(what, videos))


def track_markers(
    manifest: Manifest,
    folder: Path,
    steps: Path,
    calibration: xr.Dataset,
    sound: xr.Dataset,
    clocks: Sequence[Array],
    shares: Sequence[float] = (),
) -> list[Recording]:
    """Track the markers through all videos, two cameras at a time.

    `clocks` are each camera's frame times in s. With `shares`, frames are reduced to these shares
    of their width, see :func:`thesis_lib.measure.tracking.tracks.record_track`.
    """
    markers, cameras = markers_of(manifest), rig.cameras_in(calibration)
    frequency = float(np.nan_to_num(sound["frequency"]))
    seen = {"length_mm", "width_mm", "markers"}
    visible = manifest.structure.model_dump(mode="json", include=seen)
    stop = threading.Event()

    def track_camera(index: int) -> Recording:
        files, done = manifest.cameras[index], 0
        path = steps / f"tracks-{index:02d}.npy"
        turn = round(2 * np.pi * frequency / files.frame_rate_hz, 9)  # rad a frame, for prediction
        what = [files.corners_px, turn, visible, index, calibration.attrs["key"], *shares]

        def tick(frames: int) -> None:
            nonlocal done
            if stop.is_set():
                raise RuntimeError("another camera has failed, or the user wants to stop")
            bar.update(frames - done)
            done = frames

        def compute_tracks() -> xr.Dataset:
            notes, repeats = record_track(
                files, folder, clocks[index], cameras[index], markers, turn, path, tick, shares
            )
            return xr.Dataset({"repeats": ("repeat", repeats)}, attrs={"notes": "\n".join(notes)})

        key = storage.key_of(what, [folder / files.video])
        found = storage.load_or_compute(path.with_suffix(".nc"), compute_tracks, key, [path])
        tick(len(clocks[index]))  # if an earlier run has tracked them
        return Recording(
            cameras[index],
            files.frame_rate_hz,
            float(sound["delay"][index]),
            files.exposure_s,
            files.readout_s,
            path,
            found.attrs["notes"].splitlines(),
            clocks[index],
            repeats=found["repeats"].values,
        )

    total = sum(map(len, clocks))
    with (
        rig.single_threaded_opencv(),
        tqdm(total=total, unit="frame", desc="tracking", disable=None, leave=False) as bar,
    ):
        return workers.map_in_two_threads(track_camera, range(len(clocks)), stop.set)
