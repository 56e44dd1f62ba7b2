"""Estimate the vibration frequency and the cameras' clocks from the tracks.

If no frequency is given, a periodogram yields one. In any case it is measured by the advance of the
motion's phase from part to part of the recording.

All cameras film one vibration. Its frequency on each camera's clock yields the clock's rate. The
phase of a camera's image motion relative to the motion along the normal yields the camera's start,
to within a period. Neither needs sound.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy
import xarray as xr

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.fitting.harmonics import Fitted, correct_exposure, fit_harmonics, fit_parts
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.triangulation import image_jacobian

MAX_PERIODOGRAM_FRAMES = 4096  # most frames of each camera in the periodogram
LIVELY_SERIES = 24  # image coordinates of each camera that move most
MIN_KNOWN = 0.5  # share of the frames in which a coordinate must be known
MIN_EXPLAINED_SHARE = 0.5  # share of their variance that one frequency must explain
PHASE_PARTS = 12  # largest number of parts whose phases are compared
MIN_PART_FRAMES = 16  # fewest frames of such a part
MIN_CLOCK_SIGMAS = 5.0  # standard errors above which a clock is corrected
# Phase drift over the recording, or phase lag, in rad, above which a clock is corrected
MIN_PHASE_RAD = 0.01


class FrequencyError(ValueError):
    """No usable vibration frequency in the tracks; the message is one line."""


@dataclass(frozen=True)
class Advance:
    """Change of the motion's phase and amplitude over the recording."""

    frequency: float  #: Frequency in Hz at which the phase is constant
    #: Its standard error in Hz, from the scatter of the parts, by Student's t for few of them so
    #: large that ±1.96 of it hold 95 %; NaN with fewer than three parts
    deviation: float
    margin: float  #: Half of its 99.7 % interval, Hz
    growth: float  #: Change of the amplitude over the whole recording, relative to its mean


def search_frequency(recordings: Sequence[Recording], begin: float, end: float) -> float:
    """Estimate the frequency in Hz, below half of every frame rate, that explains most motion."""
    series = [liveliest_series(own, begin, end) for own in recordings]
    length = min(float(times[-1] - times[0]) for times, _ in series)
    lowest, highest = 2 / length, 0.48 * min(own.rate for own in recordings)
    if not lowest < highest:
        raise FrequencyError(f"{length:.2f} s of motion are too short to look for its frequency")
    grid = np.arange(lowest, highest, 1 / (4 * length))
    spectra = [sum_spectra(grid, times, np.nan_to_num(values)) for times, values in series]
    peak = float(grid[np.argmax(np.sum(spectra, axis=0))])

    def sum_residuals(frequency: float) -> float:
        omega = 2 * np.pi * frequency
        return sum(
            float(np.nansum(fit_harmonics(omega, times, values, 1).sigma ** 2)) * len(times)
            for times, values in series
        )

    bounds = max(peak - 1 / length, lowest / 2), peak + 1 / length
    found = scipy.optimize.minimize_scalar(
        sum_residuals, bounds=bounds, options={"xatol": 1e-6 * peak}
    )
    total = sum(float(np.sum(np.nanvar(values, axis=0))) * len(times) for times, values in series)
    if not sum_residuals(float(found.x)) < (1 - MIN_EXPLAINED_SHARE) * total:
        raise FrequencyError(
            f"no one frequency from {lowest:.3g} to {highest:.3g} Hz explains half of the motion; "
            "give excitation.frequency_hz"
        )
    return float(found.x)


def sum_spectra(grid: Array, times: Array, values: Array, divisor: float = 1.0) -> Array:
    """Sum the power of series (times, series) at frequencies in Hz, over a divisor."""
    step = (times[-1] - times[0]) / (len(times) - 1)
    n = 1 << int(np.ceil(np.log2(8 * len(times))))
    lines = (np.abs(np.fft.rfft(one, n)) ** 2 for one in values.T)  # one at a time, for memory
    return np.interp(grid, np.fft.rfftfreq(n, step), sum(lines) / divisor)


def liveliest_series(
    recording: Recording, begin: float, end: float, most: int = MAX_PERIODOGRAM_FRAMES
) -> tuple[Array, Array]:
    """Return times (n,) and the image coordinates (n, series) that move most, minus their means.

    About `most` frames are read. Coordinates known in half of them or fewer are left out; missing
    values are NaN.
    """
    times, values = [], []
    for t, uv in recording.parts(begin, end):
        times.append(t)
        values.append(uv.reshape(len(t), -1))
        if sum(map(len, times)) >= most:
            break
    if not times:
        name = recording.camera.name
        raise FrequencyError(f"camera {name} has no frame of the steady-state interval")
    flat = np.concatenate(values)
    seen = flat[:, np.isfinite(flat).mean(axis=0) > MIN_KNOWN]
    if not seen.size:
        raise FrequencyError(
            f"camera {recording.camera.name} sees no marker in more than {MIN_KNOWN:.0%} of the "
            "frames of the steady-state interval: light the markers better, or leave this camera "
            "out"
        )
    moved = seen - np.nanmean(seen, axis=0)
    return np.concatenate(times), moved[:, np.argsort(np.nanstd(moved, axis=0))[-LIVELY_SERIES:]]


def phase_advance(
    recordings: Sequence[Recording], begin: float, end: float, frequency: float, order: int
) -> Advance:
    """Estimate the change of phase and amplitude between parts, from a frequency near the true one.

    Every camera's image coordinates are fitted part by part at f₀. Relative to their mean over the
    parts, the complex amplitudes rotate by 2π (f − f₀) t; the slope of that phase corrects f₀.
    """
    for _ in range(2):  # the mean is larger once the parts are in phase
        middles, turns, sizes, weights, cameras = _fit_parts(
            recordings, begin, end, frequency, order
        )
        if len(middles) < 3:
            return Advance(frequency, np.nan, np.nan, 0.0)
        slope, error, freedom = _fit_slope(middles, turns, weights, cameras)
        frequency += slope / (2 * np.pi)
    within_95, within_997 = error / (2 * np.pi) * scipy.special.stdtrit(freedom, [0.975, 0.99865])
    growth, *_ = _fit_slope(middles, sizes, weights, cameras)
    return Advance(frequency, within_95 / 1.96, within_997, growth * (end - begin))


def _fit_parts(
    recordings: Sequence[Recording], begin: float, end: float, frequency: float, order: int
) -> tuple[Array, ...]:
    """Return middles, phases in rad, sizes, weights and cameras of all cameras' parts, (parts,).

    Phases and sizes are relative to the mean of each camera.
    """
    omega = 2 * np.pi * frequency
    middles, turns, sizes, weights, cameras = [], [], [], [], []
    for camera, own in enumerate(recordings):
        first, last = own.between(begin, end)
        count = int(np.clip((last - first) // MIN_PART_FRAMES, 1, PHASE_PARTS))
        amplitudes, times = [], []
        for low, high in pairwise(np.linspace(begin, end, count + 1)):
            t, uv = own.read_tracks(low, high)
            if not len(t):
                continue
            fit = fit_parts(omega, [(t, uv)], order)
            amplitudes.append((fit.coefficients[1] - 1j * fit.coefficients[2]).ravel())
            times.append(0.5 * (low + high))
        if len(amplitudes) < 3:
            continue
        A = np.array(amplitudes)
        known = np.isfinite(A)
        A = np.where(known, A, 0)
        mean = A.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        own_power = known @ np.abs(mean) ** 2  # of the markers that are seen in each part
        if not own_power.all():  # a part without markers
            continue
        against = A @ mean.conj() / own_power
        middles += times
        turns += list(np.unwrap(np.angle(against)))
        sizes += list(np.abs(against))
        weights += [float(np.vdot(mean, mean).real)] * len(times)
        cameras += [camera] * len(times)
    return tuple(map(np.array, (middles, turns, sizes, weights, cameras)))


def _fit_slope(x: Array, y: Array, weight: Array, camera: Array) -> tuple[float, float, float]:
    """Fit one weighted slope of y over x, with an offset and a scatter of y for every camera.

    Return it with its standard error, and the degrees of freedom of the latter (Welch and
    Satterthwaite).
    """
    own = np.equal.outer(np.unique(camera), camera).astype(float)  # parts of each camera
    number = own.sum(axis=1)
    dx, dy = x - (own @ x / number) @ own, y - (own @ y / number) @ own
    w = weight / weight.sum()
    spread = float(w @ dx**2)
    slope = float(w @ (dx * dy)) / spread
    free = number - 1 - own @ (w * dx**2) / spread
    shares = own @ (w * dx) ** 2 * (own @ (dy - slope * dx) ** 2) / free / spread**2
    variance = float(shares.sum())
    return slope, variance**0.5, variance**2 / float(np.sum(shares**2 / free))


def refine_frequency(start: float, motion: Advance, sound: xr.Dataset) -> float:
    """Return the frequency in Hz for the fit: `start`, or that of tracks or sound if it differs.

    The more precise of the two replaces `start` if this is outside of its 99.7 % interval.
    """
    found = [
        (motion.margin, motion.frequency),
        (3 * float(sound["of_sound_deviation"]), float(sound["of_sound"])),
    ]
    known = [(margin, value) for margin, value in found if np.isfinite([margin, value]).all()]
    margin, value = min(known, default=(np.nan, start))
    return value if abs(value - start) > margin else start


def estimate_paces(
    recordings: Sequence[Recording], begin: float, end: float, frequency: float, order: int
) -> tuple[Array, Array, Mask]:
    """Estimate the cameras' clock rates from the frequencies on their clocks, (cameras,).

    Return the relative excess of each rate over the first camera's, NaN if unknown; its standard
    error; and whether it is significant and large enough for a correction.
    """
    seen = [phase_advance([own], begin, end, frequency, order) for own in recordings]
    by_each, error = np.array([(own.frequency, own.deviation) for own in seen]).T
    rate = by_each[0] / by_each - 1
    error = np.hypot(error[0], error) / frequency
    rate[0] = error[0] = 0.0
    turn = 2 * np.pi * frequency * np.abs(rate) * (end - begin)
    return rate, error, (np.abs(rate) > MIN_CLOCK_SIGMAS * error) & (turn > MIN_PHASE_RAD)


def in_step(data: xr.Dataset, recordings: Sequence[Recording]) -> list[Recording]:
    """Correct the clocks of recordings as in a result."""
    at = float(data["steady"].mean())
    paces = np.where(data["corrected"], data["pace"], 0.0)
    return [
        replace(moved := own.scale_clock(1 / (1 + float(pace)), at), delay=moved.delay + float(lag))
        for own, pace, lag in zip(recordings, paces, data["lag"].values, strict=True)
    ]


def phase_lags(fit: Fitted, omega: float, exposures: Array) -> tuple[Array, Array]:
    """Return phase lags of cameras behind the first and their standard errors, (cameras,), rad.

    A motion w along the normal has the image amplitude A = J w in camera c, where J is the image
    Jacobian along the normal. With w from the first camera, the phase of Σ (J w)* A is thus the
    phase lag of the camera's clock.
    """
    own_fits = correct_exposure(fit, omega, exposures)
    images = np.array([h.coefficients[1] - 1j * h.coefficients[2] for h in own_fits])
    normal = np.einsum("cikn,k->cin", image_jacobian(fit.P, fit.points), fit.frame.R[2])
    noise = fit.sigma * [np.sqrt(0.5 * (h.covariance[1, 1] + h.covariance[2, 2])) for h in own_fits]
    weight = np.sum(normal[0] ** 2, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        w = np.sum(normal[0] * images[0], axis=0) / weight
        own = np.mean(noise[0] ** 2, axis=0) / weight  # variance of each part of w
        against = normal * w
        turned = np.nansum(against.conj() * images / noise**2, axis=(1, 2))
        power = np.nansum(np.abs(against) ** 2 / noise**2, axis=(1, 2))
        shared = np.nansum(normal**2 / noise**2, axis=1)  # both coordinates have the error of w
        passed_on = np.nansum((shared * np.abs(w)) ** 2 * own, axis=1)
        errors = np.sqrt(power + passed_on) / power
    return np.angle(turned), np.where(np.arange(len(images)) == 0, 0.0, errors)


def correct_starts(fit: Fitted, omega: float, exposures: Array) -> tuple[Fitted, Array, Array]:
    """Correct the starts of the cameras in a fit.

    Return the fit, how much later than assumed each camera starts, 0 where not significant, and the
    standard errors, (cameras,), s.
    """
    turn, errors = phase_lags(fit, omega, exposures)
    certain = np.abs(turn) > np.maximum(MIN_CLOCK_SIGMAS * errors, MIN_PHASE_RAD)
    late = np.where(certain, turn, 0.0) / omega
    moved = [own.earlier(omega, float(s)) for own, s in zip(fit.harmonics, late, strict=True)]
    return replace(fit, harmonics=moved), late, errors / omega
