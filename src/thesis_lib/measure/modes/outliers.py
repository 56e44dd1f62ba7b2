"""Centres that are not where they should be: a marker taken for its neighbour, a lost one refound.

A few of them weigh more than all the rest in a sum of squares. Neighbours tell which they are: what
a structure does, modes that are not fitted included, neighbouring markers do alike.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.modes.poles import Block, columns, seen_fit
from thesis_lib.measure.modes.tracks import Track

BESIDE = 8  # neighbours of a marker
FAR = 8.0  # spreads over the neighbours, and usual distances from them, that one may be off
WORST = 0.3  # of a marker's largest distance, below which it waits for the next look
LOOKS = 6


def without_strays(track: Track, places: Array) -> Track:
    """The track without centres that move unlike their neighbours' at places (2, markers)."""
    with warnings.catch_warnings():  # of markers that are never seen
        warnings.simplefilter("ignore", RuntimeWarning)
        moved = track.uv - np.nanmedian(track.uv, axis=0)
    return _without(track, strays(moved, places))


def without_outliers(track: Track, block: Block, rates: Array, places: Array) -> Track:
    """The track without centres that leave the modes of its block as their neighbours do not."""
    B, known = columns(block.times, rates), block.known
    with warnings.catch_warnings():  # of markers that are never seen
        warnings.simplefilter("ignore", RuntimeWarning)
        usual = np.nan_to_num(np.nanmedian(track.uv, axis=0))
    halfway = 0.5 * KDTree(usual.T).query(usual.T, k=2)[0][:, 1]
    for _ in range(LOOKS):
        left = block.values - B @ seen_fit(B, replace(block, known=known))[0]
        left = np.where(known, left * block.scale, np.nan).reshape(track.uv.shape)
        wrong = strays(left, places)
        off = np.hypot(left[:, 0], left[:, 1])
        with np.errstate(invalid="ignore"):  # nearer to where the next one is than to its own place
            wrong |= (off > halfway) & (off > WORST * np.nanmax(off))
        if not wrong.any():
            break
        known = known & ~np.repeat(wrong[:, None], 2, axis=1).reshape(known.shape)
    kept = np.asarray(known.reshape(track.uv.shape).all(axis=1), bool)
    return _without(track, ~kept)


def strays(moved: Array, places: Array) -> Mask:
    """Which of some motions (frames, 2, markers) are far from those of their neighbours."""
    count = min(BESIDE + 1, places.shape[1])
    _, near = KDTree(places.T).query(places.T, k=count)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        around = moved[:, :, near[:, 1:]]
        middle = _median(around)
        spread = _median(np.abs(around - middle[..., None]))
        off = np.abs(moved - middle)
        limit = FAR * (spread + np.nanmedian(off, axis=0))
        far = (off > limit) & (off > WORST * np.nanmax(np.where(off > limit, off, 0), axis=0))
    return np.asarray(far.any(axis=1), bool)


def _median(values: Array) -> Array:
    """Median over the last axis of what is known: ten times as fast as NumPy's over short axes."""
    count = np.isfinite(values).sum(axis=-1, keepdims=True)
    ranked = np.sort(values, axis=-1)  # NaN comes last
    low, high = (
        np.take_along_axis(ranked, np.maximum(place, 0), axis=-1)[..., 0]
        for place in ((count - 1) // 2, count // 2)
    )
    return np.asarray(0.5 * (low + high), float)


def _without(track: Track, wrong: Mask) -> Track:
    return replace(track, uv=np.where(wrong[:, None], np.nan, track.uv), rows=track.seen_rows)
