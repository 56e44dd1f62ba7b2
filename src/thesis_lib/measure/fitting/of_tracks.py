"""Tracks as the harmonics of one frequency, their places at rest, and noise near the frequency."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.fitting.harmonics import Fitted, Harmonics, harmonic_basis, mean_of, sums_of
from thesis_lib.measure.fitting.reconstruction import Frame
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.lens import distort_pixels

#: Trial frequencies about that of a vibration, in cycles per recording: the fit has taken what is
#: nearer, and further away the noise may be another
NEAR_CYCLES = np.r_[-8:-1, 2:9]


def fit_tracks(
    recordings: Sequence[Recording],
    rest: Array,
    frame: Frame,
    omega: float,
    begin: float,
    end: float,
    order: int,
) -> Fitted:
    """Return all cameras' harmonics as they are, with the markers' places at rest.

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
    """Return the mean centres before the motion, without distortion, (2, markers), px."""
    last = own.delay + seconds - 1 / own.rate
    parts = [uv for _, uv in own.parts(own.delay, last)]
    return mean_of(np.concatenate(parts))


def _harmonics(
    own: Recording, still: Array, omega: float, begin: float, end: float, order: int
) -> Harmonics:
    """Return harmonics of the tracks of one camera, part by part about the markers' places at rest.

    A rolling shutter sees every marker at the time of its row; the harmonics are those at the
    frames' times.
    """
    middle, sums = still, []
    for times, uv in own.parts(begin, end):
        middle = np.where(np.isfinite(middle), middle, mean_of(uv))
        sums.append(sums_of(omega, times, uv - middle, order))
        sums = [reduce(add, sums)]
    return sums[0].solve().raised(middle).earlier(omega, row_delays(own, middle))


def row_delays(own: Recording, uv: Array) -> Array:
    """Compute when a rolling shutter sees places (2, markers) after its frames' times, s."""
    rows = distort_pixels(own.camera, uv)[1] / own.camera.size[1]
    return np.asarray(own.readout * (rows - 0.5), float)


def noise_near(own: Recording, fit: Harmonics, omega: float, begin: float, end: float) -> float:
    """Estimate the power of a camera's residuals near a frequency over their mean power.

    It is one for white noise. Scatter that is correlated from frame to frame has more power at low
    frequencies and less at high ones, and the variance of an amplitude is proportional to it. An
    amplitude that grows or falls evenly is no noise, and is taken out.

    Parameters
    ----------
    own : Recording
        Camera, clock and tracks.
    fit : Harmonics
        Of its tracks, of :func:`fit_tracks`.
    omega, begin, end : float
        Angular frequency in rad/s, and the part that was fitted, s.
    """
    order = (len(fit.coefficients) - 1) // 2
    fit = fit.earlier(omega, -row_delays(own, fit.coefficients[0]))  # at the frames' times
    near = omega + 2 * np.pi * NEAR_CYCLES / (end - begin)
    weight = 1 / np.where(fit.sigma > 0, fit.sigma, np.nan)
    frames, known = 0, np.zeros(weight.size)
    columns = 2 * order + 3
    square, cross = np.zeros((columns, columns)), np.zeros((columns, len(near)), complex)
    right, lines = np.zeros((columns, weight.size)), np.zeros((len(near), weight.size), complex)
    for times, uv in own.parts(begin, end):
        A, E = harmonic_basis(omega, times, order), np.exp(-1j * np.outer(times, near))
        A = np.hstack([A, A[:, 1:3] * (2 * (times[:, None] - begin) / (end - begin) - 1)])
        left = ((uv - fit.at(omega, times)) * weight).reshape(len(times), -1)
        frames, known = frames + len(times), known + np.isfinite(left).sum(axis=0)
        left = np.nan_to_num(left)
        square, cross = square + A.T @ A, cross + A.T @ E
        right, lines = right + A.T @ left, lines + E.T @ left
    taken = np.linalg.solve(square, cross)  # what a fit of A takes of the lines
    lines = lines - taken.T @ right
    free = (frames * len(near) - np.sum(cross.conj() * taken).real) * known.sum() / frames
    return float(np.sum(np.abs(lines) ** 2) / free) if free > 0 else 1.0
