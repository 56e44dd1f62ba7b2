"""Identify modes in the tracks of calibrated cameras, as one labelled dataset."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
import xarray as xr

from thesis_lib.arrays import Array, ArrayLike, stack_padded
from thesis_lib.measure.fitting import errors, harmonics, reconstruction, result
from thesis_lib.measure.modes import poles as fits, shapes as motions
from thesis_lib.measure.modes.poles import Poles, TrackBlock
from thesis_lib.measure.modes.shapes import Track
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.validation import markers_of
from thesis_lib.measure.tracking import tracks
from thesis_lib.studies.cubes import complex_of
from thesis_lib.studies.schema import label_values, read_variables, split_complex

MAX_MODES = 8  # largest number of modes if none is given
FURTHER_MODES = 2  # further modes that are fitted, to see how stable the others are
MIN_MARKERS = 3  # fewest markers of a shape
MAX_CHANCE = 0.95  # confidence level of the chi-square test for disagreement of the cameras
OUTLIER_ROUNDS = 3  # rounds in which outliers and non-linear image motion are removed
VARIABLES = read_variables(__file__, "modes")


class ModalError(ValueError):
    """Tracks that do not determine the requested modes; the one-line message names a remedy."""


@dataclass(frozen=True)
class ModeRequest:
    """Requested modes."""

    band: tuple[float, float]  #: Lowest and highest frequency, Hz
    count: int | None = None  #: Number of modes; None: all that exceed the noise
    damped: bool = True  #: Whether they decay freely; else they are steady-state sines
    given: tuple[float, ...] = ()  #: Frequencies near which modes are searched for, Hz


def identify_modes(
    tracks: Sequence[Track], rest: reconstruction.Rest, asked: ModeRequest
) -> tuple[xr.Dataset, list[harmonics.Fitted]]:
    """Identify the modes in the tracks of all cameras, in the order of their frequencies.

    The tracks cover the fitted interval only: steady-state sines, or a free decay. A marker moves
    as Re Σ a e^{λ (t − zero)}, with its complex deflection a in each mode and
    λ = 2πf (−ζ + j √(1 − ζ²)).

    Returns
    -------
    data : xarray.Dataset
        The part of :data:`VARIABLES` that tracks and rest determine. Standard errors include the
        disagreement of the cameras. ``error_of_scatter`` is independent between markers and between
        real and imaginary part. ``scale_deviation`` is common to a shape of a decay: its relative
        error of size, and its error of phase in rad. For steady-state sines it is 0; the phase
        error is then π times ``frequency_deviation`` times the duration.
    fits : list of Fitted
        Image amplitudes of each mode, from which its shape was triangulated.

    Raises
    ------
    ModalError
        If no mode, or not each given one, exceeds the noise; if given frequencies are closer than
        the recording resolves; or if frames or markers are too few.
    """
    most = len(asked.given) or asked.count or MAX_MODES
    seen = np.array([np.count_nonzero(np.isfinite(track.uv)) for track in tracks])
    whole = [motions.without_strays(track, rest.places) for track in tracks]
    _check(whole, asked, most)
    zero = min(float(track.times[0]) for track in tracks)
    noise = [np.ones(2 * track.uv.shape[2]) for track in tracks]
    own, given = list(whole), asked.given
    late, pace = np.zeros(len(own)), np.ones(len(own))
    rivals: list[list[tuple[float, float]]] = []
    for turn in range(OUTLIER_ROUNDS + 1):
        blocks = [
            fits.block_of(track.times - zero, track.uv.reshape(len(track.times), -1), sigma)
            for track, sigma in zip(own, noise, strict=True)
        ]
        further = FURTHER_MODES if turn == OUTLIER_ROUNDS else 0
        orders = fits.search_modes(blocks, asked.band, most + further, asked.damped, given)
        _check_found(blocks, orders, asked)
        poles = orders[min(most, len(orders)) - 1]
        if turn == 0:
            poles, rivals = _resolve_aliases(own, blocks, poles, rest, asked)
            given = tuple(poles.rates[:, 1] / (2 * np.pi))
        found, noise = motions.estimate_shapes(own, blocks, poles, rest)
        if turn == OUTLIER_ROUNDS:
            break
        more, lag_deviation = motions.camera_lags(found, poles)
        span = fits.span_of(blocks)
        middle = zero + span / 2  # time about which clock rates are corrected
        if turn:  # the first fit may contain outliers
            late = late + more
            if not asked.damped:  # a decay is too short to estimate clock rates
                pace = pace / (1 + motions.clock_rates(poles, span))
        for k, block in enumerate(blocks):
            kept = motions.without_outliers(own[k], block, poles.rates, rest.places)
            whole[k] = replace(whole[k], uv=np.where(np.isfinite(kept.uv), whole[k].uv, np.nan))
            moved = replace(whole[k], times=middle + (whole[k].times - middle) * pace[k] + late[k])
            own[k] = motions.remove_nonlinearity(moved, found, poles, rest, zero)
    after = fits.residual_spectrum(blocks, poles.rates, asked.band)
    most_left, mean_left = fits.residual_power(after, poles, fits.span_of(blocks))
    wider = np.sqrt(np.maximum(mean_left, 1))  # noise near each mode over the median noise
    surely = _inflate_covariance(poles, wider, orders[len(poles.rates) :])
    order = np.argsort(poles.frequency)
    taken = np.array([own[0][0] for own in rivals])
    nearest = [int(np.argmin(np.abs(taken - f))) for f in poles.frequency[order]]
    found = [found[k] for k in order]
    next_best = [[*rivals[k], (np.nan, np.nan)][1] for k in nearest]
    frequency_deviation, damping_deviation = surely.deviations
    amplitude = np.array([one.amplitude for one in found])
    turned = np.array([one.turn for one in found])
    before = fits.residual_spectrum(blocks, np.empty((0, 2)), asked.band)
    values: dict[str, Any] = {
        **split_complex("amplitude", amplitude),
        "error_of_scatter": np.array([one.deviation for one in found]) * wider[order, None],
        "in_plane_excess": [one.excess for one in found],
        "assurance": modal_assurance(amplitude),
        "out_of_step": np.degrees(np.nanmax(np.abs(turned), axis=1)),
        "rival": [hertz for hertz, _ in next_best],
        "rival_out_of_step": np.degrees([phase for _, phase in next_best]),
        "order_frequency": stack_padded(np.sort(own.frequency) for own in orders),
        "order_damping": stack_padded(own.damping[np.argsort(own.frequency)] for own in orders),
        "line": before.frequency,
        "before": before.power,
        "after": after.power,
        "frequency": poles.frequency[order],
        "frequency_deviation": frequency_deviation[order],
        "damping": poles.damping[order],
        "damping_deviation": damping_deviation[order],
        "scale_deviation": _scale(blocks[0], surely)[order],
        "beside": most_left[order],
        "zero": zero,
        "noise": np.nanmedian(np.concatenate(noise)),
        "lag": late,
        "lag_deviation": lag_deviation,
        "pace": 1 / pace - 1,
        "left_out": 1 - np.array([np.count_nonzero(np.isfinite(one.uv)) for one in whole]) / seen,
    }
    return xr.Dataset(label_values(values, VARIABLES)), [one.fit for one in found]


def modal_assurance(shapes_: ArrayLike) -> Array:
    """Compute the modal assurance criterion (MAC) between complex shapes (modes, markers).

    Parameters
    ----------
    shapes_ : array_like, shape (modes, markers)
        Complex deflections, NaN where a marker is not known.

    Returns
    -------
    ndarray, shape (modes, modes)
        |aᴴb|² / (aᴴa bᴴb) over the markers known in both shapes.
    """
    a = np.asarray(shapes_, complex)
    known = np.isfinite(a)
    a = np.where(known, a, 0)
    cross = np.abs(a.conj() @ a.T) ** 2
    in_each = [np.where(seen, a, 0) for seen in known]
    power = np.array([np.diag(np.abs(b.conj() @ b.T) ** 2) for b in in_each])
    with np.errstate(invalid="ignore"):
        return np.asarray(cross / (power * power.T) ** 0.5, float)


def _inflate_covariance(poles: Poles, wider: Array, further: Sequence[Poles]) -> Poles:
    """Increase the covariance of the poles where errors exceed the noise.

    Standard errors grow by Birge's ratio where cameras disagree significantly, at least by `wider`
    for each mode. The largest change of each pole as further modes are fitted adds in quadrature.
    """
    freedom = max(len(poles.each) - 1, 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        squares = np.nansum((poles.each / poles.each_deviation) ** 2, axis=0)
    bound = scipy.stats.chi2.ppf(MAX_CHANCE, freedom)
    ratio = np.where(squares > bound, np.sqrt(squares / freedom), 1.0)
    ratio = np.maximum(ratio, np.repeat(wider, 2))
    covariance = poles.covariance * np.outer(ratio, ratio)
    changed = np.zeros_like(poles.rates)
    for more in further:
        apart = np.abs(poles.rates[:, None, 1] - more.rates[:, 1])
        nearest = more.rates[np.argmin(apart, axis=1)]
        changed = np.maximum(changed, np.abs(nearest - poles.rates))
    return replace(poles, covariance=covariance + np.diag(changed.ravel() ** 2))


def _scale(block: TrackBlock, poles: Poles) -> Array:
    """Estimate the relative error of initial amplitudes due to that of the decay rates, (modes,).

    An amplitude is measured best at the centroid of its energy in time. That is later where the
    first and fastest centres are missing, so each frame is weighted by its share of known centres.
    """
    decay = np.exp(-2 * np.clip(poles.rates[:, 0], 0, None) * block.times[:, None])
    weight = decay * block.known.mean(axis=1)[:, None]
    middle = np.sum(weight * block.times[:, None], axis=0) / weight.sum(axis=0)
    return np.asarray(middle * np.sqrt(np.diag(poles.covariance)[::2]), float)


def _resolve_aliases(
    tracks: Sequence[Track],
    blocks: Sequence[TrackBlock],
    poles: Poles,
    rest: reconstruction.Rest,
    asked: ModeRequest,
) -> tuple[Poles, list[list[tuple[float, float]]]]:
    """Set each mode to the alias frequency at which the cameras' phases agree best.

    Given frequencies are not changed. Also return, for each mode, its aliases in Hz with the
    largest phase lag of a camera at each in rad; the chosen one comes first.
    """
    rates = poles.rates.copy()
    frames = np.array([(len(b.times) - 1) / np.ptp(b.times) for b in blocks])
    near, told = 1 / fits.span_of(blocks), []
    for k, (alpha, omega) in enumerate(poles.rates):
        own = omega / (2 * np.pi)
        others = result.list_common_aliases(
            own, frames, near, max(asked.band[0], near), asked.band[1]
        )
        apart: list[tuple[float, float]] = []
        for other in [own, *others] if others else []:
            trial = np.array([[alpha, 2 * np.pi * other]])
            alone = replace(poles, rates=np.vstack([trial, np.delete(poles.rates, k, axis=0)]))
            shapes, _ = motions.estimate_shapes(tracks, blocks, alone, rest)
            apart.append((other, float(np.nanmax(np.abs(shapes[0].turn)))))
        kept = any(abs(own - f) <= fits.search_range(f, 1 / near) for f in asked.given)
        apart.sort(key=lambda one: (kept and one[0] != own, one[1]))
        told.append(apart or [(own, 0.0)])
        rates[k, 1] = 2 * np.pi * told[k][0][0]
    if np.array_equal(rates, poles.rates):
        return poles, told
    return fits.fit_poles(blocks, rates, asked.damped), told


def _check(tracks: Sequence[Track], asked: ModeRequest, most: int) -> None:
    """Refuse too few frames or markers, and given frequencies that cannot be resolved."""
    fewest = min(len(track.times) for track in tracks)
    needed = 4 * most + 4
    if fewest < needed:
        raise ModalError(
            f"{fewest} frames of a camera lie in the part that is fitted, {most} modes need "
            f"{needed}: ask for fewer modes, or film longer"
        )
    seconds = max(float(np.ptp(track.times)) for track in tracks)
    given = np.sort(asked.given)
    close = np.flatnonzero(np.diff(given) < 1 / seconds)
    if len(close):
        one, other = given[close[0]], given[close[0] + 1]
        raise ModalError(
            f"{one:.6g} and {other:.6g} Hz are {other - one:.3g} Hz apart, and {seconds:.3g} s "
            f"resolve {1 / seconds:.3g} Hz: film {1 / (other - one):.3g} s or more"
        )
    seen = sum(np.isfinite(track.uv).all(axis=1).mean(axis=0) > 0.5 for track in tracks)
    if (count := int(np.count_nonzero(np.asarray(seen) >= 2))) < MIN_MARKERS:
        raise ModalError(
            f"{count} markers are seen by two cameras or more, a shape needs {MIN_MARKERS}: add "
            "markers, or turn cameras so that two see each"
        )


def _check_found(blocks: Sequence[TrackBlock], orders: Sequence[Poles], asked: ModeRequest) -> None:
    """Refuse tracks in which no mode, or not each given one, exceeds the noise."""
    rates = orders[-1].rates if orders else np.empty((0, 2))
    hertz, seconds = rates[:, 1] / (2 * np.pi), fits.span_of(blocks)
    lost = [
        f for f in asked.given if not np.any(np.abs(hertz - f) <= fits.search_range(f, seconds))
    ]
    if orders and not lost:
        return
    at, over = fits.residual_spectrum(blocks, rates, asked.band).peak
    band = f"from {asked.band[0]:.4g} to {asked.band[1]:.4g} Hz"
    what = f"no tone near {lost[0]:.6g} Hz" if lost else f"no mode {band}"
    raise ModalError(
        f"{what} stands out of the noise; the strongest line {band} is at {at:.4g} Hz, {over:.1f} "
        "times the noise: tap or drive harder, film nearer or longer, or ask for another band"
    )


def modes_result(
    manifest: Manifest,
    sound: xr.Dataset,
    recordings: Sequence[tracks.Recording],
    covariance: Array | None = None,
) -> xr.Dataset:
    """Identify the modes in recordings, along ``mode``, ``marker`` and ``camera``.

    Parameters and errors are those of :func:`thesis_lib.measure.fitting.result.shape_result`; a
    ``ModalError`` means that the tracks do not determine the requested modes. Each mode has the
    variables that exports need. With a covariance the result also has ``SHARED_VARIABLES`` of
    :mod:`~thesis_lib.measure.fitting.errors`, and standard errors of shapes include it.
    """
    rest = harmonics.rest_of(manifest, recordings, manifest.excitation.rest_duration_s)
    frame_off = result.scale_error(rest.frame.scale)
    begin, end = fit_window(manifest, sound, recordings)
    seen = motions.tracks_of(recordings, begin, end)
    sought = manifest.excitation.modes
    band = sought.from_hz, sought.to_hz or 0.5 * min(own.rate for own in recordings)
    decays = manifest.excitation.behaviour.decays
    asked = ModeRequest(band, sought.count, decays, sought.near_hz or ())
    found, images = identify_modes(seen, rest, asked)
    amplitude = complex_of(found, "amplitude")
    turns = np.exp([[-1j * harmonics.common_phase(own)] for own in amplitude])
    shape = amplitude * turns
    models = result.candidate_modes(manifest.structure)
    compared = [result.compare_modes(own, models)[0] for own in shape.real]
    values: dict[str, Any] = {
        **harmonics.describe_rest(rest, recordings),
        "deflection": shape.real,
        "quadrature": shape.imag,
        "standard_error": np.hypot(found["error_of_scatter"], frame_off * np.abs(shape)),
        "window": [begin, end],
        "frames": [len(track.times) for track in seen],
        "mac": np.reshape([one["mac"] for one in compared], (len(shape), len(models))),
        "model_frequency": [model.frequency for model in models],
        "reference_deflection": [one["reference_deflection"] for one in compared],
        "candidate": [model.name for model in models],
    }
    data = found.assign(label_values(values, VARIABLES))
    data = data[[*VARIABLES]]  # sets the order in files
    if covariance is None:
        return data
    still = np.zeros(len(recordings))  # exposure times: the fits are already corrected for them
    omegas = 2 * np.pi * found["frequency"].values * np.sqrt(1 - found["damping"].values ** 2)
    rows = errors.common_errors(images, markers_of(manifest), omegas.tolist(), still, covariance)
    return errors.with_common_errors(data, rows, turns)


def fit_window(
    manifest: Manifest, sound: xr.Dataset, recordings: Sequence[tracks.Recording]
) -> tuple[float, float]:
    """Return begin and end of the fitted interval, s; a decay begins at its largest motion."""
    begin, end = (float(value) for value in sound["steady"].values)
    excitation = manifest.excitation
    if not excitation.behaviour.decays or excitation.steady_interval_s is not None:
        return begin, end
    largest = []
    for own in recordings:
        times, uv = own.read_tracks(begin, end)
        moved = np.nanmedian(np.abs(uv - np.nanmedian(uv, axis=0)), axis=(1, 2))
        largest.append(times[int(np.nanargmax(moved))] + abs(own.readout) + own.exposure)
    return float(np.median(largest)), end
