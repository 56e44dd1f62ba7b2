"""Deflection shapes from tracks, by three methods.

*Literal* is the thesis's: clocks aligned to whole frames, and the frame that comes nearest to a
maximum, as the force's phase tells it. *Aligned* puts the clocks right to a fraction of a frame and
interpolates to the instant of the maximum. *Harmonic* fits the harmonics of every image coordinate
on its camera's own clock, so that all frames count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from thesis_lib.experiment import lens
from thesis_lib.experiment import reconstruction as rc
from thesis_lib.experiment.chain import cameras_of
from thesis_lib.experiment.lens import Camera
from thesis_lib.experiment.scene import Markers

Array = NDArray[np.float64]
ORDER = 2  # harmonics that are fitted
NEAR = 6  # frames that are interpolated


@dataclass(frozen=True)
class Tracks:
    """Tracks of the chosen cameras at one width, ready for triangulation.

    Parameters
    ----------
    cameras : list of Camera
        Calibrated, at this width.
    uv : ndarray, shape (cameras, frames, 2, markers)
        Marker centres without distortion, px.
    times : ndarray, shape (cameras, frames)
        On the reference camera's clock, s.
    frames : ndarray of int, shape (cameras,)
        Delays in whole frames.
    harmonics : list of Harmonics
        Of the steady part.
    rest : ndarray, shape (cameras, 2, markers)
        Mean at rest, px.
    rest_frames : int
        Frames that it is the mean of.
    frame : Frame
        The beam's frame.
    """

    cameras: list[Camera]
    uv: Array
    times: Array
    frames: NDArray[np.int64]
    harmonics: list[rc.Harmonics]
    rest: Array
    rest_frames: int
    frame: rc.Frame

    @property
    def P(self) -> Array:
        """Projection matrices, shape (cameras, 3, 4)."""
        return lens.projection_matrices(self.cameras)

    @property
    def rate(self) -> float:
        """Frames per second of the first camera."""
        return float(1 / (self.times[0, 1] - self.times[0, 0]))

    @property
    def sigma(self) -> Array:
        """Scatter of the centres about the harmonics, (cameras, 2, markers), px."""
        return np.array([h.sigma for h in self.harmonics])


def tracks_of(
    data: xr.Dataset, markers: Markers, names: str, width: int, calibration: str
) -> Tracks:
    """The tracks of some cameras at one width, by one of the two calibrations."""
    index = [list(data["camera"].values).index(name) for name in names]
    every = cameras_of(data, calibration, width)
    cameras = [every[i] for i in index]
    raw = data["tracks"].sel(width=width).values[index]
    uv = np.stack(
        [
            lens.undistorted(camera, own.swapaxes(0, 1)).swapaxes(0, 1)
            for camera, own in zip(cameras, raw, strict=True)
        ]
    )
    rates = data["frame_rate"].values[index]
    own_times = np.arange(uv.shape[1]) / rates[:, None]
    times = own_times + data["delay"].values[index][:, None]
    omega = 2 * np.pi * float(data["frequency"])
    begin, end = data["steady"].values
    rest_s = float(data["rest"])
    harmonics, rest = [], []
    for camera_uv, camera_times, own in zip(uv, times, own_times, strict=True):
        steady = (camera_times >= begin) & (camera_times <= end)
        harmonics.append(rc.fit_harmonics(omega, camera_times[steady], camera_uv[steady], ORDER))
        still = camera_uv[own < rest_s - 1 / rates.min()]
        rest.append(_mean(still))
    still_frames = int(np.count_nonzero(own_times[0] < rest_s - 1 / rates.min()))
    P = lens.projection_matrices(cameras)
    points, _ = rc.triangulate_seen(P, np.array(rest))
    frame = rc.fit_grid(points, markers.world[:, : markers.count])
    return Tracks(cameras, uv, times, data["delay_frames"].values[index], harmonics,
                  np.array(rest), still_frames, frame)  # fmt: skip


def _mean(values: Array) -> Array:
    """Mean over the first axis of what is known; NaN where less than half is."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    mean = np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(count >= len(values) / 2, mean, np.nan)


@dataclass(frozen=True)
class Instant:
    """The maxima of the deflection, as the force's phase tells them.

    Parameters
    ----------
    omega : float
        Angular frequency in rad/s.
    phase : float
        Phase of the deflection on the reference camera's clock, rad.
    times : ndarray, shape (maxima,)
        The maxima of the steady part, s.
    """

    omega: float
    phase: float
    times: Array

    def nearest(self, rate: float, offset: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Of the maxima, the one that a frame comes nearest to, and that frame's time.

        Frames are at (k + offset) / rate; `offset` may have any shape.
        """
        first = np.asarray(offset, float)[..., None]
        frames = (np.rint(self.times * rate - first) + first) / rate
        best = np.argmin(np.abs(frames - self.times), axis=-1)[..., None]
        chosen = np.take_along_axis(frames, best, axis=-1)[..., 0]
        return self.times[best[..., 0]], chosen


def instant_of(data: xr.Dataset, damping: float) -> Instant:
    """The maxima: at the displacement resonance they lag the force by a quarter period, less ξ."""
    omega = 2 * np.pi * float(data["frequency"])
    real, imaginary = data["force"].values
    phase = float(np.arctan2(imaginary, real) - (np.pi / 2 - damping))
    margin = NEAR / float(data["frame_rate"].min())
    begin, end = data["steady"].values + np.array([margin, -margin])
    first, last = np.ceil((omega * begin + phase) / (2 * np.pi)), (omega * end + phase) / 2 / np.pi
    turns = np.arange(first, max(last, first + 0.5))
    return Instant(omega, phase, (2 * np.pi * turns - phase) / omega)


def deflection(tracks: Tracks, instant: Instant, method: str, exposures: Array) -> Array:
    """Deflection of all markers at its maximum, shape (markers,), m."""
    P = tracks.P
    if method == "harmonic":
        amplitude = rc.harmonic_deflection(
            P, tracks.frame, instant.omega, unblurred(tracks, instant, exposures)
        )
        return rc.real_shape(amplitude, instant.phase)
    if method == "literal":
        first = tracks.times[0, 0] * tracks.rate
        number = round(float(instant.nearest(tracks.rate, first)[1]) * tracks.rate - first)
        chosen = number - (tracks.frames - tracks.frames[0])
        uv = tracks.uv[np.arange(len(P)), np.clip(chosen, 0, tracks.uv.shape[1] - 1)]
    else:
        uv = np.stack(
            [
                rc.interpolate(times, own, instant.times[0], NEAR)
                for times, own in zip(tracks.times, tracks.uv, strict=True)
            ]
        )
    return rc.deflection_at(P, tracks.frame, tracks.rest, uv)


def unblurred(tracks: Tracks, instant: Instant, exposures: Array) -> list[rc.Harmonics]:
    """The harmonics without the loss by each camera's exposure in s."""
    return [
        own.unblurred(instant.omega * float(exposure))
        for own, exposure in zip(tracks.harmonics, exposures, strict=True)
    ]


def interpolation_gain(fraction: float) -> float:
    """Root of the summed squares of the interpolation's weights: what it makes of white noise."""
    nodes = np.arange(NEAR)
    weights = rc.interpolate(nodes, np.eye(NEAR), NEAR / 2 - 1 + fraction, NEAR)
    return float(np.linalg.norm(weights))


def rest_points(tracks: Tracks) -> Array:
    """Markers at rest in the calibration's frame, shape (3, markers), m."""
    points, _ = rc.triangulate_seen(tracks.P, tracks.rest)
    return points


def predicted(tracks: Tracks, method: str, at: Instant, exposures: Array) -> Array:
    """Standard deviation of the deflection of each marker by the noise of the centres alone, m."""
    sigma = tracks.sigma
    if method == "harmonic":
        fitted = unblurred(tracks, at, exposures)
        each = sigma * np.sqrt([0.5 * (h.covariance[1, 1] + h.covariance[2, 2]) for h in fitted])
    else:
        mean = 1.0 if method == "literal" else np.mean(
            [interpolation_gain(f) ** 2 for f in np.linspace(0, 1, 21)]
        )  # fmt: skip
        each = sigma * np.sqrt(mean + 1 / tracks.rest_frames)
    return rc.height_deviation(tracks.P, tracks.frame, rest_points(tracks), each)
