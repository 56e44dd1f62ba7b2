"""Chapter 5's way through the steps of :mod:`thesis_lib.measure.steps`.

Beside the full calibration stands the thesis's own, and markers are followed at several widths.
What comes out is one dataset that the methods work on; nothing here knows the truth.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.measure.calibration.bundle_adjustment import Adjustment, adjust
from thesis_lib.measure.calibration.rig import alike, cameras_in
from thesis_lib.measure.calibration.zhang import central, zhang
from thesis_lib.measure.fitting.reconstruction import checked_frame
from thesis_lib.measure.recordings.board import Board
from thesis_lib.measure.recordings.check import check, markers_of
from thesis_lib.measure.recordings.manifest import ManifestError
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.markers import Markers
from thesis_lib.measure.recordings.media_info import MediaError
from thesis_lib.measure.steps import calibrated, heard, tracked
from thesis_lib.measure.synchronisation.synchronise import whole_frames
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vision.lens import Camera, resized, undistorted

UNEVEN = 0.1  # frames that a time stamp may be off
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


@alike()
def literal(corners: Array, manifest: Manifest) -> Adjustment:
    """The thesis's calibration (Appendices D and E), from corners (cameras, shots, 2, corners), px.

    Zhang's method on the central 5 × 7 squares, whose intrinsics and distortion are kept, and all
    poses refined in common, in the frame of the first shot.
    """
    board = manifest.board.board
    used = corners[..., central(board)]
    small = Board(7, 9, board.tile, board.margin)
    cameras = [
        zhang(list(own), small, camera.size, True, camera.name).camera()
        for own, camera in zip(used, manifest.cameras, strict=True)
    ]
    return adjust(used, small.corners, cameras, intrinsics=False, distortion=False)


def measure(
    manifest: Manifest, folder: Path, steps: Path, widths: Sequence[int] = ()
) -> xr.Dataset:
    """Calibrate, listen and track.

    Parameters
    ----------
    manifest : Manifest
        What the folder holds.
    folder : Path
        The folder.
    steps : Path
        Folder for the steps (:mod:`thesis_lib.measure.steps`).
    widths : sequence of int
        Widths in px at which the frames are tracked; by default the first camera's own.

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
    clocks = check(manifest, folder)
    _check_even(manifest, folder, clocks)
    full = manifest.cameras[0].width_px
    widths = list(widths) or [full]
    calibration, sound = calibrated(manifest, folder, steps), heard(manifest, folder, steps)
    if not sound["force"].values.any():
        raise ManifestError('excitation.sound: given "room", allowed here: "force"')
    shares = [width / full for width in widths]
    followed = tracked(manifest, folder, steps, calibration, sound, clocks, shares)
    data = dataset_of(manifest, widths, calibration, sound, followed)
    check_grid(data, markers_of(manifest))
    return data


def _check_even(manifest: Manifest, folder: Path, clocks: Sequence[Array]) -> None:
    """Refuse frames at uneven times, of which the thesis's methods know nothing."""
    for camera, clock in zip(manifest.cameras, clocks, strict=True):
        gaps = np.diff(clock) * camera.frame_rate_hz
        if np.abs(gaps - 1).max(initial=0) > UNEVEN:
            k = int(np.argmax(np.abs(gaps - 1))) + 1
            raise MediaError(
                f"{folder / camera.video}: variable frame rate: frame {k} comes {gaps[k - 1]:.2f} "
                "frames after the one before, allowed here: a constant rate"
            )


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
    calibration: xr.Dataset,
    sound: xr.Dataset,
    followed: Sequence[Recording],
    corners: Array | None = None,
) -> xr.Dataset:
    """What :func:`measure` returns, from what its steps have found.

    `corners`, shape (cameras, 2), are where the frames begin on the sensors, in px of full size.
    """
    names = [camera.name for camera in manifest.cameras]
    every = [np.load(own.path).swapaxes(0, 1) for own in followed]
    longest = max(own.shape[1] for own in every)
    both = np.full((len(names), 2 * len(widths), longest, *every[0].shape[2:]), np.nan)
    for padded, own in zip(both, every, strict=True):
        padded[:, : own.shape[1]] = own
    tracks, matches = np.moveaxis(both.reshape(len(names), 2, len(widths), *both.shape[2:]), 1, 0)
    if corners is not None:
        shift = np.array(widths)[:, None] / manifest.cameras[0].width_px * corners[:, None]
        tracks, matches = (own + shift[:, :, None, :, None] for own in (tracks, matches))
    thesis = literal(calibration["corners"].values, manifest)
    cameras = [thesis.cameras, cameras_in(calibration)]
    rates = [c.frame_rate_hz for c in manifest.cameras]
    values = {
        "tracks": tracks,
        "matches": matches.astype(np.float32),
        "exposure": [c.exposure_s for c in manifest.cameras],
        "rest": manifest.excitation.rest_s,
        "full_scale": manifest.excitation.force_per_full_scale_n or np.nan,
        "frame_rate": rates,
        "delay_frames": whole_frames(sound["delay"].values, rates[0]),
        **{name: sound[name].values for name in ("delay", "frequency", "force", "steady")},
        **{
            name: [[getattr(c, name) for c in row] for row in cameras]
            for name in ("K", "distortion", "R_camera_world", "centre")
        },
        "size": calibration["size"].values,
        "reprojection_rms": [thesis.rms, float(calibration["reprojection_rms"])],
        "single_rms": calibration["single_rms"].values,
    }
    coords = {
        "camera": ("camera", names, {"long_name": "camera"}),
        "width": ("width", list(widths), {"long_name": "width of the frames in px"}),
        "axis": ("axis", ["u", "v"], {"long_name": "image coordinate"}),
        "calibration": ("calibration", list(CALIBRATIONS), {"long_name": "calibration"}),
    }
    notes = [f"{own.camera.name}: {note}" for own in followed for note in own.notes]
    told = {
        "notes": "\n".join(filter(None, [calibration.attrs["notes"], *notes])),
        "synchronisation": sound.attrs["synchronisation"],
    }
    return xr.Dataset(labelled({name: values[name] for name in VARIABLES}, VARIABLES), coords, told)


def cameras_of(data: xr.Dataset, calibration: str, width: int | None = None) -> list[Camera]:
    """The cameras of a dataset, at full size or reduced to a width."""
    cameras = cameras_in(data.sel(calibration=calibration))
    if width is None:
        return cameras
    return [resized(c, (width, round(width * c.size[1] / c.size[0]))) for c in cameras]
