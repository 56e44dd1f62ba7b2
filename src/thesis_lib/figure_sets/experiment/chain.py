"""The whole chain on a folder of recordings: calibrate, synchronise, track.

What comes out is one dataset that the reconstruction works on; nothing here knows the truth.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust
from thesis_lib.measure.calibration.rig import adjusted, alike, cameras_in
from thesis_lib.measure.calibration.zhang import Calibration, central, zhang
from thesis_lib.measure.fitting.reconstruction import checked_frame
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.recordings.check import check, markers_of
from thesis_lib.measure.recordings.manifest import ManifestError
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.markers import Markers
from thesis_lib.measure.synchronisation.listen import Sound, listen
from thesis_lib.measure.tracking.follow import follow
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vision.lens import Camera, resized, undistorted

Followed = tuple[Array, Array, list[str]]
CALIBRATIONS = ("literal", "full")
VARIABLES = declared("""
    tracks(camera, width, frame, axis, marker) [px] marker centres, lens distortion included
    matches(camera, width, frame, axis, marker) [px] the same as the template match alone has them
    exposure(camera) [s] exposure time
    rest() [s] time at rest at the start
    full_scale() [N] force at full scale of the audio tracks
    frame_rate(camera) [Hz] frame rate
    delay(camera) [s] start after the reference camera's
    delay_frames(camera) [1] the same in whole frames
    frequency() [Hz] frequency of the force
    force(part) [1] amplitude of the force over full scale, real and imaginary part
    steady(end) [s] steady part on the reference camera's clock
    K(calibration, camera, i, j) [px] intrinsic matrix
    distortion(calibration, camera, coefficient) [1] k1, k2, p1, p2, k3
    R_camera_world(calibration, camera, i, j) [1] rotation from the first board to the camera
    centre(calibration, camera, i) [m] centre of projection in the first board's frame
    size(camera, axis) [px] size of the frames
    reprojection_rms(calibration) [px] rms residual of a coordinate
    single_rms(camera) [px] rms residual of a coordinate, camera by camera
""")


@dataclass(frozen=True)
class Calibrations:
    """The cameras, calibrated alone, as in the thesis, and all together."""

    #: Corners in px in one order, NaN where the board was not found, shape
    #: (cameras, shots, 2, corners)
    corners: Array
    lost: list[str]  #: Which shots were not used, and why
    single: list[Calibration]  #: Zhang's method, camera by camera, with all corners
    #: The thesis's way: Zhang's method on the central 5 × 7 squares, whose intrinsics and
    #: distortion are kept, and all poses refined in common, in the frame of the first shot
    literal: Adjustment
    full: Adjustment  #: All corners, intrinsics and distortion adjusted too


def calibrate(manifest: Manifest, folder: Path) -> Calibrations:
    """All cameras from the pictures of the board, in full and as the thesis did.

    Raises
    ------
    CalibrationError
        If the shots do not determine the cameras.
    MediaError
        If a picture cannot be read.
    """
    board = manifest.board.board
    corners, lost, single, full = adjusted(manifest, folder)
    with alike():
        literal = _literal(corners, board, manifest)
    return Calibrations(corners, lost, single, literal, full)


def _literal(corners: Array, board: Board, manifest: Manifest) -> Adjustment:
    """The thesis's calibration (Appendices D and E)."""
    part = central(board)
    used = corners[..., part]
    small = Board(7, 9, board.tile, board.margin)
    cameras = [
        zhang(list(own), small, camera.size, True, camera.name).camera()
        for own, camera in zip(used, manifest.cameras, strict=True)
    ]
    return adjust(used, small.corners, cameras, intrinsics=False, distortion=False)


def measure(
    manifest: Manifest,
    folder: Path,
    widths: Sequence[int] = (),
    calibrations: Calibrations | None = None,
) -> xr.Dataset:
    """Calibrate, listen and track.

    Parameters
    ----------
    manifest : Manifest
        What the folder holds.
    folder : Path
        The folder.
    widths : sequence of int
        Widths in px at which the frames are tracked; by default the first camera's own.
    calibrations : Calibrations, optional
        What :func:`calibrate` returned for this folder, if that has been done.

    Returns
    -------
    xarray.Dataset
        Dimensions ``camera``, ``width``, ``frame``, ``axis``, ``marker``, ``calibration``:
        centres in px (distortion included), both calibrations, delays, force.

    Raises
    ------
    ManifestError, MediaError
        If the files are not what the manifest says, or cannot be read.
    CalibrationError, SynchronisationError, TrackingError
        If the shots, the sound or the markers do not suffice.
    ChainError
        If what the cameras see does not fit together.
    """
    check(manifest, folder)
    widths = list(widths) or [manifest.cameras[0].width_px]
    markers = markers_of(manifest)
    calibrations = calibrations or calibrate(manifest, folder)
    sound = listen(manifest, folder)
    frequency, full = sound.frequency, calibrations.full.cameras
    if sound.force is None or frequency is None:
        raise ManifestError('excitation.sound: given "room", allowed here: "force"')

    def one(index: int) -> Followed:
        files = manifest.cameras[index]
        turn = 2 * np.pi * frequency / files.frame_rate_hz
        return follow(folder / files.video, full[index], markers, widths, files.corners_px, turn)

    with alike(), ThreadPoolExecutor(2) as pool:
        followed = list(pool.map(one, range(len(manifest.cameras))))
    data = dataset_of(manifest, widths, calibrations, sound, followed)
    check_grid(data, markers)
    return data


def check_grid(data: xr.Dataset, markers: Markers) -> None:
    """Refuse cameras whose views of the resting markers do not fit the nominal grid.

    Raises
    ------
    ChainError
        With the camera that fits worst.
    """
    tracks = data["tracks"].sel(width=data["width"].max()).values
    still = np.arange(tracks.shape[1]) < float(data["rest"]) * data["frame_rate"].values[:, None]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is never seen
        raw = [np.nanmean(own[mask], axis=0) for own, mask in zip(tracks, still, strict=True)]
    cameras = cameras_of(data, "full", int(data["width"].max()))
    rest = np.array([undistorted(c, own) for c, own in zip(cameras, raw, strict=True)])
    checked_frame(cameras, rest, markers)


def dataset_of(
    manifest: Manifest,
    widths: Sequence[int],
    calibrations: Calibrations,
    sound: Sound,
    followed: Sequence[Followed],
) -> xr.Dataset:
    """What :func:`measure` returns, from what its steps have found."""
    names = [camera.name for camera in manifest.cameras]
    longest = max(centres.shape[1] for centres, *_ in followed)
    shape = (len(names), len(widths), longest, *followed[0][0].shape[2:])
    tracks, matches = np.full((2, *shape), np.nan)
    for i, (centres, matched, _) in enumerate(followed):
        tracks[i, :, : centres.shape[1]] = centres
        matches[i, :, : centres.shape[1]] = matched
    both = [getattr(calibrations, name) for name in CALIBRATIONS]
    found = sound.synchronisation
    force = sound.force or 0j
    cameras = [adjusted.cameras for adjusted in both]
    values = {
        "tracks": tracks,
        "matches": matches.astype(np.float32),
        "exposure": [c.exposure_s for c in manifest.cameras],
        "rest": manifest.excitation.rest_s,
        "full_scale": manifest.excitation.force_per_full_scale_n or np.nan,
        "frame_rate": [c.frame_rate_hz for c in manifest.cameras],
        "delay": found.delays,
        "delay_frames": found.frames,
        "frequency": sound.frequency,
        "force": [force.real, force.imag],
        "steady": sound.steady,
        **{
            name: [[getattr(c, name) for c in row] for row in cameras]
            for name in ("K", "distortion", "R_camera_world", "centre")
        },
        "size": [c.size for c in cameras[1]],
        "reprojection_rms": [adjusted.rms for adjusted in both],
        "single_rms": [c.rms for c in calibrations.single],
    }
    coords = {
        "camera": ("camera", names, {"long_name": "camera"}),
        "width": ("width", list(widths), {"long_name": "width of the frames in px"}),
        "axis": ("axis", ["u", "v"], {"long_name": "image coordinate"}),
        "calibration": ("calibration", list(CALIBRATIONS), {"long_name": "calibration"}),
    }
    data = xr.Dataset(labelled(values, VARIABLES), coords)
    data.attrs["notes"] = "\n".join(
        calibrations.lost
        + [f"{name}: {note}" for name, own in zip(names, followed, strict=True) for note in own[2]]
    )
    data.attrs["synchronisation"] = "\n".join(found.describe())
    return data


def cameras_of(data: xr.Dataset, calibration: str, width: int | None = None) -> list[Camera]:
    """The cameras of a dataset, at full size or reduced to a width."""
    cameras = cameras_in(data.sel(calibration=calibration))
    if width is None:
        return cameras
    return [resized(c, (width, round(width * c.size[1] / c.size[0]))) for c in cameras]
