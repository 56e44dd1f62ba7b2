"""Clocks by the images: how fast each camera's runs, and by how much its start is off.

All cameras film one vibration. Its frequency by the clock of each tells how fast that runs; and the
phase of what a camera sees, against what the others see move along the normal, when it started, to
within a period. Neither needs sound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.fitting.frequency import phase_advance
from thesis_lib.measure.fitting.harmonics import Fitted, correct_exposure
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.triangulation import image_jacobian

MIN_CLOCK_SIGMAS = 5.0  # standard errors from which on a clock is corrected
LEAST_TURN = 0.01  # rad over the recording, or of the phase, below which it is not worth it


@dataclass(frozen=True)
class Pace:
    """How much faster than the first camera's a clock runs."""

    rate: float  #: Relative, 0 for the same; NaN if it cannot be told
    deviation: float  #: Its standard error
    corrected: bool  #: Whether the camera's times were divided by that


def estimate_paces(
    recordings: Sequence[Recording], begin: float, end: float, frequency: float, order: int
) -> list[Pace]:
    """Estimate the cameras' clock rates from the frequency that each sees."""
    seen = [phase_advance([own], begin, end, frequency, order) for own in recordings]
    first, found = seen[0], [Pace(0.0, 0.0, False)]
    for own in seen[1:]:
        rate = first.frequency / own.frequency - 1
        error = float(np.hypot(first.deviation, own.deviation)) / frequency
        turn = 2 * np.pi * frequency * abs(rate) * (end - begin)
        found.append(
            Pace(rate, error, bool(abs(rate) > MIN_CLOCK_SIGMAS * error and turn > LEAST_TURN))
        )
    return found


def apply_paces(
    recordings: Sequence[Recording], found: Sequence[Pace], at: float
) -> list[Recording]:
    """Return the recordings with the first camera's pace, unchanged near the time `at`."""
    return [
        own.paced(1 / (1 + pace.rate), at) if pace.corrected else own
        for own, pace in zip(recordings, found, strict=True)
    ]


def in_step(data: xr.Dataset, recordings: Sequence[Recording]) -> list[Recording]:
    """Return the recordings with clocks corrected as those of a result were."""
    at = float(data["steady"].mean())
    paces = np.where(data["corrected"], data["pace"], 0.0)
    return [
        replace(moved := own.paced(1 / (1 + float(pace)), at), delay=moved.delay + float(lag))
        for own, pace, lag in zip(recordings, paces, data["lag"].values, strict=True)
    ]


def phase_lags(fit: Fitted, omega: float, exposures: Array) -> tuple[Array, Array]:
    """Return phases by which cameras lag behind the first and their errors, (cameras,), rad.

    What moves along the normal by w has in camera c the image amplitude J w, J being the image of
    the normal, whatever else is true of it. So with w as the first camera sees it, the phase of
    Σ (J w)* A is that of the camera's clock.
    """
    images = _amplitudes(fit, omega, exposures)
    normal = np.einsum("cikn,k->cin", image_jacobian(fit.P, fit.points), fit.frame.R[2])
    own_fits = correct_exposure(fit, omega, exposures)
    noise = fit.sigma * [np.sqrt(0.5 * (h.covariance[1, 1] + h.covariance[2, 2])) for h in own_fits]
    weight = np.sum(normal[0] ** 2, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        w = np.sum(normal[0] * images[0], axis=0) / weight
        own = np.mean(noise[0] ** 2, axis=0) / weight  # variance of each part of w
        against = normal * w
        turned = np.nansum(against.conj() * images / noise**2, axis=(1, 2))
        power = np.nansum(np.abs(against) ** 2 / noise**2, axis=(1, 2))
        passed_on = np.nansum(np.abs(against) ** 2 / noise**4 * (normal**2 * own), axis=(1, 2))
        errors = np.sqrt(power + passed_on) / power
    return np.angle(turned), np.where(np.arange(len(images)) == 0, 0.0, errors)


def lags_of(fit: Fitted, omega: float, exposures: Array) -> tuple[Array, Array]:
    """Estimate how much later cameras start than was assumed, where certain, and errors, s."""
    turn, errors = phase_lags(fit, omega, exposures)
    certain = np.abs(turn) > np.maximum(MIN_CLOCK_SIGMAS * errors, LEAST_TURN)
    return np.where(certain, turn, 0.0) / omega, errors / omega


def _amplitudes(fit: Fitted, omega: float, exposures: Array) -> ComplexArray:
    """Return the complex image amplitudes (cameras, 2, markers), px."""
    own = correct_exposure(fit, omega, exposures)
    return np.array([h.coefficients[1] - 1j * h.coefficients[2] for h in own])


def shift_starts(fit: Fitted, omega: float, seconds: Array) -> Fitted:
    """Return the fit with cameras that started this much later than assumed."""
    moved = [own.earlier(omega, float(s)) for own, s in zip(fit.harmonics, seconds, strict=True)]
    return replace(fit, harmonics=moved)
