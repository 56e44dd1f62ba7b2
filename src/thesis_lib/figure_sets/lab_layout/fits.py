"""The tracked recordings of ``lab-elevation`` and ``lab-layout``: fits, noise, and the law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.lab_layout.parameters import Layouts
from thesis_lib.figure_sets.lab_layout.recordings import rig_of
from thesis_lib.laboratory.direct import WRONG, Seen, fit_of, times_of, true_centres
from thesis_lib.laboratory.rig import Rig
from thesis_lib.measure.fitting.harmonics import Fitted, fit_harmonics, fitted, unblurred
from thesis_lib.measure.fitting.reconstruction import normal_gain
from thesis_lib.vision import lens
from thesis_lib.vision.triangulation import gain

FEW = 8  # frames that a marker's own noise is taken from at least


def rms(values: Array, axis: int | tuple[int, ...]) -> Array:
    """Root mean square over what is known; NaN where nothing is."""
    return np.asarray(np.sqrt(mean(values**2, axis)))


def mean(values: Array, axis: int | tuple[int, ...] | None = None) -> Array:
    """Mean over what is known; NaN where nothing is."""
    known = np.isfinite(values)
    count = np.count_nonzero(known, axis=axis)
    return np.asarray(np.where(known, values, 0.0).sum(axis=axis) / np.where(count, count, np.nan))


@dataclass(frozen=True)
class Recording:
    """One recording, measured."""

    rig: Rig  #: What was filmed, with what
    #: Harmonics of the tracks with and without noise; None if too few markers were found
    noisy: Fitted | None
    quiet: Fitted | None
    #: Of the middle row's centres, px; NaN where missing, and where a centre is another marker's,
    #: shape (cameras, frames, 2, markers)
    noise: Array
    #: What the quiet centres are off the true ones, px, with the same gaps, shape
    #: (cameras, frames, 2, markers)
    bias: Array
    #: Share of the middle row's centres that are missing, and of the others those off by more than
    #: a pixel, which are other markers', shape (cameras,)
    lost: Array
    wrong: Array

    @property
    def scatter(self) -> Array:
        """Standard deviation of the centres' noise, shape (cameras, 2), px."""
        return rms(self.noise, (1, 3))

    @property
    def roots(self) -> Array:
        """Factors L of the noise's covariances L Lᵀ, shape (cameras, 2, 2, markers), px.

        Off the axis images are leaning ellipses, whose noise along u and v is correlated; far ends
        of the beam have smaller ones. A marker that is seen in few frames has its camera's mean.
        """
        u, v = np.moveaxis(self.noise, 2, 0)
        few = np.count_nonzero(np.isfinite(u), axis=1) < FEW
        uu, uv, vv = (
            np.where(few, mean(product, (1, 2))[:, None], mean(product, 1))
            for product in (u * u, u * v, v * v)
        )
        first = np.sqrt(uu)
        lean = np.where(uu > 0, uv, 0.0) / np.where(uu > 0, first, 1.0)
        last = np.sqrt(np.maximum(vv - lean**2, 0.0))
        rows = np.stack([np.stack([first, 0 * first]), np.stack([lean, last])])
        return np.asarray(np.moveaxis(rows, 2, 0))


def measured(study: Layouts, setting: Setting, noisy: Array, quiet: Array) -> Recording:
    """Fit the tracks (cameras, frames, 2, markers) of one recording, in px of the whole sensor."""
    rig = rig_of(study, setting)
    count, row = rig.markers.count, rig.markers.middle_row
    kinds = [values[: len(rig.stations), :, :, :count] for values in (noisy, quiet)]
    times = [times_of(rig, station) for station in rig.stations]
    truth = np.stack([true_centres(rig, *one) for one in zip(rig.stations, times, strict=True)])
    off = np.hypot(*np.moveaxis(kinds[0] - truth, 2, 0))[:, :, row]
    missing = np.isnan(off)
    wrong = np.where(missing, 0.0, off) > WRONG
    known = np.where(missing | wrong, np.nan, 1.0)[:, :, None]
    found = np.count_nonzero(~missing, axis=(1, 2))
    fits: list[Fitted | None] = []
    for values in kinds:
        seen = [Seen(*one) for one in zip(times, values, truth, strict=True)]
        try:
            fits.append(fit_of(rig, seen, 2 * np.pi * study.frequency_hz))
        except ValueError:  # too few markers at rest
            fits.append(None)
    return Recording(
        rig,
        fits[0],
        fits[1],
        noise=(kinds[0] - kinds[1])[..., row] * known,
        bias=(kinds[1] - truth)[..., row] * known,
        lost=missing.mean(axis=(1, 2)),
        wrong=np.count_nonzero(wrong, axis=(1, 2)) / np.where(found, found, np.nan),
    )


def chosen(fit: Fitted | None, rig: Rig, index: Sequence[int]) -> Fitted | None:
    """The fit of some of the cameras alone, with the frame that they see; None if too few do."""
    if fit is None or len(index) == len(rig.stations):
        return fit
    harmonics = [fit.harmonics[i] for i in index]
    cameras = [fit.cameras[i] for i in index]
    try:
        return fitted(cameras, harmonics, fit.rest[list(index)], rig.markers)
    except ValueError:
        return None


def noise_gain(
    fit: Fitted, omega: float, exposure: float, roots: Array, row: slice = slice(None)
) -> Array:
    """Change of each marker's deflection by a unit draw of each image, (cameras, 2, markers), m.

    White noise of σ in the centres of N frames leaves σ √(2/N) in the part of an amplitude that is
    in phase with the motion; the triangulation takes it to the deflection.
    """
    own = unblurred(fit, omega, exposure)
    spread = np.sqrt([0.5 * (h.covariance[1, 1] + h.covariance[2, 2]) for h in own])[:, :, row]
    seen = np.asarray(np.isfinite(fit.sigma).all(axis=1))[:, row]
    gains = normal_gain(fit.P, fit.frame, fit.points[:, row], seen)
    each = gains * np.where(seen[:, None], spread, 0.0)
    return np.einsum("cim,cijm->cjm", each, np.where(seen[:, None, None], roots, 0.0))


def law(rig: Rig, index: Sequence[int], omega: float, sigma: ArrayLike) -> Array:
    """Standard deviation of each middle marker's amplitude by the first-order law, (markers,), m.

    Σ (∂Z/∂m)² s² over the image coordinates m of all cameras, with s² = 2σ²/N for N frames in whole
    periods, and the same σ = (σ_u, σ_v) for all markers and cameras: what can be said before
    anything is filmed.
    """
    stations = [rig.stations[i] for i in index]
    P = lens.projection_matrices([station.camera for station in stations])
    gains = gain(P, rig.markers.world[:, rig.markers.middle_row])[2]
    parts = []
    for station in stations:
        times = times_of(rig, station)
        times = times[times >= rig.motion.steady]
        covariance = fit_harmonics(omega, times, np.zeros(len(times))).covariance
        parts.append(0.5 * (covariance[1, 1] + covariance[2, 2]))
    variance = np.array(parts)[:, None] * np.asarray(sigma, float) ** 2
    return np.asarray(np.sqrt(np.einsum("cim,ci->m", gains**2, variance)))
