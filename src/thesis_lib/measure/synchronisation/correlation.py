"""Correlation coefficients of two signals at all lags, and their peaks between samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, rfft

from thesis_lib.arrays import Array, IntArray

LAGS = 1 << 18  # that are normalised at once


def normalised_correlation(a: ArrayLike, b: ArrayLike, most: int) -> tuple[IntArray, Array]:
    """Correlation coefficient of a[j + lag] and b[j] over the j that both have.

    Each lag is normalised by the means and energies of its own overlap: without, the shrinking
    overlap would pull the peak to lag zero.

    Parameters
    ----------
    a, b : array_like, shape (samples of each,)
        Two signals at the same rate.
    most : int
        Largest lag in samples.

    Returns
    -------
    lags, coefficients : ndarray, shape (lags,)
        IntArray in samples, and −1…1.
    """
    n_x, n_y = len(np.asarray(a)), len(np.asarray(b))
    first, last = max(-most, 1 - n_y), min(most, n_x - 1)
    size = 1 << (max(n_x, n_y) + most - 1).bit_length()
    size = size // 4 * 3 if max(n_x, n_y) + most <= size // 4 * 3 else size
    product, other = rfft(_centred(a), size), rfft(_centred(b), size)
    product *= np.conj(other, out=other)
    del other
    values = irfft(product, size, overwrite_x=True)
    del product
    c = np.concatenate([values[first:] if first else values[:0], values[: last + 1]])
    del values
    sums_x, sums_y = _running(_centred(a)), _running(_centred(b))
    for k in range(0, len(c), LAGS):
        lag = np.arange(first + k, min(first + k + LAGS, last + 1))
        low, high = np.maximum(lag, 0), np.minimum(n_y + lag, n_x)  # the overlap, in x
        sum_x, energy_x = _energy(sums_x, low, high)
        sum_y, energy_y = _energy(sums_y, low - lag, high - lag)
        energy = np.sqrt(energy_x * energy_y)
        covariance = c[k : k + LAGS] - sum_x * sum_y / (high - low)
        c[k : k + LAGS] = np.divide(covariance, energy, out=np.zeros_like(energy), where=energy > 0)
    del sums_x, sums_y
    return np.arange(first, last + 1), c


def _centred(v: ArrayLike) -> Array:
    """A copy less its mean."""
    x = np.array(v, float)
    x -= x.mean()
    return x


def _running(v: Array) -> tuple[Array, Array]:
    """Sums of the values and of their squares up to each sample."""
    first, second = np.zeros((2, len(v) + 1))
    np.cumsum(v, out=first[1:])
    np.cumsum(np.square(v, out=second[1:]), out=second[1:])
    return first, second


def _energy(sums: tuple[Array, Array], low: IntArray, high: IntArray) -> tuple[Array, Array]:
    """Sum, and energy about the mean, of the samples from `low` to `high`."""
    total = sums[0][high] - sums[0][low]
    return total, np.maximum(sums[1][high] - sums[1][low] - total**2 / (high - low), 0)


def summit(lags: IntArray, c: Array, top: int) -> float:
    """Lag of a peak between samples, by a polynomial through its cap.

    A slow tone's peak is so flat that noise decides among three samples; a clap's has no more.
    """
    below = np.flatnonzero(np.concatenate([[True], c < 0.8 * c[top], [True]])) - 1
    reach = int(min(top - below[below < top].max(), below[below > top].min() - top)) - 1
    if reach < 1:
        return float(lags[top])
    u = np.arange(-reach, reach + 1) / reach
    cap = c[top - reach : top + reach + 1]
    fit = np.polynomial.Polynomial.fit(u, cap, 2 if reach < 4 else 4, domain=[-1, 1])
    slope = fit.deriv()
    roots = slope.roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    real = real[np.abs(real) <= 1]
    shift = real[np.argmax(fit(real))] if len(real) else 0.0
    return float(lags[top] + reach * shift)


def heights(c: Array, tops: IntArray) -> Array:
    """Heights of peaks between samples, by a parabola through the three highest of each."""
    left, middle, right = (c[np.clip(tops + k, 0, len(c) - 1)] for k in (-1, 0, 1))
    bend = np.maximum(2 * middle - left - right, 1e-15)
    return middle + np.minimum((right - left) ** 2 / bend, bend) / 8
