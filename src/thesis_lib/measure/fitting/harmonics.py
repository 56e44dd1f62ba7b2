"""Fit harmonics to tracks, using all frames of all cameras at their own times.

Every image coordinate of every marker is fitted with a constant and the harmonics of a known
frequency. The normal equations are summed part by part, so a recording of any length fits into
memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thesis_lib.arrays import Array, ArrayLike, ComplexArray
from thesis_lib.measure.fitting import reconstruction
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.validation import markers_of
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision import pinhole

INSTANTS = 16  # instants per period at which harmonics are triangulated
#: Frequencies about that of a vibration, in cycles per recording, for the noise near it: the fit
#: absorbs closer ones, and further away the noise may differ
NEAR_CYCLES = np.r_[-8:-1, 2:9]
MIN_SCATTER_PX = 1e-9  # scatter below which a codec repeats a marker, but for rounding


@dataclass(frozen=True)
class Harmonics:
    """Mean and harmonics of tracks, with the scatter about them."""

    #: Constant, then cosine and sine of each harmonic, shape (1 + 2 order, ...)
    coefficients: Array
    #: Of the coefficients, for a scatter of one, shape (1 + 2 order, 1 + 2 order, ...)
    covariance: Array
    #: Standard deviation of the residuals, corrected for degrees of freedom; NaN where the data do
    #: not suffice, shape (...)
    sigma: Array

    def unblurred(self, turn: float) -> Harmonics:
        """Correct the harmonics for the loss by an exposure T; `turn` is ωT in rad.

        The mean over an exposure of T reduces harmonic n by sin(nωT/2) / (nωT/2).
        """
        order = (len(self.coefficients) - 1) // 2
        loss = np.sinc(np.arange(1, order + 1) * turn / (2 * np.pi))
        factor = 1 / np.concatenate([[1.0], np.repeat(loss, 2)])
        along = factor.reshape((-1,) + (1,) * (self.coefficients.ndim - 1))
        covariance = self.covariance * along * along[:, None]
        return Harmonics(self.coefficients * along, covariance, self.sigma)

    def earlier(self, omega: float, seconds: ArrayLike) -> Harmonics:
        """Return the harmonics of values that were sampled `seconds` (...) later than assumed."""
        late = np.asarray(seconds, float)
        coefficients = self.coefficients.copy()
        for n in range(1, (len(coefficients) - 1) // 2 + 1):
            a, b = self.coefficients[2 * n - 1], self.coefficients[2 * n]
            c, s = np.cos(n * omega * late), np.sin(n * omega * late)
            coefficients[2 * n - 1], coefficients[2 * n] = c * a - s * b, s * a + c * b
        return replace(self, coefficients=coefficients)

    def raised(self, constant: ArrayLike) -> Harmonics:
        """Return the harmonics of the values plus a constant (...)."""
        coefficients = self.coefficients.copy()
        coefficients[0] += constant
        return replace(self, coefficients=coefficients)

    def at(self, omega: float, times: ArrayLike) -> Array:
        """Return the values at times (n,), shape (n, ...)."""
        order = (len(self.coefficients) - 1) // 2
        return np.tensordot(harmonic_basis(omega, times, order), self.coefficients, axes=1)


def harmonic_basis(omega: float, times: ArrayLike, order: int) -> Array:
    """Return the columns 1, cos ωt, sin ωt, cos 2ωt …, shape (times, 1 + 2 order)."""
    t = np.asarray(times, float)
    columns = [np.ones_like(t)]
    for n in range(1, order + 1):
        columns += [np.cos(n * omega * t), np.sin(n * omega * t)]
    return np.stack(columns, axis=-1)


def fit_parts(omega: float, parts: Iterable[tuple[Array, Array]], order: int = 2) -> Harmonics:
    """Fit harmonics to values that are given part by part, like :func:`fit_harmonics`.

    Parts are times (n,) and values (n, ...), NaN where missing. The scatter is accurate to about
    1e-8 of the values, so a mean should be subtracted from them.
    """
    matrix, right, squares, count = (np.zeros(1) for _ in range(4))  # normal equations and sums
    for times, values in parts:
        A, shape = harmonic_basis(omega, times, order), values.shape[1:]
        flat = values.reshape(len(A), -1)
        known = np.isfinite(flat)
        filled = np.where(known, flat, 0.0)
        matrix = matrix + np.einsum("ti,tj,ts->sij", A, A, known.astype(float), optimize=True)
        right = right + np.einsum("ti,ts->si", A, filled)
        squares, count = squares + np.sum(filled**2, axis=0), count + known.sum(axis=0)
    n = 1 + 2 * order
    enough = count >= n + 2
    inverse = np.linalg.inv(np.where(enough[:, None, None], matrix, np.eye(n)))
    solution = np.einsum("sij,sj->is", inverse, right)
    left = np.maximum(squares - np.einsum("is,si->s", solution, right), 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(left / (count - n))
    solution[:, ~enough], sigma[~enough] = np.nan, np.nan
    covariance = np.moveaxis(inverse, 0, 2).reshape((n, n, *shape))
    return Harmonics(solution.reshape((n, *shape)), covariance, sigma.reshape(shape))


def fit_harmonics(omega: float, times: ArrayLike, values: ArrayLike, order: int = 2) -> Harmonics:
    """Fit harmonics to values (times, ...) by least squares, ignoring NaN.

    Parameters
    ----------
    omega : float
        Angular frequency of the first harmonic in rad/s.
    times : array_like, shape (times,)
        Common times of all series in s.
    values : array_like, shape (times, ...)
        Series, each fitted separately.
    order : int
        Number of harmonics.

    Returns
    -------
    Harmonics
        NaN for a series with fewer values than coefficients plus two.
    """
    times, values = np.asarray(times, float), np.asarray(values, float)
    found = fit_parts(omega, [(times, values)], order)
    # The scatter from the residuals themselves; in the sums of squares it is lost to rounding.
    left, count = values - found.at(omega, times), np.isfinite(values).sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.nansum(left**2, axis=0) / (count - len(found.coefficients)))
    return replace(found, sigma=np.where(np.isnan(found.sigma), np.nan, sigma))


def mean_of(values: Array) -> Array:
    """Return the mean of finite values over the first axis; NaN where fewer than half are."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    mean = np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(count >= len(values) / 2, mean, np.nan)


@dataclass(frozen=True)
class Fitted:
    """Harmonics of all cameras, and the frame of the markers at rest."""

    cameras: list[pinhole.Camera]  #: Calibrated
    #: Of the tracks (2, markers) of each camera without lens distortion, px
    harmonics: list[Harmonics]
    rest: Array  #: Marker centres at rest without distortion, px, shape (cameras, 2, markers)
    frame: reconstruction.Frame  #: The structure's frame

    @property
    def P(self) -> Array:
        """Return the projection matrices, shape (cameras, 3, 4)."""
        return pinhole.projection_matrices(self.cameras)

    @property
    def sigma(self) -> Array:
        """Return the scatter of the centres about the harmonics, (cameras, 2, markers), px."""
        return np.array([h.sigma for h in self.harmonics])

    @property
    def points(self) -> Array:
        """Return the markers at rest in the calibration's frame, shape (3, markers), m."""
        return reconstruction.triangulate_seen(self.P, self.rest)[0]


def combine_fit(
    cameras: list[pinhole.Camera], harmonics: list[Harmonics], rest: Array, markers: Markers
) -> Fitted:
    """Combine harmonics and markers at rest, with the frame of the markers' grid."""
    points, _ = reconstruction.triangulate_seen(pinhole.projection_matrices(cameras), rest)
    frame = reconstruction.fit_grid(points, markers.world[:, : markers.count])
    return Fitted(cameras, harmonics, rest, frame)


def correct_exposure(fit: Fitted, omega: float, exposures: ArrayLike) -> list[Harmonics]:
    """Correct the harmonics for the loss by each camera's exposure in s."""
    times = np.broadcast_to(np.asarray(exposures, float), len(fit.cameras))
    return [own.unblurred(omega * float(t)) for own, t in zip(fit.harmonics, times, strict=True)]


def deflection_amplitude(fit: Fitted, omega: float, exposures: ArrayLike) -> ComplexArray:
    """Return the complex amplitudes of the deflection at ω in rad/s, shape (markers,), in m."""
    return np.asarray(motion_amplitude(fit, omega, exposures)[2], complex)


def motion_amplitude(fit: Fitted, omega: float, exposures: ArrayLike) -> ComplexArray:
    """Return complex amplitudes along the structure's axes at ω, (3, markers), m, for e^{+jωt}.

    The harmonics of each camera, fitted at its own times, are evaluated at common instants of one
    period and triangulated there without linearisation. The result is the first harmonic of these
    positions.
    """
    times = np.arange(INSTANTS) * 2 * np.pi / (omega * INSTANTS)
    seen = correct_exposure(fit, omega, exposures)
    uv = np.stack([own.at(omega, times).swapaxes(0, 1) for own in seen])
    points, _ = reconstruction.triangulate_seen(fit.P, uv)
    turns = 2 / INSTANTS * np.exp(-1j * omega * times)
    return np.asarray([turns @ along for along in fit.frame.to_beam(points)], complex)


def amplitude_std(fit: Fitted, omega: float, exposures: ArrayLike, axis: int = 2) -> Array:
    """Compute the standard deviation of amplitudes from the centres' scatter, (markers,), m.

    It applies to the real and to the imaginary part, each of which has σ √(2/N) for white noise of
    σ over N frames, along the structure's normal or another `axis`.
    """
    noise = image_std(fit, omega, exposures)
    return reconstruction.height_deviation(fit.P, fit.frame, fit.points, noise, axis)


def image_std(fit: Fitted, omega: float, exposures: ArrayLike) -> Array:
    """Return the std of the real or imaginary image amplitudes, (cameras, 2, markers), px."""
    own = correct_exposure(fit, omega, exposures)
    spread = np.sqrt([0.5 * (h.covariance[1, 1] + h.covariance[2, 2]) for h in own])
    return np.asarray(fit.sigma * spread, float)


def common_phase(shape: ComplexArray, expected: float | None = None) -> float:
    """Return the phase in rad that minimises the quadrature part of a shape.

    Of the two solutions, half a period apart, it is the one nearer to an expected phase in rad, or
    by default the one in which the largest deflection is upward.
    """
    phase = 0.5 * float(np.angle(np.nansum(shape**2)))
    if expected is not None:
        upside_down = np.cos(phase - expected) < 0
    else:
        real = np.nan_to_num(np.real(shape * np.exp(-1j * phase)))
        upside_down = real[np.argmax(np.abs(real))] < 0
    return phase + np.pi if upside_down else phase


def real_shape(amplitude: ComplexArray, expected_phase: float) -> Array:
    """Return the deflection (markers,) in m at its maximum nearest to a phase in rad."""
    phase = common_phase(amplitude, expected_phase)
    return np.asarray(np.real(amplitude * np.exp(-1j * phase)), float)


def fit_tracks(
    recordings: Sequence[Recording],
    rest: Array,
    frame: reconstruction.Frame,
    omega: float,
    begin: float,
    end: float,
    order: int,
) -> Fitted:
    """Fit the harmonics of all cameras' tracks, without correction for exposure.

    `order` harmonics of ω in rad/s are fitted from `begin` to `end` in s. `rest` (cameras, 2,
    markers) is that of :func:`at_rest`, NaN for markers that were hidden then; `frame` is the
    structure's. A rolling shutter exposes every marker at the time of its row; the harmonics are
    corrected to the frames' times.
    """
    fits = []
    for own, middle in zip(recordings, rest.copy(), strict=True):
        found = fit_parts(omega, _parts_about(middle, own.parts(begin, end)), order)
        fits.append(found.raised(middle).earlier(omega, row_delays(own, middle)))
    middle = np.array([own.coefficients[0] for own in fits])
    places = np.where(np.isfinite(rest), rest, middle)  # of markers that were hidden at first
    return Fitted([own.camera for own in recordings], fits, places, frame)


def _parts_about(
    middle: Array, parts: Iterable[tuple[Array, Array]]
) -> Iterator[tuple[Array, Array]]:
    """Yield parts minus positions (2, markers), of which NaN are filled in place with means."""
    for times, uv in parts:
        middle[:] = np.where(np.isfinite(middle), middle, mean_of(uv))
        yield times, uv - middle


def at_rest(own: Recording, seconds: float) -> Array:
    """Return the mean undistorted centres of the rest interval, (2, markers), px."""
    return mean_of(own.read_tracks(own.delay, own.delay + seconds - 1 / own.rate)[1])


def rest_of(
    manifest: Manifest, recordings: Sequence[Recording], seconds: float
) -> reconstruction.Rest:
    """Return the markers at rest, from their mean positions in the first `seconds`.

    Fits from here on are corrected for the size of the markers.
    """
    markers, cameras = markers_of(manifest), [own.camera for own in recordings]
    still = np.array([at_rest(own, seconds) for own in recordings])
    thickness = manifest.structure.thickness_mm / 1000
    rest = reconstruction.check_rest(cameras, still, markers, thickness)
    return replace(rest, radius=markers.diameter / 2)


def describe_rest(rest: reconstruction.Rest, recordings: Sequence[Recording]) -> dict[str, Any]:
    """Return the variables of a result on the markers at rest and the cameras that film them."""
    frame, cameras = rest.frame, [own.camera for own in recordings]
    return {
        "x": rest.places[0],
        "y": rest.places[1],
        "rest_position": frame.to_beam(rest.points),
        "missing": [np.isnan(own.centres[:, 0]).mean(axis=0) for own in recordings],
        "frame_rate": [own.rate for own in recordings],
        "grid_rms": frame.rms,
        "grid_scale": frame.scale,
        "frame_rotation": frame.R,
        "frame_origin": frame.origin,
        "camera_centre": frame.to_beam(np.array([c.centre for c in cameras]).T).T,
        "camera": [c.name for c in cameras],
        "axis": list("xyz"),
    }


def row_delays(own: Recording, uv: Array) -> Array:
    """Compute the rolling-shutter delays of positions (2, markers) after the frames' times, s."""
    rows = pinhole.distort_pixels(own.camera, uv)[1] / own.camera.size[1]
    return np.asarray(own.readout * (rows - 0.5), float)


def noise_near(own: Recording, fit: Harmonics, omega: float, begin: float, end: float) -> float:
    """Estimate the power of a camera's residuals near a frequency over their mean power.

    It is one for white noise. Scatter that is correlated from frame to frame has more power at low
    frequencies and less at high ones, and the variance of an amplitude is proportional to it. A
    linear change of the amplitude is no noise and is removed. `fit` is that of
    :func:`fit_tracks`, of ω in rad/s from `begin` to `end` in s.
    """
    order = (len(fit.coefficients) - 1) // 2
    fit = fit.earlier(omega, -row_delays(own, fit.coefficients[0]))  # at the frames' times
    near = omega + 2 * np.pi * NEAR_CYCLES / (end - begin)
    weight = 1 / np.where(fit.sigma > MIN_SCATTER_PX, fit.sigma, np.nan)
    frames, known = 0, np.zeros(weight.size)
    columns = 2 * order + 3
    square, cross = np.zeros((columns, columns)), np.zeros((columns, len(near)), complex)
    right, lines = np.zeros((columns, weight.size)), np.zeros((len(near), weight.size), complex)
    for times, uv in own.parts(begin, end):
        A, E = harmonic_basis(omega, times, order), np.exp(-1j * np.outer(times, near))
        A = np.hstack([A, A[:, 1:3] * (2 * (times[:, None] - begin) / (end - begin) - 1)])
        left = ((uv - fit.at(omega, times)) * weight).reshape(len(times), -1)
        frames, known = frames + len(times), known + np.isfinite(left).sum(axis=0)
        left = np.nan_to_num(left)
        square, cross = square + A.T @ A, cross + A.T @ E
        right, lines = right + A.T @ left, lines + E.T @ left
    taken = np.linalg.solve(square, cross)  # regression of the spectral lines on the columns of A
    lines = lines - taken.T @ right
    free = (frames * len(near) - np.sum(cross.conj() * taken).real) * known.sum() / frames
    return float(np.sum(np.abs(lines) ** 2) / free) if free > 0 else 1.0
