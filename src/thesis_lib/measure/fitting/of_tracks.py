"""Tracks as the harmonics of one frequency, and their places at rest."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.fitting.harmonics import Fitted, Harmonics, mean_of, sums_of
from thesis_lib.measure.fitting.reconstruction import Frame
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.lens import distorted


def fit_tracks(
    recordings: Sequence[Recording],
    rest: Array,
    frame: Frame,
    omega: float,
    begin: float,
    end: float,
    order: int,
) -> Fitted:
    """All cameras' harmonics as they are, with the markers' places at rest.

    Parameters
    ----------
    recordings : sequence of Recording
        Cameras, clocks and tracks.
    rest : ndarray, shape (cameras, 2, markers)
        Of :func:`at_rest`; NaN of markers that were hidden then.
    frame : Frame
        The structure's.
    omega, begin, end : float
        Angular frequency in rad/s, and the part that is fitted, s.
    order : int
        How many harmonics.
    """
    fits = [
        _harmonics(own, still, omega, begin, end, order)
        for own, still in zip(recordings, rest, strict=True)
    ]
    middle = np.array([own.coefficients[0] for own in fits])
    places = np.where(np.isfinite(rest), rest, middle)  # of markers that were hidden at first
    return Fitted([own.camera for own in recordings], fits, places, frame)


def at_rest(own: Recording, seconds: float) -> Array:
    """Mean centres before the motion, without distortion, (2, markers), px."""
    last = own.delay + seconds - 1 / own.rate
    parts = [uv for _, uv in own.parts(own.delay, last)]
    return mean_of(np.concatenate(parts))


def _harmonics(
    own: Recording, still: Array, omega: float, begin: float, end: float, order: int
) -> Harmonics:
    """Harmonics of the tracks of one camera, part by part about the markers' places at rest.

    A rolling shutter sees every marker at the time of its row; the harmonics are those at the
    frames' times.
    """
    middle, sums = still, []
    for times, uv in own.parts(begin, end):
        middle = np.where(np.isfinite(middle), middle, mean_of(uv))
        sums.append(sums_of(omega, times, uv - middle, order))
        sums = [reduce(add, sums)]
    rows = distorted(own.camera, middle)[1] / own.camera.size[1]
    return sums[0].solve().raised(middle).earlier(omega, own.readout * (rows - 0.5))
