"""Estimate complex mode shapes: image amplitudes of every camera, triangulated at each frequency.

Centres where a marker was mistaken for its neighbour outweigh all others in a sum of squares. They
are recognised by comparison with neighbours: neighbouring markers move alike, in modes that are not
fitted, too.

The amplitude of a track at a pole λ contains two factors of the camera: e^{λδ} for a row that is
exposed later by δ, and sinh(λT/2) / (λT/2) for an exposure of T. Both are divided out. Each mode is
then a harmonic motion, and is triangulated like a single sine.

A camera that starts later than assumed records every mode with a phase shift proportional to its
frequency. Several modes determine the delay beyond the period of any one of them.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from thesis_lib.arrays import Array, ComplexArray, Mask
from thesis_lib.measure.fitting import harmonics, reconstruction
from thesis_lib.measure.fitting.errors import estimate_in_plane, widen_frozen_scatter
from thesis_lib.measure.fitting.frequency import MIN_CLOCK_SIGMAS, MIN_PHASE_RAD, phase_lags
from thesis_lib.measure.fitting.marker_size import correct_fit
from thesis_lib.measure.modes import poles as fits
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision import pinhole, triangulation

NEIGHBOUR_COUNT = 8  # neighbours of a marker
# Outlier limit over the neighbours' spread plus the usual distance from them
MAX_OUTLIER_SPREADS = 8.0
MIN_WORST_RATIO = 0.3  # of a marker's largest distance, below which outliers wait for the next pass
MAX_PASSES = 6
# Error over the median, above which a camera is not used for a marker
MAX_ERROR_RATIO = 8.0
ASSUMED_START_STD_S = 0.01  # assumed standard uncertainty of the starts in s
# Largest squared phase over its variance that counts, so that no single mode decides alone
MAX_PHASE_CHI2 = 100.0
PHASE_FLOOR_RAD = 0.003  # systematic standard uncertainty of phases in rad, in addition to noise


@dataclass(frozen=True)
class Track:
    """Tracks of all markers by one camera."""

    camera: pinhole.Camera  #: Calibrated
    times: Array  #: Of the frames' middle rows, on the first camera's clock, s, shape (frames,)
    uv: Array  #: Centres without lens distortion, px, NaN where missing, (frames, 2, markers)
    exposure: float  #: Exposure time in s
    readout: float  #: Time from the first row's exposure to the last row's, s
    rows: Array  #: Image rows of the centres, with distortion, px, shape (frames, markers)

    @property
    def row_delays(self) -> Array:
        """Delay of each centre's exposure after its frame's time, s, shape (frames, markers)."""
        return np.asarray(self.readout * (self.rows / self.camera.size[1] - 0.5), float)

    @property
    def usual(self) -> Array:
        """Mean of :attr:`row_delays` over the frames with the marker, s, shape (markers,)."""
        late = np.ma.masked_invalid(self.row_delays)
        return np.asarray(late.mean(axis=0).filled(0.0), float)


def tracks_of(recordings: Sequence[Recording], begin: float, end: float) -> list[Track]:
    """Read the tracks of all cameras from `begin` to `end` on the first camera's clock, s."""
    found = []
    for own in recordings:
        first, last = own.between(begin, end)
        rows = np.array(own.centres[first:last, 1], float)
        times, uv = own.read_tracks(begin, end)
        found.append(Track(own.camera, times, uv, own.exposure, own.readout, rows))
    return found


def without_strays(track: Track, places: Array) -> Track:
    """Remove centres that move unlike those of their neighbours; `places` are (2, markers)."""
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # of unseen markers
        moved = track.uv - np.nanmedian(track.uv, axis=0)
    return replace(track, uv=np.where(find_strays(moved, places)[:, None], np.nan, track.uv))


def without_outliers(track: Track, block: fits.TrackBlock, rates: Array, places: Array) -> Track:
    """Remove centres whose residuals differ from those of their neighbours."""
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # of unseen markers
        usual = np.nan_to_num(np.nanmedian(track.uv, axis=0))
    halfway = 0.5 * scipy.spatial.KDTree(usual.T).query(usual.T, k=2)[0][:, 1]
    for _ in range(MAX_PASSES):
        left = fits.fit_amplitudes(block, rates).residual
        left = np.where(block.known, left * block.scale, np.nan).reshape(track.uv.shape)
        wrong = find_strays(left, places)
        off = np.hypot(left[:, 0], left[:, 1])
        with np.errstate(invalid="ignore"):  # closer to the next marker than to its own position
            wrong |= (off > halfway) & (off > MIN_WORST_RATIO * np.nanmax(off))
        if not wrong.any():
            break
        known = block.known & ~np.repeat(wrong[:, None], 2, axis=1).reshape(block.known.shape)
        block = replace(block, known=known, values=np.where(known, block.values, 0.0))
    kept = block.known.reshape(track.uv.shape).all(axis=1, keepdims=True)
    return replace(track, uv=np.where(kept, track.uv, np.nan))


def find_strays(moved: Array, places: Array) -> Mask:
    """Return a mask of the motions (frames, 2, markers) that are far from their neighbours'."""
    count = min(NEIGHBOUR_COUNT + 1, places.shape[1])
    _, near = scipy.spatial.KDTree(places.T).query(places.T, k=count)
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):
        around = moved[:, :, near[:, 1:]]
        middle = _median(around)
        spread = _median(np.abs(around - middle[..., None]))
        off = np.abs(moved - middle)
        limit = MAX_OUTLIER_SPREADS * (spread + np.nanmedian(off, axis=0))
        worst = np.nanmax(np.where(off > limit, off, 0), axis=0)
        far = (off > limit) & (off > MIN_WORST_RATIO * worst)
    return np.asarray(far.any(axis=1), bool)


def _median(values: Array) -> Array:
    """Compute the nanmedian over a short last axis, ten times as fast as NumPy's."""
    count = np.isfinite(values).sum(axis=-1, keepdims=True)
    ranked = np.sort(values, axis=-1)  # NaN comes last
    low, high = (
        np.take_along_axis(ranked, np.maximum(place, 0), axis=-1)[..., 0]
        for place in ((count - 1) // 2, count // 2)
    )
    return np.asarray(0.5 * (low + high), float)


@dataclass(frozen=True)
class Shape:
    """One mode's shape."""

    amplitude: ComplexArray  #: Along the normal, m, time factor e^{λt}, shape (markers,)
    deviation: Array  #: Standard error of each of its two parts, m, shape (markers,)
    excess: float  #: In-plane motion over its expected scatter; `deviation` includes it
    turn: Array  #: Phase by which each camera lags behind the first, rad, shape (cameras,)
    turn_deviation: Array  #: Its standard error, rad
    fit: harmonics.Fitted  #: Its image amplitudes, corrected for rolling shutter and exposure


def blur_factor(rate: Array, exposure: float) -> complex:
    """Return the factor by which an exposure in s reduces the amplitude at a pole (α, ω)."""
    half = complex(-rate[0], rate[1]) * exposure / 2
    return complex(np.sinh(half) / half) if half else 1.0 + 0j


def mode_images(
    track: Track, block: fits.TrackBlock, poles: fits.Poles
) -> tuple[list[harmonics.Harmonics], Array]:
    """Estimate each mode's image amplitudes, corrected for rolling shutter and exposure.

    Also return the scatter of the tracks about the modes, px, shape (2 markers,).
    """
    markers = track.uv.shape[2]
    fitted = fits.fit_amplitudes(block, poles.rates)
    sigma = fits.residual_scatter(block, fitted).reshape(2, markers)
    fit = fitted.coefficients * block.scale
    found = []
    for k, rate in enumerate(poles.rates):
        own = slice(2 * k + 1, 2 * k + 3)
        cosine, sine = fit[own].reshape(2, 2, markers)
        pole = complex(-rate[0], rate[1])
        factor = np.exp(-pole * track.usual) / blur_factor(rate, track.exposure)
        part = 0.5 * np.trace(fitted.covariance[:, own, own], axis1=1, axis2=2).reshape(2, markers)
        error = np.where(np.isfinite(sigma), sigma * np.sqrt(part), np.nan).max(axis=0)
        clear = np.isfinite(error) & (error <= MAX_ERROR_RATIO * np.nanmedian(error))
        a = np.where(clear, (cosine - 1j * sine) * factor, np.nan)
        spread = np.zeros((3, 3, 2, markers))
        spread[1, 1] = spread[2, 2] = part * np.abs(factor) ** 2
        value = np.stack([np.zeros_like(a.real), a.real, -a.imag])
        found.append(harmonics.Harmonics(value, spread, np.where(clear, sigma, np.nan)))
    return found, sigma.ravel()


def estimate_shapes(
    tracks: Sequence[Track],
    blocks: Sequence[fits.TrackBlock],
    poles: fits.Poles,
    rest: reconstruction.Rest,
) -> tuple[list[Shape], list[Array]]:
    """Estimate the shape of every mode, and the scatter of each camera's tracks in px."""
    cameras = [track.camera for track in tracks]
    pairs = zip(tracks, blocks, strict=True)
    seen, scatter = zip(*(mode_images(*pair, poles) for pair in pairs), strict=True)
    still = np.zeros(len(cameras))
    # Markers that a camera did not see at rest are reprojected from the other cameras.
    hidden = pinhole.project(pinhole.projection_matrices(cameras), rest.points)
    images = np.where(np.isfinite(rest.images), rest.images, hidden)
    found = []
    for k, rate in enumerate(poles.rates):
        omega = float(rate[1])
        own = [
            widen_frozen_scatter(one[k].raised(images_at), rest.places)[0]
            for one, images_at in zip(seen, images, strict=True)
        ]
        raw = harmonics.Fitted(cameras, own, rest.images, rest.frame)
        fit, edges = correct_fit(raw, omega, still, rest)
        _, excess = estimate_in_plane(fit, omega, still, rest.places, rest.thickness)
        noise = edges.propagate_std(harmonics.amplitude_std(fit, omega, still))
        turn, turn_error = phase_lags(fit, omega, still)
        along = harmonics.deflection_amplitude(fit, omega, still)
        error = np.hypot(noise * max(np.nan_to_num(excess), 1.0), edges.estimate_error(along))
        found.append(Shape(along, error, excess, turn, turn_error, fit))
    return found, [*scatter]


def remove_nonlinearity(
    track: Track, found: Sequence[Shape], poles: fits.Poles, rest: reconstruction.Rest, zero: float
) -> Track:
    """Remove non-linear image motion from a track; `zero` is the time at which e^{λt} is 1, s.

    Image coordinates are no linear function of a deflection, and a marker that moves across the
    rows of a rolling shutter is exposed at times that depend on its motion. Both add sum and
    difference frequencies as large as weak modes. They are computed from the fitted modes.
    """
    P, normal = pinhole.projection_matrices([track.camera]), rest.frame.R[2]

    def predict_heights(late: Array) -> Array:
        at = (track.times - zero)[:, None] + late
        total = np.zeros((len(at), rest.points.shape[1]))
        for shape, rate in zip(found, poles.rates, strict=True):
            own = np.nan_to_num(shape.amplitude) * blur_factor(rate, track.exposure)
            total += np.real(own * np.exp(complex(-rate[0], rate[1]) * at))
        return total

    slope = np.einsum("ikn,k->in", triangulation.image_jacobian(P, rest.points)[0], normal)
    linear = slope * predict_heights(track.usual[None])[:, None]
    heights = predict_heights(np.nan_to_num(track.row_delays))
    lifted = rest.points[:, None] + normal[:, None, None] * heights
    true = np.moveaxis(pinhole.project(P, lifted)[0], 0, 1) - pinhole.project(P, rest.points)[0]
    return replace(track, uv=track.uv - (true - linear))


def camera_lags(found: Sequence[Shape], poles: fits.Poles) -> tuple[Array, Array]:
    """Estimate how much later than assumed cameras start, 0 if not significant, and errors, s."""
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
        misfit = np.sum(np.minimum((off / sigma) ** 2, MAX_PHASE_CHI2), axis=1)
        k = int(np.argmin(misfit + (trials / ASSUMED_START_STD_S) ** 2))
        best[c] = trials[k] + np.sum(w * off[k] / sigma**2) / np.sum((w / sigma) ** 2)
    with np.errstate(divide="ignore"):
        errors = 1 / np.sqrt(np.nansum((omega[:, None] / error) ** 2, axis=0))
    errors[0] = 0.0
    certain = np.abs(best) > np.maximum(MIN_CLOCK_SIGMAS * errors, MIN_PHASE_RAD / omega.max())
    return np.where(certain, best, 0.0), errors


def clock_rates(poles: fits.Poles, span: float) -> Array:
    """Estimate each clock rate's relative excess over the first camera's, 0 if not significant.

    All modes have higher frequencies, by the same share, on a clock that runs slow.
    """
    omega = poles.rates[:, 1]
    change, error = poles.each[:, 1::2] / omega, poles.each_deviation[:, 1::2] / omega
    weight = 1 / error**2
    high = np.sum(weight * change, axis=1) / np.sum(weight, axis=1)
    deviation = 1 / np.sqrt(np.sum(weight, axis=1))
    fast = high[0] - high
    error = np.hypot(deviation, deviation[0])
    enough = np.maximum(MIN_CLOCK_SIGMAS * error, MIN_PHASE_RAD / omega.max() / span)
    return np.where(np.abs(fast) > enough, fast, 0.0)
