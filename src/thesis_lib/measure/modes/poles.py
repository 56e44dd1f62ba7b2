"""Fit poles common to all cameras: damped sinusoids by variable projection.

A track is a sum of e^{λt}, λ = −α + jω, at the times of its camera. The poles are common to all
tracks of all cameras, while every track has separate amplitudes. For given poles these follow by
linear least squares; the residual depends on the poles alone (Golub and Pereyra 1973) and is
minimised by Gauss–Newton steps with Kaufman's derivative (1975) and Marquardt's damping. Frames at
any times, different rates, and frequencies above half of a rate need no special treatment. A
rolling shutter or an exposure changes amplitudes, not poles.

The derivative of a column bᵢ by its pole is t times a linear combination of columns. A step
therefore needs a track's residual and the moments Σ bᵢbⱼ, Σ t bᵢbⱼ, Σ t² bᵢbⱼ over the frames in
which its marker is seen. Missing centres are not interpolated.

Modes are found one after the other, each from the residual's strongest line, down to the noise.

A sine of frequency f appears in a camera's frames at its alias. The Fourier sum with e^{−2πjft} at
the frame times finds it at any f. All cameras, even with different rates, therefore have a line at
the true frequency, and only there: the geometric mean of their powers over noise has its peak at
it. Times are rounded to a grid so fine that an FFT can be used.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from thesis_lib.arrays import Array, IntArray, Mask

MAX_CONDITION = 1e12  # largest accepted condition number of a marker's normal equations
MAX_STEPS = 100  # of the fit; from a coarse start it needs about ten
MIN_GAIN = 1e-6  # smallest gain of a step over the residual variance: 0.001 standard errors long
POINTS_PER_FRAME = 8  # grid points between frames; and in a period of the highest frequency
MIN_POWER = 1e-12
PRINCIPAL_SERIES = 16  # principal motions of a camera's markers whose powers are summed
POINTS_PER_LINE = 4  # points of the spectrum per 1 / length of the recording
MIN_LINE_POWER_RATIO = 4.0  # smallest power over noise of a line that is a mode
TRIAL_DECAYS = (0.3, 1.0, 3.0, 10.0, 30.0)  # trial decays over the length of the recording
MAX_RELATIVE_OFFSET = 0.01  # relative search range about a given frequency
MIN_MODE_SPACING = 1.0  # smallest resolved distance of modes, times the length of the recording


@dataclass(frozen=True)
class TrackBlock:
    """Tracks of one camera minus their means, divided by their noise."""

    times: Array  #: From the begin of the fitted interval, s, shape (frames,)
    values: Array  #: Over `scale`, shape (frames, series); 0 where missing
    known: Mask  #: Whether a value is not missing, shape (frames, series)
    scale: Array  #: Noise of each series, shape (series,)

    @cached_property
    def patterns(self) -> tuple[Array, IntArray]:
        """Distinct columns of `known`, shape (frames, patterns), and their index by series."""
        unlike, of = np.unique(self.known, axis=1, return_inverse=True)
        return unlike.astype(float), np.asarray(of.ravel(), int)


@dataclass(frozen=True)
class Poles:
    """A set of fitted poles."""

    rates: Array  #: Decay α (1/s) and angular frequency ω (rad/s) of each, shape (modes, 2)
    covariance: Array  #: Of all these in this order, shape (2 modes, 2 modes); zero if not fitted
    each: Array  #: Changes of the rates if one camera alone were fitted, (cameras, 2 modes)
    each_deviation: Array  #: Their standard deviations by the noise of the tracks, same shape

    @property
    def frequency(self) -> Array:
        """Return the natural frequencies |λ| / 2π in Hz, shape (modes,)."""
        return np.asarray(np.hypot(*self.rates.T) / (2 * np.pi), float)

    @property
    def damping(self) -> Array:
        """Return the damping ratios α / |λ|, shape (modes,)."""
        return np.asarray(self.rates[:, 0] / np.hypot(*self.rates.T), float)

    @property
    def deviations(self) -> tuple[Array, Array]:
        """Return the standard errors of :attr:`frequency` and :attr:`damping`."""
        alpha, omega = self.rates.T
        size = np.hypot(alpha, omega)
        k = 2 * np.arange(len(alpha))
        own = self.covariance[k[:, None, None] + [[0], [1]], k[:, None, None] + [[0, 1]]]
        along = np.stack([alpha, omega], axis=1) / (2 * np.pi * size[:, None])
        turning = np.stack([omega**2, -alpha * omega], axis=1) / size[:, None] ** 3
        found = [np.sqrt(np.einsum("ki,kij,kj->k", g, own, g)) for g in (along, turning)]
        return found[0], found[1]


def block_of(times: Array, values: Array, scale: Array) -> TrackBlock:
    """Divide values (frames, series), NaN where missing, by their noise; subtract their means."""
    known = np.isfinite(values) & np.isfinite(scale)
    over = np.where(known, values, 0.0) / np.where(np.isfinite(scale), scale, 1.0)
    mean = over.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return TrackBlock(times, np.where(known, over - mean, 0.0), known, scale)


def pole_columns(times: Array, rates: Array) -> Array:
    """Evaluate 1, then e^{−αt} cos ωt and e^{−αt} sin ωt of each pole, (times, 1 + 2 modes)."""
    made = [np.ones_like(times)]
    for alpha, omega in rates:
        decay = np.exp(-alpha * times)
        made += [decay * np.cos(omega * times), decay * np.sin(omega * times)]
    return np.stack(made, axis=1)


@dataclass(frozen=True)
class AmplitudeFit:
    """Least-squares amplitudes at given poles for the tracks of one camera."""

    columns: Array  #: Those of :func:`pole_columns`, shape (frames, n)
    coefficients: Array  #: 0 with too few frames, shape (n, series)
    covariance: Array  #: For a noise of one, infinite with too few frames, (series, n, n)
    residual: Array  #: Of the values; 0 where missing, shape (frames, series)


def fit_amplitudes(block: TrackBlock, rates: Array) -> AmplitudeFit:
    """Fit amplitudes at poles (modes, 2) to the known values of each series."""
    B, (seen, of) = pole_columns(block.times, rates), block.patterns
    matrix = _moments(B, B, seen)
    enough = (seen.sum(axis=0) >= B.shape[1] + 2) & (np.linalg.cond(matrix) < MAX_CONDITION)
    inverse = np.linalg.inv(np.where(enough[:, None, None], matrix, np.eye(B.shape[1])))[of]
    found = np.where(enough[of], np.einsum("sij,js->is", inverse, B.T @ block.values), 0.0)
    covariance = np.where(enough[of, None, None], inverse, np.inf)
    return AmplitudeFit(B, found, covariance, np.where(block.known, block.values - B @ found, 0.0))


def _moments(B: Array, C: Array, seen: Array) -> Array:
    """Sum products of columns (frames, n) over the frames of each pattern, (patterns, n, n)."""
    return np.asarray(np.einsum("ti,tj,tp->pij", B, C, seen, optimize=True), float)


def residual_scatter(block: TrackBlock, fit: AmplitudeFit) -> Array:
    """Estimate the scatter of each series about a fit, px; NaN with too few frames."""
    freedom = block.known.sum(axis=0) - len(fit.coefficients)
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.sum(fit.residual**2, axis=0) / freedom)
    return np.asarray(np.where(freedom >= 2, sigma, np.nan) * block.scale, float)


@dataclass(frozen=True)
class Equations:
    """Gauss–Newton equations for poles (modes, 2) from the tracks of one camera."""

    squares: float  #: Sum of the squared residuals
    right: Array  #: Half its negative gradient, shape (2 modes,)
    matrix: Array  #: Half its Hessian in the Gauss–Newton approximation, shape (2 modes, 2 modes)
    noise: tuple[float, int]  #: Squared residuals and freedom of the tracks with enough frames


def equations_of(block: TrackBlock, rates: Array) -> Equations:
    """Set up the equations of one camera at given poles."""
    own, (seen, of) = fit_amplitudes(block, rates), block.patterns
    B, fit, inverse = own.columns, own.coefficients, own.covariance
    tB = B * block.times[:, None]
    mix = np.zeros((len(of), len(fit), rates.size))  # tB @ mix is the derivative of a series' fit
    for k in range(len(rates)):
        cosine, sine = fit[2 * k + 1 : 2 * k + 3]
        mix[:, 2 * k + 1, 2 * k : 2 * k + 2] = np.stack([-cosine, sine], axis=1)
        mix[:, 2 * k + 2, 2 * k : 2 * k + 2] = np.stack([-sine, -cosine], axis=1)
    known = np.isfinite(inverse[:, 0, 0])
    inverse = np.where(known[:, None, None], inverse, 0.0)
    cross, square = _moments(B, tB, seen)[of], _moments(tB, tB, seen)[of]
    inner = square - cross.swapaxes(1, 2) @ inverse @ cross
    squares = np.sum(own.residual**2, axis=0)
    freedom = (block.known.sum(axis=0) - len(fit))[known].sum()
    return Equations(
        float(squares.sum()),
        np.einsum("sif,is->f", mix, tB.T @ own.residual),
        np.einsum("sif,sij,sjg->fg", mix, inner, mix, optimize=True),
        (float(squares[known].sum()), int(freedom)),
    )


def fit_poles(blocks: Sequence[TrackBlock], start: Array, damped: bool) -> Poles:
    """Fit poles from start values (modes, 2); only the frequencies if not `damped`."""
    free = np.flatnonzero(np.tile([damped, True], len(start)))
    every = np.ix_(free, free)
    rates, damping = start, 1e-3
    parts = [equations_of(block, rates) for block in blocks]
    for _ in range(MAX_STEPS):  # Levenberg–Marquardt
        right = np.sum([part.right for part in parts], axis=0)[free]
        matrix = np.sum([part.matrix for part in parts], axis=0)[every]
        step = np.linalg.lstsq(matrix + damping * np.diag(np.diag(matrix)), right)[0]
        squares, freedom = np.sum([part.noise for part in parts], axis=0)
        if not step @ right > MIN_GAIN * squares / max(freedom, 1):
            break
        moved = rates.copy()
        moved.flat[free] += step
        others = [equations_of(block, moved) for block in blocks]
        if sum(one.squares for one in others) < sum(one.squares for one in parts):
            rates, parts, damping = moved, others, damping / 10
        else:
            damping *= 10
    squares, freedom = np.sum([part.noise for part in parts], axis=0)
    noise = float(np.sqrt(squares / max(freedom, 1)))
    covariance = np.zeros((start.size, start.size))
    matrix = np.sum([part.matrix for part in parts], axis=0)[every]
    covariance[every] = noise**2 * np.linalg.pinv(matrix)
    each, deviation = np.zeros((2, len(blocks), start.size))
    for k, part in enumerate(parts):
        alone = np.linalg.pinv(part.matrix[every])
        each[k, free] = alone @ part.right[free]
        deviation[k, free] = noise * np.sqrt(np.maximum(np.diag(alone), 0))
    return Poles(rates, covariance, each, deviation)


@dataclass(frozen=True)
class Spectrum:
    """Power spectrum of the residual."""

    frequency: Array  #: Hz
    power: Array  #: Over each camera's noise, its median; the geometric mean of all cameras

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency in Hz of the strongest line, the lowest of equals, and its power over noise."""
        top = float(self.power.max())
        place = int(np.flatnonzero(self.power >= 0.98 * top)[0])
        while place + 1 < len(self.power) and self.power[place + 1] >= self.power[place]:
            place += 1
        return float(self.frequency[place]), top


def residual_spectrum(
    blocks: Sequence[TrackBlock], rates: Array, band: tuple[float, float]
) -> Spectrum:
    """Compute the spectrum, in a band in Hz, of the residual of a fit at given poles."""
    span = span_of(blocks)
    even = np.arange(band[0], band[1], 1 / (POINTS_PER_LINE * span))
    logs = np.zeros_like(even)
    for block in blocks:
        left = fit_amplitudes(block, rates).residual
        strongest = np.linalg.eigh(left.T @ left)[1][:, -PRINCIPAL_SERIES:]
        left = left @ strongest
        step = float(np.median(np.diff(block.times))) / POINTS_PER_FRAME
        step /= max(1, int(np.ceil(band[1] * POINTS_PER_FRAME * step)))
        place = np.rint((block.times - block.times[0]) / step).astype(int)
        length = scipy.fft.next_fast_len(max(int(POINTS_PER_LINE * span / step), place[-1] + 1))
        lines = np.zeros(length // 2 + 1)
        for series in left.T:
            grid = np.bincount(place, series, length).astype(np.float32)
            lines += np.abs(scipy.fft.rfft(grid)) ** 2 / len(block.times)
        own = np.interp(even, np.arange(len(lines)) / (length * step), lines)
        logs += np.log(np.maximum(own / max(float(np.median(own)), MIN_POWER), MIN_POWER))
    return Spectrum(even, np.exp(logs / len(blocks)))


def search_modes(
    blocks: Sequence[TrackBlock],
    band: tuple[float, float],
    most: int,
    damped: bool,
    given: Sequence[float] = (),
) -> list[Poles]:
    """Return fits with one mode, two modes, … in a band in Hz, each started from the one before.

    Modes near `given` frequencies in Hz are searched for first; frequencies without one are
    skipped. If `damped`, modes decay, and the trial decay with the smallest residual is the start.
    The list is empty if no line exceeds the noise.
    """
    found: list[Poles] = []
    rates, span = np.empty((0, 2)), span_of(blocks)
    decays = [decay / span for decay in TRIAL_DECAYS] if damped else [0.0]
    for near in (*given[:most], *[None] * most):
        line = strongest_line(blocks, rates, band, near)
        if len(found) < most and line is not None:
            trials = [np.vstack([rates, [decay, 2 * np.pi * line]]) for decay in decays]
            left = [
                sum(np.sum(fit_amplitudes(one, trial).residual ** 2) for one in blocks)
                for trial in trials
            ]
            found.append(fit_poles(blocks, trials[int(np.argmin(left))], damped))
            rates = found[-1].rates
        elif near is None:
            break
    return found


def search_range(frequency: float, seconds: float) -> float:
    """Return the search range in Hz about a given frequency in a recording of some seconds."""
    return max(2 * MIN_MODE_SPACING / seconds, MAX_RELATIVE_OFFSET * frequency)


def strongest_line(
    blocks: Sequence[TrackBlock], rates: Array, band: tuple[float, float], near: float | None = None
) -> float | None:
    """Return the strongest line in Hz besides the poles, near a frequency if given.

    It is None if no line exceeds the noise.
    """
    seen = residual_spectrum(blocks, rates, band)
    apart = MIN_MODE_SPACING / span_of(blocks)
    clear = np.all(np.abs(seen.frequency[:, None] - rates[:, 1] / (2 * np.pi)) > apart, axis=1)
    if near is not None:
        clear &= np.abs(seen.frequency - near) <= search_range(near, span_of(blocks))
    power = np.where(clear, seen.power, 0.0)
    if not power.size or not power.max() > MIN_LINE_POWER_RATIO:
        return None
    return Spectrum(seen.frequency, power).peak[0]


def residual_power(after: Spectrum, poles: Poles, seconds: float) -> tuple[Array, Array]:
    """Return the maximum and mean of the residual's power over noise near each mode, (modes,).

    High power indicates another mode that the recording is too short to resolve, or an unsteady
    sine. A mode's error depends on the residual near it, not on the noise at other frequencies. For
    noise alone the mean is about one.
    """
    near = np.abs(after.frequency[:, None] - poles.frequency) <= 2 * MIN_MODE_SPACING / seconds
    power = after.power[:, None]
    mean = np.sum(np.where(near, power, 0.0), axis=0) / np.maximum(near.sum(axis=0), 1)
    return np.max(np.where(near, power, 0.0), axis=0), mean


def span_of(blocks: Sequence[TrackBlock]) -> float:
    """Return the length of the fitted interval, s."""
    return max(float(np.ptp(block.times)) for block in blocks)
