"""Noise before rounding: how much there is, and what any estimator could make of such pixels.

On a grid whose place is random the pixel's middle is off by e, the sum of Gaussian noise of σ px
and of the rounding, even over a pixel, whatever the coordinate. Of it the density p and the Fisher
information are

    p(e) = Φ((e + ½) / σ) − Φ((e − ½) / σ),    I = ∫ p′² / p de  per px².

Points cannot be had to less than (I JᵀJ)⁻¹, on average over the places of the grids and of the
points (Cramér and Rao's bound, in van Trees' form for unknowns that are drawn). For σ from 0.3 px
on it is what least squares reaches, (σ² + 1/12) (JᵀJ)⁻¹, within 2 %; for σ → 0 it goes to 0 as σ,
and no estimator follows it: faces of pixels are then sharp, but few of them are near.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.vision.interval import LEAST_PX, interval_estimate, pixel_mass
from thesis_lib.vision.triangulation import point_covariance

MOST_PX = 1.0  # noise that is looked for
_SIGMA_STEPS = 16  # of an integral over σ
_REACH_SIGMAS = 10  # σ beyond a pixel's faces, where the integral ends
# Fall of the logarithm of the likelihood at the ends of an interval of 95 %
_LIKELIHOOD_FALL = 1.92


def pixel_information(sigma_px: float) -> float:
    """Return Fisher's information in 1/px² of a coordinate with noise, rounded to pixels.

    Raises
    ------
    ValueError
        If σ is not above 0: without noise there is no limit.
    """
    if not 0 < sigma_px < np.inf:
        raise ValueError(f"sigma_px: given {sigma_px}, allowed: a number above 0, in px")
    step = min(sigma_px / _SIGMA_STEPS, 0.5 / _SIGMA_STEPS)
    number = np.ceil((0.5 + _REACH_SIGMAS * sigma_px) / step)
    log_p, slope, _ = pixel_mass(step * np.arange(-number, number + 1), sigma_px**2)
    return float(np.sum(slope**2 * np.exp(log_p)) * step)


def least_covariance(P: ArrayLike, points: ArrayLike, sigma_px: float) -> Array:
    """Return bound the covariance (3, 3, ...) in m² of any estimate of points (3, ...) from below.

    That of a deflection is the sum of those at rest and deflected.
    """
    return point_covariance(P, points, pixel_information(sigma_px) ** -0.5)


@dataclass(frozen=True)
class Noise:
    """Noise of pixels in px as their likelihood has it: the best value, and the ends of 95 %."""

    best: float
    least: float
    most: float


def estimate_noise(P: ArrayLike, uv: ArrayLike) -> Noise:
    """Estimate images' noise before rounding from how they disagree with each other.

    Parameters
    ----------
    P : array_like, shape (cameras, 3, 4)
        Projection matrices.
    uv : array_like, shape (cameras, 2, ...)
        Centres of the pixels in px, of hundreds of points; those with NaN are left out.

    Returns
    -------
    Noise
        Of the evidence for σ from 0 to 1 px, which is that all points have together. A pair of
        cameras tells little, since it has one coordinate too many for a point; few points tell
        nothing: then `least` is 0 and `most` far away. Errors of the cameras count as noise. The
        evidence is an approximation, which makes noise below 0.05 px a few thousandths too small,
        and with two cameras cannot tell less than 0.1 px from none.

    Raises
    ------
    ValueError
        If fewer than two cameras are given, the shapes do not match, or no point is whole.
    """
    P, images = np.asarray(P, float), np.asarray(uv, float)
    images = images.reshape(*images.shape[:2], -1)
    images = images[:, :, np.isfinite(images).all(axis=(0, 1))]
    if images.shape[2] == 0:
        raise ValueError("uv: given no point that all cameras see, needs 1 or more")

    def evidence(sigma: float) -> float:
        return float(np.sum(interval_estimate(P, images, sigma).evidence))

    low, high = 0.0, MOST_PX
    best, top = 0.0, -np.inf
    while high - low > LEAST_PX / 2:  # each round looks at a fourth of the last
        grid = np.linspace(low, high, 9)
        found = [evidence(sigma) for sigma in grid]
        at = int(np.argmax(found))
        best, top = float(grid[at]), found[at]
        low, high = float(grid[max(at - 1, 0)]), float(grid[min(at + 1, 8)])

    def bisect_end(inside: float, outside: float) -> float:
        """Return the position towards an end at which the evidence has fallen so far."""
        if top - evidence(outside) < _LIKELIHOOD_FALL:
            return outside
        while abs(outside - inside) > LEAST_PX / 2:
            middle = (inside + outside) / 2
            likely = top - evidence(middle) < _LIKELIHOOD_FALL
            inside, outside = (middle, outside) if likely else (inside, middle)
        return (inside + outside) / 2

    return Noise(best, bisect_end(best, 0.0), bisect_end(best, MOST_PX))
