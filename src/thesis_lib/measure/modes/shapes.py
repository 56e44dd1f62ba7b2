"""Complex shapes of modes: image amplitudes of every camera, triangulated at each frequency.

The amplitude of a track at a pole λ tells that of the marker, once it is freed of what the camera
adds: a row that is exposed later by δ has e^{λδ} more, an exposure of T makes sinh(λT/2) / (λT/2)
of it. Each mode is then a harmonic motion, and triangulated as one tone is.

A camera that starts later than was thought sees every mode late, by a phase that grows with its
frequency. Several modes tell how much, beyond the period of any one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.fitting.frequency import LEAST_TURN, MIN_CLOCK_SIGMAS, phase_lags
from thesis_lib.measure.fitting.harmonics import (
    Fitted,
    Harmonics,
    amplitude_std,
    deflection_amplitude,
)
from thesis_lib.measure.fitting.reconstruction import Frame
from thesis_lib.measure.fitting.residuals import in_plane, in_plane_excess, restore_scatter
from thesis_lib.measure.modes.poles import (
    Poles,
    TrackBlock,
    fit_known,
    pole_columns,
    residual_scatter,
)
from thesis_lib.measure.modes.tracks import Track
from thesis_lib.vision.lens import projection_matrices
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.triangulation import image_jacobian

# Times the usual error, from which on a camera has no part in a marker's result
MAX_ERROR_RATIO = 8.0


@dataclass(frozen=True)
class Rest:
    """The markers at rest."""

    images: Array  #: Centres without distortion, px, shape (cameras, 2, markers)
    frame: Frame  #: The structure's
    points: Array  #: In the calibration's frame, m, shape (3, markers)
    places: Array  #: On the structure, m, shape (2, markers)
    thickness: float = 0.0  #: Of the structure, m


@dataclass(frozen=True)
class Shape:
    """One mode's shape."""

    amplitude: ComplexArray  #: Along the normal, m, time factor e^{λt}, shape (markers,)
    deviation: Array  #: Standard error of each of its two parts, m, shape (markers,)
    excess: float  #: Motion in the plane over what the scatter explains; `deviation` holds it
    turn: Array  #: Phase by which each camera lags behind the first, rad, shape (cameras,)
    turn_deviation: Array  #: Its standard error, rad
    fit: Fitted  #: What it was triangulated from; rows and exposures took no time


def blur_factor(rate: Array, exposure: float) -> complex:
    """Return the factor by which an exposure in s reduces the amplitude at a pole (α, ω)."""
    half = complex(-rate[0], rate[1]) * exposure / 2
    return complex(np.sinh(half) / half) if half else 1.0 + 0j


def mode_images(track: Track, block: TrackBlock, poles: Poles) -> list[Harmonics]:
    """Return each mode in one camera's images, as if rows and exposures took no time."""
    markers = track.uv.shape[2]
    B = pole_columns(block.times, poles.rates)
    fit, inverse = fit_known(B, block)
    sigma = residual_scatter(block, B, fit).reshape(2, markers)
    fit = fit * block.scale
    found = []
    for k, rate in enumerate(poles.rates):
        own = slice(2 * k + 1, 2 * k + 3)
        cosine, sine = fit[own].reshape(2, 2, markers)
        pole = complex(-rate[0], rate[1])
        factor = np.exp(-pole * track.usual) / blur_factor(rate, track.exposure)
        part = 0.5 * np.trace(inverse[:, own, own], axis1=1, axis2=2).reshape(2, markers)
        error = np.where(np.isfinite(sigma), sigma * np.sqrt(part), np.nan).max(axis=0)
        clear = np.isfinite(error) & (error <= MAX_ERROR_RATIO * np.nanmedian(error))
        a = np.where(clear, (cosine - 1j * sine) * factor, np.nan)
        spread = np.zeros((3, 3, 2, markers))
        spread[1, 1] = spread[2, 2] = part * np.abs(factor) ** 2
        value = np.stack([np.zeros_like(a.real), a.real, -a.imag])
        found.append(Harmonics(value, spread, np.where(clear, sigma, np.nan)))
    return found


def estimate_shapes(
    tracks: Sequence[Track], blocks: Sequence[TrackBlock], poles: Poles, rest: Rest
) -> list[Shape]:
    """Estimate the shape of every mode."""
    cameras = [track.camera for track in tracks]
    seen = [mode_images(track, block, poles) for track, block in zip(tracks, blocks, strict=True)]
    still = np.zeros(len(cameras))
    found = []
    for k, rate in enumerate(poles.rates):
        omega = float(rate[1])
        own = [
            restore_scatter(one[k].raised(images_at), rest.places)[0]
            for one, images_at in zip(seen, np.nan_to_num(rest.images), strict=True)
        ]
        fit = Fitted(cameras, own, rest.images, rest.frame)
        moved, allowed = in_plane(fit, omega, still, rest.places, rest.thickness)
        more = in_plane_excess(moved, allowed)
        error = amplitude_std(fit, omega, still) * max(np.nan_to_num(more), 1.0)
        turn, turn_error = phase_lags(fit, omega, still)
        found.append(
            Shape(deflection_amplitude(fit, omega, still), error, more, turn, turn_error, fit)
        )
    return found


def remove_nonlinearity(
    track: Track, found: Sequence[Shape], poles: Poles, rest: Rest, zero: float
) -> Track:
    """Return the track without its non-linear part; `zero` is when e^{λt} is one, s.

    An image is no linear function of a deflection, and a marker that moves across rows of a rolling
    shutter is seen at times that depend on it. Both add sums and differences of frequencies, which
    are as large as weak modes. With the modes that are found they are computed, and taken away.
    """
    P, normal = projection_matrices([track.camera]), rest.frame.R[2]

    def predict_heights(late: Array) -> Array:
        at = (track.times - zero)[:, None] + late
        total = np.zeros((len(at), rest.points.shape[1]))
        for shape, rate in zip(found, poles.rates, strict=True):
            own = np.nan_to_num(shape.amplitude) * blur_factor(rate, track.exposure)
            total += np.real(own * np.exp(complex(-rate[0], rate[1]) * at))
        return total

    slope = np.einsum("ikn,k->in", image_jacobian(P, rest.points)[0], normal)
    linear = slope * predict_heights(track.usual[None])[:, None]
    lifted = rest.points[:, None] + normal[:, None, None] * predict_heights(
        np.nan_to_num(track.late)
    )
    true = np.moveaxis(project(P, lifted)[0], 0, 1) - project(P, rest.points)[0]
    return replace(track, uv=track.uv - (true - linear), rows=track.seen_rows)


ASSUMED_START_STD_S = 0.01  # s by which starts are thought to be off at most, rather
# Of a phase's square over its error's that counts: one mode alone decides nothing
MAX_PHASE_CHI2 = 100.0
PHASE_FLOOR_RAD = 0.003  # rad by which phases are off beside what noise does


def camera_lags(found: Sequence[Shape], poles: Poles) -> tuple[Array, Array]:
    """Estimate how much later cameras start than was assumed, where certain, and errors, s."""
    omega = poles.rates[:, 1]
    turn = np.array([shape.turn for shape in found])
    error = np.hypot([shape.turn_deviation for shape in found], PHASE_FLOOR_RAD)
    best = np.zeros(turn.shape[1])
    for c in range(1, turn.shape[1]):
        known = np.isfinite(turn[:, c]) & np.isfinite(error[:, c])
        w, phase, sigma = omega[known], turn[known, c], error[known, c]
        if not known.any():
            continue
        periods = np.arange(-20, 21)
        trials = ((phase[:, None] + 2 * np.pi * periods) / w[:, None]).ravel()
        off = (phase - np.outer(trials, w) + np.pi) % (2 * np.pi) - np.pi
        cost = (
            np.sum(np.minimum((off / sigma) ** 2, MAX_PHASE_CHI2), axis=1)
            + (trials / ASSUMED_START_STD_S) ** 2
        )
        k = int(np.argmin(cost))
        best[c] = trials[k] + np.sum(w * off[k] / sigma**2) / np.sum((w / sigma) ** 2)
    with np.errstate(divide="ignore"):
        errors = 1 / np.sqrt(np.nansum((omega[:, None] / error) ** 2, axis=0))
    errors[0] = 0.0
    certain = np.abs(best) > np.maximum(MIN_CLOCK_SIGMAS * errors, LEAST_TURN / omega.max())
    return np.where(certain, best, 0.0), errors


def clock_rates(poles: Poles, span: float) -> Array:
    """Return the clocks' rates relative to the first camera's, where they are certain.

    All modes are higher by the same share to a camera whose clock runs slow.
    """
    omega = poles.rates[:, 1]
    change, error = poles.each[:, 1::2] / omega, poles.each_deviation[:, 1::2] / omega
    weight = 1 / error**2
    high = np.sum(weight * change, axis=1) / np.sum(weight, axis=1)
    deviation = 1 / np.sqrt(np.sum(weight, axis=1))
    fast = high[0] - high
    enough = np.maximum(
        MIN_CLOCK_SIGMAS * np.hypot(deviation, deviation[0]), LEAST_TURN / omega.max() / span
    )
    return np.where(np.abs(fast) > enough, fast, 0.0)
