"""What tracks tell of a frequency: where it shows, and at which of its aliases the cameras agree.

A camera by itself cannot tell a frequency f from its aliases: the samples are the same. But a fit
at f uses the times at which the frames were taken, and they give every camera the right phase. At
an alias kr away, r the frame rate, a camera that starts later by s is wrong by 2πkrs. Cameras that
are not in step then disagree about how a marker moves, which their common geometry shows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.fitting.aliasing import scan
from thesis_lib.measure.fitting.harmonics import Fitted, basis
from thesis_lib.vision.triangulation import jacobian


def explained(frequencies: ArrayLike, times: Sequence[Array], values: Sequence[Array]) -> Array:
    """Share of the scatter that a constant and one harmonic explain, at each of some frequencies.

    Parameters
    ----------
    frequencies : array_like, shape (n,)
        In Hz.
    times : sequence of ndarray, shape (frames,)
        Of each camera, s.
    values : sequence of ndarray, shape (frames, series)
        Of each camera; every series has a harmonic of its own. Series with gaps are left out.

    Returns
    -------
    ndarray, shape (n,)
        From 0 to 1: a periodogram with a free mean, summed over all series.
    """
    left = np.zeros(np.size(frequencies))
    total = 0.0
    for t, every in zip(times, values, strict=True):
        y = every[:, np.isfinite(every).all(axis=0)]
        y = y - y.mean(axis=0)
        total += float(np.sum(y**2))
        A = np.stack([basis(2 * np.pi * f, t, 1) for f in np.ravel(np.asarray(frequencies, float))])
        Q = np.linalg.qr(A)[0]
        left += np.sum((np.swapaxes(Q, 1, 2) @ y) ** 2, axis=(1, 2))
    return left / total


def read_frequency(times: Sequence[Array], values: Sequence[Array], rate: float) -> float:
    """The frequency in Hz below half of the frame rate that explains most of some tracks.

    It is what they show to whoever does not know better; parameters as for :func:`explained`.
    """
    grid = scan(rate, len(times[0]))
    best, step = grid[np.argmax(explained(grid, times, values))], grid[1] - grid[0]
    while step > 1e-6 * rate:
        near = best + step * np.linspace(-1, 1, 11)
        best, step = near[np.argmax(explained(near, times, values))], step / 5
    return float(best)


def images(fit: Fitted) -> ComplexArray:
    """Complex amplitudes of the fundamental in the pictures, shape (cameras, 2, markers), px."""
    return np.array([h.coefficients[1] - 1j * h.coefficients[2] for h in fit.harmonics])


def misfit(fit: Fitted) -> float:
    """How far the cameras disagree, over what the noise of their centres makes them.

    The complex amplitudes in the pictures are fitted with one motion in space for each marker; what
    is left is compared with the scatter about the harmonics. Near 1 at the true frequency; cameras
    that are in step agree at every alias.
    """
    U = images(fit)
    seen = np.isfinite(U).all(axis=(0, 1))
    J = np.moveaxis(jacobian(fit.P, fit.points[:, seen]), -1, 0)
    J = J.reshape(len(J), -1, 3)
    u = np.moveaxis(U[:, :, seen], -1, 0).reshape(len(J), -1)
    spread = np.array([np.sqrt(h.covariance[1, 1] + h.covariance[2, 2]) for h in fit.harmonics])
    noise = np.moveaxis((spread * fit.sigma)[:, :, seen], -1, 0).reshape(len(J), -1)
    weighted = J / noise[:, :, None]
    X = np.linalg.pinv(weighted) @ (u / noise)[:, :, None]
    left = (u / noise)[:, :, None] - weighted @ X
    freedom = len(J) * (J.shape[1] - 3)
    return float(np.sqrt(np.sum(np.abs(left) ** 2) / freedom))
