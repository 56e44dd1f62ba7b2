"""Deflection shapes from tracks, by four methods.

*Matched* is the thesis's to the letter: centres as the template match has them, clocks aligned to
whole frames, one frame at rest, and the frame that comes nearest to a maximum, as the force's phase
tells it. *Literal* has fitted centres, and the mean of the frames at rest. *Aligned* puts the
clocks right to a fraction of a frame and interpolates to the instant of the maximum. *Harmonic*
fits the harmonics of every image coordinate on its camera's own clock, so that all frames count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, IntArray
from thesis_lib.figure_sets.experiment.chain import cameras_of
from thesis_lib.measure.fitting import reconstruction as rc
from thesis_lib.measure.fitting.harmonics import (
    Fitted,
    amplitude,
    deviation,
    fit_harmonics,
    fitted,
    mean_of,
)
from thesis_lib.measure.recordings.markers import Markers
from thesis_lib.measure.synchronisation.synchronise import whole_frames
from thesis_lib.vision import lens
from thesis_lib.vision.lens import Camera

ORDER = 2  # harmonics that are fitted
NEAR = 6  # frames that are interpolated
WHOLE_FRAMES = ("matched", "literal")  # methods that take frames as they are


@dataclass(frozen=True)
class Tracks(Fitted):
    """Tracks of the chosen cameras at one width, ready for triangulation."""

    uv: Array  #: Marker centres without distortion, px, shape (cameras, frames, 2, markers)
    times: Array  #: On the reference camera's clock, s, shape (cameras, frames)
    #: Delays to the first of these cameras in whole frames (eq. 5.2), shape (cameras,)
    frames: IntArray
    rest_frames: int  #: Frames that `rest` is the mean of

    @property
    def rate(self) -> float:
        """Frames per second of the first camera."""
        return float(1 / (self.times[0, 1] - self.times[0, 0]))


def tracks_of(
    data: xr.Dataset,
    markers: Markers,
    names: Sequence[str],
    width: int,
    calibration: str,
    matched: bool = False,
) -> Tracks:
    """The tracks of some cameras at one width, by one of the two calibrations.

    `names` is a sequence of the cameras' names. If `matched`, the centres are those of the template
    match: at rest those of the first frame, and in motion they scatter about the harmonics of the
    fitted ones.
    """
    index = [list(data["camera"].values).index(name) for name in names]
    every = cameras_of(data, calibration, width)
    cameras = [every[i] for i in index]
    uv = _undistorted(cameras, data["tracks"].sel(width=width).values[index])
    rates = data["frame_rate"].values[index]
    own_times = np.arange(uv.shape[1]) / rates[:, None]
    times = own_times + data["delay"].values[index][:, None]
    omega = 2 * np.pi * float(data["frequency"])
    begin, end = data["steady"].values
    # Where the second harmonic nears the frame rate less the first, frames cannot tell them apart.
    order = ORDER if float(data["frequency"]) < 0.2 * rates.min() else 1
    steady = (times >= begin) & (times <= end)
    resting = own_times < float(data["rest"]) - 1 / rates.min()
    harmonics = [
        fit_harmonics(omega, own[chosen], camera_uv[chosen], order)
        for own, chosen, camera_uv in zip(times, steady, uv, strict=True)
    ]
    still = np.array([mean_of(own[chosen]) for own, chosen in zip(uv, resting, strict=True)])
    rest, rest_frames = still, int(np.count_nonzero(resting[0]))
    if matched:
        uv = _undistorted(cameras, data["matches"].sel(width=width).values[index].astype(float))
        rest, rest_frames = uv[:, 0], 1
        for i, own in enumerate(harmonics):
            off = uv[i] - own.at(omega, times[i])
            harmonics[i] = replace(own, sigma=np.sqrt(mean_of(off[steady[i]] ** 2)))
    fit = fitted(cameras, harmonics, rest, markers)
    delays = data["delay"].values[index]
    whole = whole_frames(delays - delays[0], rates[0])
    return Tracks(cameras, harmonics, rest, fit.frame, uv, times, whole, rest_frames)


def _undistorted(cameras: list[Camera], raw: Array) -> Array:
    """Tracks (cameras, frames, 2, markers) without lens distortion, px."""
    return np.stack(
        [lens.undistorted_tracks(camera, own) for camera, own in zip(cameras, raw, strict=True)]
    )


@dataclass(frozen=True)
class Instant:
    """The maxima of the deflection, as the force's phase tells them."""

    omega: float  #: Angular frequency in rad/s
    phase: float  #: Phase of the deflection on the reference camera's clock, rad
    times: Array  #: The maxima of the steady part, s, shape (maxima,)

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
        return rc.real_shape(amplitude(tracks, instant.omega, exposures), instant.phase)
    if method in WHOLE_FRAMES:
        uv = tracks.uv[np.arange(len(P)), _frames_at_a_maximum(tracks, instant)]
    else:
        uv = np.stack(
            [
                rc.interpolate(times, own, instant.times[0], NEAR)
                for times, own in zip(tracks.times, tracks.uv, strict=True)
            ]
        )
    return rc.deflection_at(P, tracks.frame, tracks.rest, uv)


def _frames_at_a_maximum(tracks: Tracks, instant: Instant) -> IntArray:
    """Of each camera the frame nearest to a maximum that all of them recorded, shape (cameras,)."""
    first = tracks.times[0, 0] * tracks.rate
    frames = np.rint(instant.times * tracks.rate - first).astype(int)[:, None] - tracks.frames
    followed = np.asarray(np.isfinite(tracks.uv).any(axis=(2, 3)))  # who started first ends first
    there = (frames >= 0) & (frames < followed.shape[1])
    there &= followed[np.arange(len(followed)), np.where(there, frames, 0)]
    common = there.all(axis=1)
    if not common.any():
        raise ValueError("no frame near a maximum of the deflection was recorded by all cameras")
    seen = replace(instant, times=instant.times[common])
    number = round(float(seen.nearest(tracks.rate, first)[1]) * tracks.rate - first)
    return np.asarray(number - tracks.frames)


def interpolation_gain(fraction: float) -> float:
    """Root of the summed squares of the interpolation's weights: what it makes of white noise."""
    nodes = np.arange(NEAR)
    weights = rc.interpolate(nodes, np.eye(NEAR), NEAR / 2 - 1 + fraction, NEAR)
    return float(np.linalg.norm(weights))


def predicted(tracks: Tracks, method: str, at: Instant, exposures: Array) -> Array:
    """Standard deviation of the deflection of each marker by the noise of the centres alone, m."""
    if method == "harmonic":
        return deviation(tracks, at.omega, exposures)
    mean = (
        1.0
        if method in WHOLE_FRAMES
        else np.mean([interpolation_gain(f) ** 2 for f in np.linspace(0, 1, 21)])
    )
    each = tracks.sigma * np.sqrt(mean + 1 / tracks.rest_frames)
    return rc.height_deviation(tracks.P, tracks.frame, tracks.points, each)
