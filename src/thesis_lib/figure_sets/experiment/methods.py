"""Measurement of chapter 5's recordings by the steps of :mod:`thesis_lib.measure.steps`.

Cameras are calibrated in full and as in the thesis, and markers are tracked at several widths. The
methods of chapter 5 work on the resulting dataset; nothing here uses the truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, IntArray, stack_padded
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment.figure_set import Way
from thesis_lib.measure.calibration import bundle_adjustment, rig
from thesis_lib.measure.fitting import harmonics as fits, reconstruction as rc
from thesis_lib.measure.recordings.board import Board, rows_on
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.validation import check_files, clock_of
from thesis_lib.measure.steps import calibrate_rig, read_sound, track_markers
from thesis_lib.measure.synchronisation.listen import whole_frames
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.vision import pinhole

CALIBRATION_METHODS = ("literal", "full")
RECORDING_VARIABLES = read_variables(__file__, "recording")


@rig.single_threaded_opencv()
def calibrate_centrally(corners: Array, manifest: Manifest) -> bundle_adjustment.Adjustment:
    """Calibrate as the thesis does (Appendices D and E), from corners in px.

    Zhang's method uses the central 5 × 7 squares; then all poses are refined together, in the frame
    of the first calibration image.
    """
    board = manifest.board.board
    used = corners[..., rig.central_corners(board)]
    small = Board(7, 9, board.tile, board.margin)
    cameras = [
        rig.calibrate_camera(list(own), small, camera.size, camera.name).lens
        for own, camera in zip(used, manifest.cameras, strict=True)
    ]
    return bundle_adjustment.adjust_bundle(used, small.corners, cameras, lenses=False)


def measure_recordings(
    manifest: Manifest,
    folder: Path,
    steps: Path,
    widths: Sequence[int],
    windows: Sequence[tuple[Array, tuple[int, int]]] = (),
) -> xr.Dataset:
    """Calibrate, synchronise and track a recording, at some widths in px.

    Videos may hold parts of the sensors: `windows` are the corner and size of each in px.

    Returns
    -------
    xarray.Dataset
        Dimensions ``camera``, ``width``, ``frame``, ``axis``, ``marker``, ``calibration``:
        centres in px (distortion included), both calibrations, delays, force.
    """
    calibration, sound = calibrate_rig(manifest, folder, steps), read_sound(manifest, folder, steps)
    seen, corners = calibration, np.zeros((len(manifest.cameras), 2))
    if windows:  # their frames are smaller than the manifest states
        clocks = [clock_of(camera, folder) for camera in manifest.cameras]
        corners, sizes = (np.array(part) for part in zip(*windows, strict=True))
        K = calibration["K"].copy(deep=True)
        K.values[:, :2, 2] -= corners
        seen = calibration.assign(K=K, size=calibration["size"].copy(data=sizes))
    else:
        clocks = check_files(manifest, folder)
    shares = np.array(widths) / manifest.cameras[0].width_px
    followed = track_markers(manifest, folder, steps, seen, sound, clocks, shares.tolist())
    names = [camera.name for camera in manifest.cameras]
    both = stack_padded(np.load(own.path).swapaxes(0, 1) for own in followed)
    both = both.reshape(len(names), 2, len(widths), *both.shape[2:])
    both += (shares[:, None] * corners[:, None])[:, None, :, None, :, None]  # on whole sensors
    thesis = calibrate_centrally(calibration["corners"].values, manifest)
    cameras = [thesis.cameras, rig.cameras_in(calibration)]
    rates = [c.frame_rate_hz for c in manifest.cameras]
    values = {
        "tracks": both[:, 0],
        "matches": both[:, 1].astype(np.float32),
        "exposure": [c.exposure_s for c in manifest.cameras],
        "rest": manifest.excitation.rest_duration_s,
        "full_scale": manifest.excitation.force_per_full_scale_n,
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
        "calibration": ("calibration", list(CALIBRATION_METHODS), {"long_name": "calibration"}),
    }
    notes = [f"{own.camera.name}: {note}" for own in followed for note in own.notes]
    attributes = {
        "notes": "\n".join(filter(None, [calibration.attrs["notes"], *notes])),
        "synchronisation": sound.attrs["synchronisation"],
    }
    return xr.Dataset(label_values(values, RECORDING_VARIABLES), coords, attributes)


def read_cameras(
    data: xr.Dataset, calibration: str, width: int | None = None
) -> list[pinhole.Camera]:
    """Return the cameras of a dataset, at full size or reduced to a width."""
    cameras = rig.cameras_in(data.sel(calibration=calibration))
    if width is None:
        return cameras
    return [
        pinhole.resize_camera(c, (width, round(width * c.size[1] / c.size[0]))) for c in cameras
    ]


MAX_HARMONIC_ORDER = 2  # harmonics that are fitted
INTERPOLATED_FRAMES = 6  # frames that are interpolated


@dataclass(frozen=True)
class Tracks(fits.Fitted):
    """Tracks of the chosen cameras at one width, ready for triangulation."""

    uv: Array  #: Marker centres without distortion, px, shape (cameras, frames, 2, markers)
    times: Array  #: On the reference camera's clock, s, shape (cameras, frames)
    #: Delays to the first of these cameras in whole frames (eq. 5.2), shape (cameras,)
    frames: IntArray
    rest_frames: int  #: Number of frames averaged in `rest`

    @property
    def rate(self) -> float:
        """Return the frames per second of the first camera."""
        return float(1 / (self.times[0, 1] - self.times[0, 0]))


def select_tracks(data: xr.Dataset, way: Way) -> Tracks:
    """Return the tracks for one way of measuring, undistorted by its method's calibration.

    The method *matched* uses the centres of the template match: at rest those of the first frame;
    in motion their scatter is that about the harmonics of the fitted centres.
    """
    (method, names, width), markers = way, rows_on(setups.thesis_beam())
    data = data.sel(camera=list(names))
    cameras = read_cameras(data, "full" if method == "harmonic" else "literal", width)
    uv = _undistort_tracks(cameras, data["tracks"].sel(width=width).values)
    rates, delays = data["frame_rate"].values, data["delay"].values
    own_times = np.arange(uv.shape[1]) / rates[:, None]
    times = own_times + delays[:, None]
    omega = 2 * np.pi * float(data["frequency"])
    begin, end = data["steady"].values
    # Frames cannot separate the second harmonic from the first if 2f is near the frame rate less f.
    order = MAX_HARMONIC_ORDER if float(data["frequency"]) < 0.2 * rates.min() else 1
    steady = (times >= begin) & (times <= end)
    resting = own_times < float(data["rest"]) - 1 / rates.min()
    harmonics = [
        fits.fit_harmonics(omega, own[chosen], camera_uv[chosen], order)
        for own, chosen, camera_uv in zip(times, steady, uv, strict=True)
    ]
    still = np.array([fits.mean_of(own[chosen]) for own, chosen in zip(uv, resting, strict=True)])
    rest, rest_frames = still, int(np.count_nonzero(resting[0]))
    if method == "matched":
        uv = _undistort_tracks(cameras, data["matches"].sel(width=width).values.astype(float))
        rest, rest_frames = uv[:, 0], 1
        for i, own in enumerate(harmonics):
            off = uv[i] - own.at(omega, times[i])
            harmonics[i] = replace(own, sigma=np.sqrt(fits.mean_of(off[steady[i]] ** 2)))
    fit = fits.combine_fit(cameras, harmonics, rest, markers)
    whole = whole_frames(delays - delays[0], rates[0])
    return Tracks(cameras, harmonics, rest, fit.frame, uv, times, whole, rest_frames)


def _undistort_tracks(cameras: list[pinhole.Camera], raw: Array) -> Array:
    """Return tracks (cameras, frames, 2, markers) without lens distortion, px."""
    return np.stack(
        [pinhole.undistort_tracks(camera, own) for camera, own in zip(cameras, raw, strict=True)]
    )


@dataclass(frozen=True)
class Instant:
    """The maxima of the deflection, predicted from the phase of the force."""

    omega: float  #: Angular frequency in rad/s
    phase: float  #: Phase of the deflection on the reference camera's clock, rad
    times: Array  #: The maxima in the steady-state interval, s, shape (maxima,)

    def nearest(self, rate: float, offset: float = 0.0) -> tuple[float, float]:
        """Find the maximum that is nearest to any frame, and the time of that frame, in s.

        Frames are at (k + offset) / rate.
        """
        frames = (np.rint(self.times * rate - offset) + offset) / rate
        best = int(np.argmin(np.abs(frames - self.times)))
        return float(self.times[best]), float(frames[best])


def find_maxima(data: xr.Dataset, damping: float) -> Instant:
    """Find the maxima; at resonance they lag the force by π/2 − ξ."""
    omega = 2 * np.pi * float(data["frequency"])
    real, imaginary = data["force"].values
    phase = float(np.arctan2(imaginary, real) - (np.pi / 2 - damping))
    margin = INTERPOLATED_FRAMES / float(data["frame_rate"].min())
    begin, end = data["steady"].values + np.array([margin, -margin])
    first, last = np.ceil((omega * begin + phase) / (2 * np.pi)), (omega * end + phase) / 2 / np.pi
    turns = np.arange(first, max(last, first + 0.5))
    return Instant(omega, phase, (2 * np.pi * turns - phase) / omega)


def measure_deflection(
    tracks: Tracks, instant: Instant, method: str, exposures: Array
) -> tuple[Array, Array]:
    """Measure the deflection of all markers at its maximum by one method, (markers,), m.

    Its standard uncertainty, also returned, includes only the noise of the centres.
    """
    P, omega = tracks.P, instant.omega
    if method == "harmonic":
        shape = fits.real_shape(fits.deflection_amplitude(tracks, omega, exposures), instant.phase)
        return shape, fits.amplitude_std(tracks, omega, exposures)
    if method in ("matched", "literal"):  # without interpolation between frames
        uv = tracks.uv[np.arange(len(P)), _find_maximum_frames(tracks, instant)]
        noise_gain = 1.0
    else:
        pairs, n = zip(tracks.times, tracks.uv, strict=True), INTERPOLATED_FRAMES
        uv = np.stack([rc.interpolate_frames(*pair, instant.times[0], n) for pair in pairs])
        weights = [
            rc.interpolate_frames(np.arange(n), np.eye(n), n / 2 - 1 + fraction, n)
            for fraction in np.linspace(0, 1, 21)
        ]
        noise_gain = float(np.mean([float(np.linalg.norm(one)) ** 2 for one in weights]))
    sigma = tracks.sigma * np.sqrt(noise_gain + 1 / tracks.rest_frames)
    return rc.measure_instant(P, tracks.frame, tracks.rest, uv, sigma)


def _find_maximum_frames(tracks: Tracks, instant: Instant) -> IntArray:
    """Return each camera's frame nearest to a maximum that all recorded, shape (cameras,)."""
    first = tracks.times[0, 0] * tracks.rate
    frames = np.rint(instant.times * tracks.rate - first).astype(int)[:, None] - tracks.frames
    followed = np.asarray(np.isfinite(tracks.uv).any(axis=(2, 3)))  # the first to start ends first
    there = (frames >= 0) & (frames < followed.shape[1])
    there &= followed[np.arange(len(followed)), np.where(there, frames, 0)]
    common = there.all(axis=1)
    if not common.any():
        raise ValueError("no frame near a maximum of the deflection was recorded by all cameras")
    seen = replace(instant, times=instant.times[common])
    number = round(seen.nearest(tracks.rate, first)[1] * tracks.rate - first)
    return np.asarray(number - tracks.frames)
