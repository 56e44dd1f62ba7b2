"""The laboratory rendered and measured, with what only a rendered laboratory knows: the truth.

The videos of one run take half a gigabyte; they are made in a temporary folder and not kept. What
is kept are the tracks, the calibrations, a few pictures, and how far each step is from the truth.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment import chain
from thesis_lib.figure_sets.experiment.parameters import Laboratory
from thesis_lib.files import staging, workplace
from thesis_lib.laboratory.direct import WRONG, true_centres
from thesis_lib.laboratory.film import film
from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import Rig, default_rig
from thesis_lib.measure.calibration.alignment import align
from thesis_lib.measure.calibration.corners import find_corners
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.measure.recordings.pictures import read_png
from thesis_lib.measure.steps import calibrated
from thesis_lib.measure.tracking import follow as following
from thesis_lib.measure.tracking.homography import find_view
from thesis_lib.measure.tracking.tracker import Tracker, assign, sharpen
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vibration.motion import Component
from thesis_lib.vision import lens

TRUTH = declared("""
    true_delay(camera) [s] true start after the reference's
    missing_share(width) [1] share of marker images that are missing
    wrong_share(width) [1] share of those found that are more than 1 px off
    centre_error(width) [px] rms error of a coordinate of the others
    focal_error_single(camera, axis) [percent] error of the focal lengths, single calibration
    focal_error_literal(camera, axis) [percent] error of the focal lengths, literal calibration
    centre_error_literal(camera) [m] error of the centres, literal, cameras aligned as a body
    focal_error_full(camera, axis) [percent] error of the focal lengths, full calibration
    centre_error_full(camera) [m] error of the centres, full, cameras aligned as a body
    centre_deviation(camera) [m] standard deviation of the centres of projection that the adjustment
        predicts
    shots_used(camera) [1] pictures of the board that were used
    adjusted_corners(camera, shot, axis, corner) [px] corners of the board as they were found
    corner_residuals(camera, shot, axis, corner) [px] corners seen minus computed after the
        adjustment
""")


def rig_of(request: Laboratory) -> Rig:
    """The rig that the parameters describe."""
    return default_rig(
        setups.beam(),
        list(request.directions_deg.values()),
        focal_length=request.focal_length_mm / 1000,
        sensor_width=request.sensor_width_mm / 1000,
        distance=request.distance_mm / 1000,
        sensor=Sensor(
            exposure=request.exposure_ms / 1000, shot=request.shot_noise, read=request.read_noise
        ),
        frame_rate=request.frame_rate_hz,
        components=(Component("bending", 1, request.frequency_hz, request.amplitude_mm / 1000),),
        lens_k1=request.lens_k1,
        audio_noise_db=request.audio_noise_db,
        seed=request.seed,
    )


def codec_of(request: Laboratory) -> Literal["ffv1", "h264"]:
    """How the videos are kept."""
    return "h264" if request.codec == "h264" else "ffv1"


def run(request: Laboratory) -> xr.Dataset:
    """Film, measure, and compare with the truth.

    Returns
    -------
    xarray.Dataset
        What :func:`~thesis_lib.figure_sets.experiment.chain.measure` returns, and the errors of its
        steps; pictures for the book.
    """
    rig = rig_of(request)
    with staging(workplace() / "build" / "cache") as folder:
        path = film(rig, folder, codec_of(request))
        manifest = read_manifest(path)
        data = chain.measure(manifest, folder, folder / "steps", request.widths_px)
        calibration = calibrated(manifest, folder, folder / "steps").load()
        pictures = _pictures(rig, chain.cameras_of(data, "full")[0], folder)
        data = data.merge(pictures, combine_attrs="override")
        data.attrs.update(pictures.attrs)
    _add_truth(data, rig, calibration)
    return data


def true_tracks(rig: Rig, frames: int, width: int) -> Array:
    """Where the markers were, (cameras, frames, 2, markers), in px of frames of a width."""
    tracks = [
        true_centres(rig, station, station.start + np.arange(frames) / station.frame_rate)
        for station in rig.stations
    ]
    return np.array(tracks) * width / rig.stations[0].camera.size[0]


def _add_truth(data: xr.Dataset, rig: Rig, calibration: xr.Dataset) -> None:
    """The errors of every step against the truth, as variables of the dataset."""
    starts = np.array([station.start for station in rig.stations])
    missing, wrong, rms = [], [], []
    for width in data["width"].values:
        tracks = data["tracks"].sel(width=width).values
        error = tracks - true_tracks(rig, tracks.shape[1], int(width))
        off = np.hypot(error[:, :, 0], error[:, :, 1])
        seen = np.isfinite(off)
        missing.append(1 - np.mean(seen))
        wrong.append(np.mean(off[seen] > WRONG) if seen.any() else np.nan)
        right = off[seen & (np.nan_to_num(off, nan=np.inf) <= WRONG)]
        rms.append(np.sqrt(np.mean(right**2) / 2) if right.size else np.nan)
    focal = np.array([[c.K[0, 0], c.K[1, 1]] for c in rig.cameras])
    corners = calibration["corners"].values
    values = {
        "true_delay": starts - starts[0],
        "missing_share": missing,
        "wrong_share": wrong,
        "centre_error": rms,
        "focal_error_single": 100 * (calibration["single_focal"].values / focal - 1),
        "centre_deviation": calibration["centre_deviation"].values,
        "shots_used": np.isfinite(corners[:, :, 0, 0]).sum(axis=1, dtype=float),
        "adjusted_corners": corners,
        "corner_residuals": calibration["residuals"].values,
    }
    for kind in chain.CALIBRATIONS:
        cameras = chain.cameras_of(data, kind)
        found = np.array([[c.K[0, 0], c.K[1, 1]] for c in cameras])
        values[f"focal_error_{kind}"] = 100 * (found / focal - 1)
        values[f"centre_error_{kind}"] = np.linalg.norm(align(cameras, rig.cameras)[1], axis=1)
    data.update(labelled({name: values[name] for name in TRUTH}, TRUTH))


def _pictures(rig: Rig, camera: lens.Camera, folder: Path) -> xr.Dataset:
    """Pictures of the chain's steps for the first camera, and small ones of the others."""
    names = [c.name for c in rig.cameras]
    maximum = rig.motion.steady + 0.25 / rig.motion.components[0].frequency
    peak = round((maximum - rig.stations[0].start) * rig.stations[0].frame_rate)
    first = {name: next(media.read_frames(folder / f"{name}.mkv", 0, 1)) for name in names}
    moved = next(media.read_frames(folder / f"{names[0]}.mkv", peak, peak + 1))
    shot = read_png(folder / names[0] / "01.png")
    corners = find_corners(shot, rig.board)
    view = sharpen(first[names[0]], find_view(first[names[0]], camera, rig.markers))
    tracker = Tracker(view)
    matches = tracker.matches(first[names[0]])
    _, spare = assign(rig.markers.positions, matches, tracker.gate)
    quarter = [following.reduced(first[name], camera.size[0] // 4) for name in names]
    low = following.reduced(first[names[0]], 320)
    sound = np.array([media.read_audio(folder / f"{name}.mkv")[0][::48] for name in names])
    data = xr.Dataset(
        {
            "picture_first": (("row", "column"), first[names[0]]),
            "picture_moved": (("row", "column"), moved),
            "picture_shot": (("row", "column"), shot),
            "picture_corners": (("axis", "corner"), corners),
            "picture_all": (("camera", "row4", "column4"), np.array(quarter)),
            "picture_low": (("row_low", "column_low"), low),
            "picture_beam": (("row_beam", "column_beam"), tracker.resampled(first[names[0]])),
            "picture_matches": (("axis", "match"), matches),
            "picture_centres": (("axis", "marker"), tracker.centres(first[names[0]])),
            "picture_outline": (
                ("axis", "outline"),
                view.to_image(rig.markers.corners),
            ),
            "picture_sound": (("camera", "sample"), sound),
        },
    )
    data.attrs["spare_matches"] = spare
    data["picture_sound"].attrs["rate_hz"] = 1000.0
    data["picture_moved"].attrs["frame"] = peak
    return data
