"""Tracks as the modal fit takes them: undistorted centres, each with the time it was seen at.

Centres that are not where they should be: a marker taken for its neighbour, a lost one refound.

A few of them weigh more than all the rest in a sum of squares. Neighbours tell which they are: what
a structure does, modes that are not fitted included, neighbouring markers do alike.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.modes.poles import TrackBlock, fit_known, pole_columns
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.lens import Camera, undistort_tracks


@dataclass(frozen=True)
class Track:
    """What one camera saw of the markers."""

    camera: Camera  #: Calibrated
    times: Array  #: Of the frames' middle rows, on the first camera's clock, s, shape (frames,)
    uv: Array  #: Centres without lens distortion, px, NaN where missing, (frames, 2, markers)
    exposure: float = 0.0  #: Exposure time in s
    readout: float = 0.0  #: Time from the first row's exposure to the last row's, s
    rows: Array | None = None  #: Rows with distortion, px, (frames, markers); None: those of `uv`

    @property
    def seen_rows(self) -> Array:
        """Return the rows in which the centres were seen, px, shape (frames, markers)."""
        return self.uv[:, 1] if self.rows is None else self.rows

    @property
    def late(self) -> Array:
        """By how much each centre was seen after its frame's time, s, shape (frames, markers)."""
        return np.asarray(self.readout * (self.seen_rows / self.camera.size[1] - 0.5), float)

    @property
    def usual(self) -> Array:
        """The mean of :attr:`late` over what is seen, s, shape (markers,)."""
        late = np.ma.masked_invalid(self.late)
        return np.asarray(late.mean(axis=0).filled(0.0), float)

    def shifted(self, seconds: float, pace: float = 1.0, at: float = 0.0) -> Track:
        """Return the track with a clock that starts later, and is slower about a time."""
        return replace(self, times=at + (self.times - at) * pace + seconds)


def tracks_of(recordings: Sequence[Recording], begin: float, end: float) -> list[Track]:
    """Return the tracks of all cameras from one time to another on the first camera's clock, s."""
    found = []
    for own in recordings:
        first, last = own.between(begin, end)
        centres = np.array(own.centres[first:last], float)
        uv = undistort_tracks(own.camera, centres)
        found.append(
            Track(own.camera, own.times[first:last], uv, own.exposure, own.readout, centres[:, 1])
        )
    return found


NEIGHBOUR_COUNT = 8  # neighbours of a marker
MAX_SPREADS = 8.0  # spreads over the neighbours, and usual distances from them, that one may be off
MIN_WORST_RATIO = 0.3  # of a marker's largest distance, below which it waits for the next look
MAX_LOOKS = 6


def without_strays(track: Track, places: Array) -> Track:
    """Return the track without centres that move unlike neighbours at (2, markers)."""
    with warnings.catch_warnings():  # of markers that are never seen
        warnings.simplefilter("ignore", RuntimeWarning)
        moved = track.uv - np.nanmedian(track.uv, axis=0)
    return _without(track, find_strays(moved, places))


def without_outliers(track: Track, block: TrackBlock, rates: Array, places: Array) -> Track:
    """Return the track without centres whose residuals differ from their neighbours'."""
    B, known = pole_columns(block.times, rates), block.known
    with warnings.catch_warnings():  # of markers that are never seen
        warnings.simplefilter("ignore", RuntimeWarning)
        usual = np.nan_to_num(np.nanmedian(track.uv, axis=0))
    halfway = 0.5 * KDTree(usual.T).query(usual.T, k=2)[0][:, 1]
    for _ in range(MAX_LOOKS):
        left = block.values - B @ fit_known(B, replace(block, known=known))[0]
        left = np.where(known, left * block.scale, np.nan).reshape(track.uv.shape)
        wrong = find_strays(left, places)
        off = np.hypot(left[:, 0], left[:, 1])
        with np.errstate(invalid="ignore"):  # nearer to where the next one is than to its own place
            wrong |= (off > halfway) & (off > MIN_WORST_RATIO * np.nanmax(off))
        if not wrong.any():
            break
        known = known & ~np.repeat(wrong[:, None], 2, axis=1).reshape(known.shape)
    kept = np.asarray(known.reshape(track.uv.shape).all(axis=1), bool)
    return _without(track, ~kept)


def find_strays(moved: Array, places: Array) -> Mask:
    """Return which of some motions (frames, 2, markers) are far from those of their neighbours."""
    count = min(NEIGHBOUR_COUNT + 1, places.shape[1])
    _, near = KDTree(places.T).query(places.T, k=count)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        around = moved[:, :, near[:, 1:]]
        middle = _median(around)
        spread = _median(np.abs(around - middle[..., None]))
        off = np.abs(moved - middle)
        limit = MAX_SPREADS * (spread + np.nanmedian(off, axis=0))
        far = (off > limit) & (
            off > MIN_WORST_RATIO * np.nanmax(np.where(off > limit, off, 0), axis=0)
        )
    return np.asarray(far.any(axis=1), bool)


def _median(values: Array) -> Array:
    """Return the nanmedian over a short last axis, ten times as fast as NumPy's."""
    count = np.isfinite(values).sum(axis=-1, keepdims=True)
    ranked = np.sort(values, axis=-1)  # NaN comes last
    low, high = (
        np.take_along_axis(ranked, np.maximum(place, 0), axis=-1)[..., 0]
        for place in ((count - 1) // 2, count // 2)
    )
    return np.asarray(0.5 * (low + high), float)


def _without(track: Track, wrong: Mask) -> Track:
    return replace(track, uv=np.where(wrong[:, None], np.nan, track.uv), rows=track.seen_rows)
