"""Deflections of all markers at common times, whatever the cameras' own.

Each camera's centres are brought there from its own time stamps, rows of a rolling shutter and
exposure (:mod:`~thesis_lib.measure.response.band`), then triangulated, instant by instant.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import welch
from scipy.spatial import KDTree

from thesis_lib.arrays import Array
from thesis_lib.measure.fitting.reconstruction import triangulate_seen
from thesis_lib.measure.modes.shapes import Rest
from thesis_lib.measure.response.band import CHUNK, NEAR, at_times
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.lens import distorted, projection_matrices, undistorted_tracks
from thesis_lib.vision.pinhole import project

ASIDE = 0.25  # of the next marker's distance that a marker may seem to move along the surface


def span_of(recordings: Sequence[Recording]) -> tuple[float, float]:
    """From when to when all cameras see all rows, s."""
    pads = [1 / own.rate + abs(own.readout) / 2 for own in recordings]
    ends = [
        (own.times[0] + pad, own.times[-1] - pad) for own, pad in zip(recordings, pads, strict=True)
    ]
    return max(first for first, _ in ends), min(last for _, last in ends)


def deflections(
    recordings: Sequence[Recording], rest: Rest, times: Array, repeated: int = 0
) -> Array:
    """Deflections along the structure's normal at some times, m, shape (times, markers).

    NaN where fewer than two cameras see a marker, and where it seems to move along the surface: a
    camera has then taken it for its neighbour. `repeated` is that of :func:`images`.
    """
    P = projection_matrices([own.camera for own in recordings])
    off = rest.images - project(P, rest.points)  # what the cameras disagree by at rest
    still = rest.frame.to_beam(rest.points)
    aside = ASIDE * KDTree(rest.places.T).query(rest.places.T, k=2)[0][:, 1]
    found = []
    for start in range(0, len(times), CHUNK):
        at = times[start : start + CHUNK]
        seen = [images(own, rest.images[k], at, repeated) for k, own in enumerate(recordings)]
        points, _ = triangulate_seen(P, np.array(seen) - off[:, :, None])
        along, across, normal = rest.frame.to_beam(points) - still[:, None]
        with np.errstate(invalid="ignore"):
            found.append(np.where(np.hypot(along, across) > aside, np.nan, normal))
    return np.concatenate(found)


def images(own: Recording, still: Array, at: Array, repeated: int = 0) -> Array:
    """Return a camera's images at some times without distortion, px, shape (2, times, markers).

    If `repeated`, gaps are filled, and the same gaps are made so many frames later.
    """
    pad = (NEAR + 1) / own.rate + abs(own.readout)
    first, last = own.between(at[0] - pad, at[-1] + pad)
    seen, height = np.array(own.centres[first:last], float), own.camera.size[1]
    uv, times = undistorted_tracks(own.camera, seen) - still, own.times[first:last]
    full = without_gaps(times, uv, own.rate)
    if repeated:
        lost = np.zeros(uv.shape, bool)
        lost[repeated:] = np.isnan(uv)[:-repeated]
        uv = np.where(lost, np.nan, full)
    rows = distorted(own.camera, still)[1]
    late = np.nan_to_num(own.readout * (rows / height - 0.5))
    later = own.readout * full[:, 1] / height  # since the marker has moved across rows
    uv = uv - np.nan_to_num(np.gradient(full, times, axis=0) * later[:, None])
    both = uv.reshape(len(uv), -1)
    found = at_times(times, both, own.rate, at, np.tile(late, 2), own.exposure)
    return np.asarray(still[:, None] + np.moveaxis(found.reshape(-1, *still.shape), 1, 0), float)


def without_gaps(times: Array, values: Array, rate: float) -> Array:
    """Fill short gaps of series (samples, 2, series) by band-limited interpolation."""
    flat = values.reshape(len(values), -1)
    found, gaps = flat.copy(), np.isnan(flat).any(axis=0)
    if gaps.any():
        filled = at_times(times, flat[:, gaps], rate, times)
        found[:, gaps] = np.where(np.isnan(flat[:, gaps]), filled, flat[:, gaps])
    return found.reshape(values.shape)


def noise_of(still: Array, rate: float, band: tuple[float, float]) -> Array:
    """Power of noise in a band in Hz, m²/Hz, (markers,), of deflections at rest (times, markers).

    NaN where the rest is too short to tell.
    """
    f, power = welch(np.nan_to_num(still), rate, axis=0, nperseg=len(still))
    inside = (f >= band[0]) & (f <= band[1])
    if np.count_nonzero(inside) < 4:
        return np.full(still.shape[1], np.nan)
    found = power[inside].mean(axis=0)
    return np.asarray(np.where(np.isfinite(still).all(axis=0), found, np.nan), float)
