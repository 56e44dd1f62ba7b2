"""Estimate the errors of a fitted vibration: in-plane motion, other frequencies, calibration.

A structure that bends moves along its normal. Apparent motion of its markers in its plane is
therefore an error of centres, clocks or calibration. It needs no third camera, and shows by how
much the scatter of the centres underestimates the error.

An error of a focal length or of a camera's position rotates and stretches the measured shape for
all markers alike. Noise of the centres averages out where many markers are summed, as in sound
radiation; this error does not. The amplitudes are therefore triangulated again with cameras changed
by one standard deviation in each independent direction of the calibration's covariance. The pose of
the world frame does not matter: the structure's frame is fitted to its markers at rest.
"""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray, Mask
from thesis_lib.measure.calibration.bundle_adjustment import step_network, without_boards
from thesis_lib.measure.fitting import harmonics, reconstruction
from thesis_lib.measure.fitting.frequency import FrequencyError, liveliest_series, sum_spectra
from thesis_lib.measure.fitting.harmonics import Fitted, Harmonics
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies.schema import label_values, read_variables, split_complex
from thesis_lib.vision import pinhole

MAX_FROZEN_RATIO = 0.2  # of the median scatter, below which compression has frozen a marker
MIN_AWAKE_RATIO = 0.5  # of the median scatter, from which on a marker is certainly not frozen
MIN_MOVING_NEIGHBOURS = 6  # moving markers compared with each frozen one
SLOPE_NEIGHBOURS = 9  # markers from which the slope of the surface at one of them is fitted
MIN_TONE_POWER_RATIO = 40.0  # smallest power of another sine over the residual's mean power
MAX_SPECTRUM_FRAMES = 2048  # most frames in which another sine is searched for
EXAMINED_SERIES = 8  # image coordinates of each camera in that search
MIN_JUMP_PX = 0.1  # smallest reported jump of a whole image, px
MIN_JUMP_SIGMAS = 8.0  # smallest reported jump in standard errors
MAX_JUMP_FRAMES = 4096  # most frames in which a jump is searched for
MIN_EDGE_FRAMES = 5  # fewest frames before and after a jump
MIN_MOTION_SHARE = 0.05  # share of the motion below which a frequency does not explain it
MAX_DIRECTIONS = 16  # principal directions of the calibration error that are kept, the largest
SHARED_VARIABLES = read_variables(__file__, "shared_errors")


def widen_frozen_scatter(own: Harmonics, places: Array) -> tuple[Harmonics, float]:
    """Return one camera's harmonics with scatter increased for motion lost by video compression.

    A codec repeats a part of an image that hardly changes: small motions are lost, slightly larger
    ones in part. The threshold θ is the median image amplitude of moving markers next to frozen
    ones. At an amplitude a the loss is at most about θ min(1, θ²/a²), as in videos by x264. The
    scatter of a marker is raised to at least half of the camera's median.

    The tracks are (2, markers), and the markers' `places` (2, markers) on the structure in m.
    Return the harmonics with larger `sigma`, and θ in px: 0 if no marker is frozen.
    """
    each = np.sqrt(np.mean(own.sigma**2, axis=0))
    if not np.isfinite(each).any():
        return own, 0.0
    middle = np.nanmedian(each)
    sigma = np.maximum(own.sigma, MIN_AWAKE_RATIO * np.nanmedian(own.sigma))
    size = np.sqrt(np.sum(own.coefficients[1:3] ** 2, axis=(0, 1)))
    still, awake = each < MAX_FROZEN_RATIO * middle, each >= MIN_AWAKE_RATIO * middle
    if not still.any() or not awake.any():
        return replace(own, sigma=sigma), 0.0
    count = min(MIN_MOVING_NEIGHBOURS, np.count_nonzero(awake))
    _, nearest = scipy.spatial.KDTree(places[:, awake].T).query(places[:, still].T, k=count)
    threshold = float(np.median(size[awake][nearest]))
    with np.errstate(divide="ignore"):
        loss = threshold * np.minimum(1, (threshold / size) ** 2)
    loss[still] = threshold
    spread = np.sqrt(0.5 * (own.covariance[1, 1] + own.covariance[2, 2]))
    return replace(own, sigma=np.hypot(sigma, loss / spread)), threshold


def estimate_in_plane(
    fit: Fitted,
    omega: float,
    exposures: Array,
    places: Array,
    thickness: float,
    counted: Mask | slice = slice(None),
) -> tuple[ComplexArray, float]:
    """Estimate the in-plane motion not explained by bending, and its ratio to the expected scatter.

    Markers are on the surface, half a thickness above the mid-plane of a structure whose normal
    turns with the slope of its deflection: they move in the plane by that slope times a length,
    which is fitted and at most the thickness. The motion is along the structure's x and y,
    (2, markers), in m; the ratio is an rms over the `counted` markers, NaN if unknown.
    """
    u, v, w = harmonics.motion_amplitude(fit, omega, exposures)
    moved, seen = np.array([u, v]), np.isfinite(w)
    slope = np.full((2, len(w)), np.nan + 0j)
    if np.count_nonzero(seen) >= 4:  # planes fitted to neighbours
        count = min(SLOPE_NEIGHBOURS, np.count_nonzero(seen))
        _, near = scipy.spatial.KDTree(places[:, seen].T).query(places.T, k=count)
        offset = places[:, seen][:, near] - places[:, :, None]
        A = np.stack([*offset, np.ones_like(offset[0])], axis=-1)  # markers, neighbours, 3
        slope[:] = (np.linalg.pinv(A, rcond=1e-6) @ w[seen][near][..., None])[:, :2, 0].T
    known = np.isfinite(moved + slope).all(axis=0)
    square = float(np.sum(np.abs(slope[:, known]) ** 2))
    if square:
        along = float(np.sum((slope.conj() * moved).real[:, known])) / square
        moved = moved - np.clip(along, -thickness, thickness) * np.nan_to_num(slope)
    std = np.array([harmonics.amplitude_std(fit, omega, exposures, axis) for axis in (0, 1)])
    with np.errstate(invalid="ignore", divide="ignore"):  # std: of the real or imaginary part
        squares = (np.abs(moved) ** 2 / (2 * std**2))[:, counted]
    finite = squares[np.isfinite(squares)]
    return moved, float(np.sqrt(finite.mean())) if finite.size else np.nan


def without_each(fit: Fitted, omega: float, exposures: Array, phase: float) -> tuple[Array, Array]:
    """Return the shapes without each camera, and their expected deviations from the full shape.

    Both are (cameras, markers), in m, and NaN with two cameras. The shapes with and without a
    camera share centres, so the scatter of a centre counts by the difference of its gains. The
    deviation is NaN where the camera that is left out does not see a marker.
    """
    count = len(fit.cameras)
    shapes = np.full((count, fit.rest.shape[2]), np.nan)
    deviations, noise = shapes.copy(), harmonics.image_std(fit, omega, exposures)
    seen: Mask = np.all(np.isfinite(noise), axis=1)
    noise = np.where(seen[:, None], noise, 0.0)
    gain_of = partial(reconstruction.normal_gain, fit.P, fit.frame, fit.points)
    whole = gain_of(seen)
    for left_out in range(count if count > 2 else 0):
        kept = [i for i in range(count) if i != left_out]
        cameras, own = [fit.cameras[i] for i in kept], [fit.harmonics[i] for i in kept]
        part = Fitted(cameras, own, fit.rest[kept], fit.frame)
        turned = harmonics.deflection_amplitude(part, omega, exposures[kept]) * np.exp(-1j * phase)
        shapes[left_out] = turned.real
        others = seen & (np.arange(count) != left_out)[:, None]
        deviation = np.sqrt(np.sum(((gain_of(others) - whole) * noise) ** 2, axis=(0, 1)))
        deviations[left_out] = np.where(seen[left_out], deviation, np.nan)
    return shapes, deviations


def explained_share(
    recordings: Sequence[Recording], begin: float, end: float, frequency: float, order: int
) -> dict[str, float]:
    """Return the share of the steady-state motion that a frequency and its harmonics explain.

    ``explained`` is the share of the variance of the image coordinates that move most. The
    strongest other sine has ``other_frequency`` in Hz, NaN if there is none, and
    ``other_amplitude`` relative to the vibration, 0 if there is none.
    """
    found = {"explained": np.nan, "other_frequency": np.nan, "other_amplitude": 0.0}
    series = []
    for own in recordings:
        with contextlib.suppress(FrequencyError):  # a camera that lost its markers
            t, values = liveliest_series(own, begin, end, MAX_SPECTRUM_FRAMES)
            series.append((t, values[:, -EXAMINED_SERIES:].copy()))
    if not series:
        return found
    total = left = 0.0
    length = min(float(times[-1] - times[0]) for times, _ in series)
    highest = 0.5 * min(own.rate for own in recordings)
    grid = np.arange(1 / length, highest, 1 / (4 * length))
    power, counted = np.zeros_like(grid), 0
    for times, values in series:
        fit = harmonics.fit_harmonics(2 * np.pi * frequency, times, values, order)
        rest = np.nan_to_num(values - fit.at(2 * np.pi * frequency, times))
        values = np.nan_to_num(values)
        total += float(np.sum((values - values.mean(axis=0)) ** 2)) / len(times)
        left += float(np.sum(rest**2)) / len(times)
        power += sum_spectra(grid, times, rest, len(times) ** 2)
        counted = max(counted, len(times))
    if not total or not len(grid):
        return found
    found["explained"] = 1 - left / total
    peak = int(np.argmax(power))
    tone = 4 * float(power[peak]) / 2  # variance of a sine from its line in the spectrum
    if tone < MIN_TONE_POWER_RATIO * left / counted:
        return found
    fitted = max(total - left, 1e-4 * tone)  # at least what chance explains
    ratio = float(np.sqrt(tone / fitted))
    return found | {"other_frequency": float(grid[peak]), "other_amplitude": ratio}


def find_jump(
    own: Recording, fit: Harmonics, omega: float, begin: float, end: float
) -> tuple[float, float]:
    """Find a jump of a camera's whole image: its size, px, and time, s; 0 and NaN without one.

    A camera jumps when it is touched. The time is on the first camera's clock. `fit` is that of
    :func:`harmonics.fit_tracks`.
    """
    late = harmonics.row_delays(own, fit.coefficients[0])
    fit = fit.earlier(omega, -late)  # without row correction, as `own.parts` yields centres
    first, last = own.between(begin, end)
    every = -(-(last - first) // MAX_JUMP_FRAMES)  # a subset of the frames suffices
    times, common = [], []
    for t, uv in ((t[::every], uv[::every]) for t, uv in own.parts(begin, end)):
        rest = uv - fit.at(omega, t)
        seen = np.isfinite(rest).any(axis=(1, 2))
        times.append(t[seen])
        common.append(np.nanmedian(rest[seen], axis=2))
    moved = np.concatenate(common)
    known = np.isfinite(moved).all(axis=1)
    when, moved = np.concatenate(times)[known], moved[known]
    n = len(moved)
    if n < 4 * MIN_EDGE_FRAMES:
        return 0.0, np.nan
    before = np.arange(MIN_EDGE_FRAMES, n - MIN_EDGE_FRAMES)
    sums = np.cumsum(moved, axis=0)
    until = sums[before - 1]
    jump = (sums[-1] - until) / (n - before)[:, None] - until / before[:, None]
    size = np.hypot(*jump.T)
    weight = np.sqrt(before * (n - before) / n)
    k = int(np.argmax(size * weight))
    white = 1.05 * np.median(np.hypot(*np.diff(moved, axis=0).T)) / np.sqrt(2)
    if size[k] < max(MIN_JUMP_PX, MIN_JUMP_SIGMAS * white / weight[k]):
        return 0.0, np.nan
    return float(size[k]), float(when[before[k]])


def check_explained(tone: Mapping[str, float], given: float) -> None:
    """Refuse a given frequency in Hz that explains none of a motion with another frequency."""
    if tone["explained"] < MIN_MOTION_SHARE and tone["other_amplitude"] > 1:
        raise FrequencyError(
            f"excitation.frequency_hz: given {given:.6g}, which explains "
            f"{max(tone['explained'], 0):.1%} of the motion; most of it is near "
            f"{tone['other_frequency']:.3g} Hz: allowed: the frequency of the motion, or null"
        )


def common_errors(
    fits: Sequence[Fitted],
    markers: Markers,
    omegas: Sequence[float],
    exposures: Array,
    covariance: Array,
) -> ComplexArray:
    """Return amplitude errors in m due to calibration, in independent rows of one std each.

    Parameters
    ----------
    fits, omegas
        One or several vibrations, fitted with the calibrated cameras, and their ω in rad/s.
    markers : Markers
        Markers on the structure.
    exposures : ndarray
        Exposure times in s.
    covariance : ndarray, shape (14 n, 14 n)
        Of n cameras, see :func:`~thesis_lib.measure.calibration.uncertainty.jackknife_cameras`.

    Returns
    -------
    ndarray, shape (rows, fits, markers)
        Principal directions of the amplitude errors, the largest, at most :data:`MAX_DIRECTIONS`.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, ways = np.linalg.eigh(covariance / scale[:, None] / scale)
    large = values > 1e-9 * values[-1]
    steps = [scale * w * np.sqrt(v) for v, w in zip(values[large], ways.T[large], strict=True)]

    def perturb_amplitudes(step: Array) -> ComplexArray:
        moved = [
            harmonics.deflection_amplitude(_refit_images(fit, markers, step), omega, exposures)
            for fit, omega in zip(fits, omegas, strict=True)
        ]
        return np.concatenate(moved)

    changes = [perturb_amplitudes(step / 2) - perturb_amplitudes(-step / 2) for step in steps]
    rows = np.nan_to_num(np.array(changes))
    parts = np.concatenate([rows.real, rows.imag], axis=1)
    _, size, mixed = np.linalg.svd(parts, full_matrices=False)
    kept = size[:MAX_DIRECTIONS, None] * mixed[:MAX_DIRECTIONS]
    real, imag = np.split(kept, 2, axis=1)
    return np.reshape(real + 1j * imag, (len(kept), len(fits), -1))


def with_common_errors(data: xr.Dataset, rows: ComplexArray, turns: ComplexArray) -> xr.Dataset:
    """Add :data:`SHARED_VARIABLES` to a result, and include them in its standard errors.

    `rows` are those of :func:`common_errors`, for all fits or one; `turns` rotate the complex
    amplitudes to the phase of largest deflection.
    """
    own = data["standard_error"]
    shared = np.sqrt(np.sum(np.real(rows * turns) ** 2, axis=0))
    own.values[:] = np.hypot(own.values, shared)
    values = split_complex("shared", rows)
    return data.assign(label_values(values, SHARED_VARIABLES, ("row", *map(str, own.dims[:-1]))))


def _refit_images(fit: Fitted, markers: Markers, step: Array) -> Fitted:
    """Convert the harmonics to cameras changed by a step, and fit the frame at rest again."""
    cameras = step_network(without_boards(fit.cameras), step).cameras
    seen, rest, reach = [], [], 0.5  # px
    for old, new, own, still in zip(fit.cameras, cameras, fit.harmonics, fit.rest, strict=True):
        mean = own.coefficients[0]
        ways = reach * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [0, 0]])
        places = np.stack([*(mean + way[:, None] for way in ways), still], axis=1)
        # All at once: one call is far faster
        again = pinhole.undistort_pixels(new, pinhole.distort_pixels(old, places))
        right, left, below, above, constant, resting = again.swapaxes(0, 1)
        # Harmonics are undistorted to first order about their mean.
        slopes = np.stack([right - left, below - above]) / (2 * reach)
        moved = np.einsum("inm,kim->knm", slopes, own.coefficients[1:])
        seen.append(replace(own, coefficients=np.concatenate([constant[None], moved])))
        rest.append(resting)
    return harmonics.combine_fit(list(cameras), seen, np.array(rest), markers)
