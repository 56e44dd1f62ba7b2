"""A signal of a limited band at any times, from samples at other ones.

Cameras take frames at times of their own, some of them unevenly, each as a mean over its exposure.
Of a signal that holds all frequencies up to a limit with like power, the best linear estimate at a
time t from samples y at tᵢ is sᵀ S⁻¹ y, where S is the covariance of the samples among each other
and s that with the value at t (Wiener): the mean of cos 2πf(tᵢ − tⱼ) over the band, times
sinc fT for every exposure of T that is in it. So the exposure's loss is undone, too.
"""

from __future__ import annotations

import numpy as np

from thesis_lib.arrays import Array, Mask

NEAR = 24  # samples that an estimate rests on
SHARE = 0.45  # of the rate, up to which the signal is taken to reach
TOLD = 0.4  # of the rate, up to which the estimate is good: 1 % of the amplitude, mostly far better
FLOOR = 1e-6  # power beside the band over that in it
NODES = 28  # of the quadrature over the band
CHUNK = 512  # times at once


def at_times(
    times: Array,
    values: Array,
    rate: float,
    wanted: Array,
    late: Array | float = 0.0,
    exposure: float = 0.0,
) -> Array:
    """Values of series of a limited band at wanted times.

    Parameters
    ----------
    times : ndarray, shape (samples,)
        When the samples were taken, s, in order.
    values : ndarray, shape (samples, series)
        The samples, about a mean of zero; NaN where one is missing.
    rate : float
        Samples per second, the mean.
    wanted : ndarray, shape (times,)
        When they are wanted, s.
    late : ndarray, shape (series,), or float
        By how much later than `times` each series was sampled, s.
    exposure : float
        Time over which a sample is the mean, s.

    Returns
    -------
    ndarray, shape (times, series)
        NaN where less than half of the samples around are there, or none on one side.
    """
    few, weights = np.polynomial.legendre.leggauss(NODES)
    f, w = SHARE * rate * (few + 1) / 2, weights / 2
    blur = np.sinc(f * exposure)
    shift = np.broadcast_to(np.asarray(late, float), values.shape[1:])
    found = np.full((len(wanted), values.shape[1]), np.nan)
    near = min(NEAR, len(times))
    for start in range(0, len(wanted), CHUNK):
        t = wanted[start : start + CHUNK]
        first = np.clip(np.searchsorted(times, t) - near // 2, 0, len(times) - near)
        index = first[:, None] + np.arange(near)
        turn = 2 * np.pi * f * (times[index] - t[:, None])[:, :, None]  # (times, near, nodes)
        A = np.concatenate([np.cos(turn), np.sin(turn)], axis=2) * np.tile(blur, 2)
        S = (A * np.tile(w, 2)) @ A.swapaxes(1, 2) + FLOOR * np.eye(near)
        own = 2 * np.pi * f * -shift[:, None]
        a = np.concatenate([np.cos(own), np.sin(own)], axis=1) * np.tile(w, 2)  # (series, nodes)
        s = A @ a.T  # (times, near, series)
        taken = values[index]
        known = np.isfinite(taken)
        part = np.einsum("tns,tns->ts", np.linalg.solve(S, s), np.where(known, taken, 0.0))
        found[start : start + CHUNK] = _mended(part, S, s, taken, known)
    inside = (wanted[:, None] >= times[0] + shift) & (wanted[:, None] <= times[-1] + shift)
    return np.where(inside, found, np.nan)


def _mended(part: Array, S: Array, s: Array, taken: Array, known: Mask) -> Array:
    """The estimates, anew where samples are missing."""
    near, found = known.shape[1], part.copy()
    t, k = np.nonzero(~known.all(axis=1))
    if not len(t):
        return found
    there = known[t, :, k]
    both = there[:, :, None] & there[:, None]
    matrix = np.where(both, S[t], np.eye(near))
    right = np.where(there, s[t, :, k], 0.0)
    weights = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    value = np.sum(weights * np.where(there, taken[t, :, k], 0.0), axis=1)
    half = near // 2
    enough = (2 * there.sum(axis=1) >= near) & there[:, :half].any(1) & there[:, half:].any(1)
    found[t, k] = np.where(enough, value, np.nan)
    return found
