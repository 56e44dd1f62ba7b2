"""Compute deflection shapes from tracks, and compare them with the modes of the structure's model.

The result is one labelled dataset.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.measure.fitting import errors, frequency as clocks, harmonics, reconstruction
from thesis_lib.measure.fitting.harmonics import Fitted
from thesis_lib.measure.fitting.marker_size import correct_fit
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.manifest_parts import StructureSpec
from thesis_lib.measure.recordings.validation import markers_of
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies.schema import label_values, read_variables, split_complex
from thesis_lib.vibration.motion import Component, fold_frequency, list_aliases
from thesis_lib.vibration.structure import Beam, Plate, resonance_frequency
from thesis_lib.vision.simulation import assurance_criterion

BENDING_MODES, TORSION_MODES, PLATE_MODES = 6, 3, 12  # modes of each kind that are compared
HARMONIC_ORDER = 2  # harmonics of the images that are fitted
MAX_ALIAS_RATIO = 4.0  # highest considered alias over the highest frame rate
ALIAS_FRAMES = 1000  # frames used to distinguish aliases
MAX_SCALE_ERROR = 0.002  # relative error of the grid's size that is tolerated
# Frequency over frame rate from which on the second harmonic's alias is too close to the first's
MIN_FOLDED_RATIO = 0.2
VARIABLES = read_variables(__file__, "shape")


@dataclass(frozen=True)
class Candidate:
    """A mode of the model."""

    name: str  #: Name, such as ``bending 1``
    #: Frequency in Hz of its displacement resonance by the model; NaN where the model has none
    frequency: float
    shape: Array  #: Its deflection at the markers, of arbitrary scale, shape (markers,)


def model_of(structure: StructureSpec) -> Beam | Plate | None:
    """Return the clamped beam or simply supported plate of a structure; None without a model."""
    own = {
        "length": structure.length_mm / 1000,
        "width": structure.width_mm / 1000,
        "thickness": structure.thickness_mm / 1000,
        "density": structure.density_kg_m3,
        "youngs_modulus": structure.youngs_modulus_pa,
        "damping": structure.damping,
    }
    along, markers = structure.force_position_mm / 1000, structure.markers
    if structure.kind == "beam":
        spacing = markers.spacing_mm / 1000
        return Beam(**own, force_position=along, n_markers=markers.columns, marker_spacing=spacing)
    if structure.kind == "plate":
        across = (structure.force_across_mm or structure.width_mm / 2) / 1000
        return Plate(
            **own,
            poisson=structure.poissons_ratio,
            force_position=(along, across),
            grid=(markers.columns, markers.rows),
        )
    return None


def candidate_modes(structure: StructureSpec) -> list[Candidate]:
    """Return the modes to compare a measured shape with; none without a model."""
    model = model_of(structure)
    if model is None:
        return []
    if isinstance(model, Beam):
        kinds = [(f"bending {n}", "bending", n) for n in range(1, BENDING_MODES + 1)]
        kinds += [(f"torsion {n}", "torsion", n) for n in range(1, TORSION_MODES + 1)]
    else:
        pairs = model.mode_indices(PLATE_MODES)
        kinds = [(f"mode ({i}, {j})", "bending", n) for n, (i, j) in enumerate(pairs, 1)]
    found = [
        Candidate(
            name,
            resonance_frequency(model, n) / (2 * np.pi) if kind == "bending" else np.nan,
            Component(kind, n).shape(model, structure.marker_points),
        )
        for name, kind, n in kinds
    ]
    # Markers on a nodal line, such as a single row in torsion, do not move in that mode.
    return [one for one in found if np.abs(one.shape).max() > 1e-9]


def scale_model(measured: Array, shape: Array) -> Array:
    """Scale the model's shape to the measured one by least squares, shape (markers,), m."""
    known = np.isfinite(measured)
    w, phi = measured[known], shape[known]
    return np.asarray(shape * float(np.sum(w * phi) / np.sum(phi * phi)), float)


def compare_modes(shape: Array, modes: list[Candidate]) -> tuple[dict[str, Any], str]:
    """Compare a measured shape (markers,) in m with the model's modes.

    Return variables of the result, and the name of the most similar mode; "" without a model.
    """
    mac = np.array([assurance_criterion(shape, mode.shape) for mode in modes])
    best = modes[int(np.nanargmax(mac))] if np.isfinite(mac).any() else None
    reference = scale_model(shape, best.shape) if best else np.full_like(shape, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = 100 * np.abs(shape - reference) / np.abs(reference).max()
    values = {
        "mac": mac,
        "model_frequency": [mode.frequency for mode in modes],
        "reference_deflection": reference,
        "point_error": error,
        "mean_error": known_rms(error),
    }
    return values, best.name if best else ""


def known_rms(values: Array) -> float:
    """Return the root mean square of the finite values; NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else np.nan


def shape_result(
    manifest: Manifest,
    sound: xr.Dataset,
    recordings: Sequence[Recording],
    covariance: Array | None = None,
) -> xr.Dataset:
    """Compute the deflection shape, its standard errors, and diagnostics.

    Dimensions are ``marker``, ``camera``, ``candidate``, ``axis``.

    Parameters
    ----------
    sound : xarray.Dataset
        Results of the synchronisation: ``frequency`` in Hz, given or estimated, or NaN;
        ``of_sound`` and ``of_sound_deviation``, the frequency of the force signal and its standard
        error, or NaN; ``force``, 0 if unknown; ``steady``.
    covariance : ndarray, optional
        Of the cameras, see :func:`~thesis_lib.measure.calibration.uncertainty.jackknife_cameras`.
        With it the result also has ``SHARED_VARIABLES`` of
        :mod:`~thesis_lib.measure.fitting.errors`, and standard errors include it.

    Raises
    ------
    ChainError
        If the markers at rest do not fit their nominal positions.
    FrequencyError
        If no frequency is given and none is found, or a given one does not explain the motion.
    """
    begin, end = (float(value) for value in sound["steady"].values)
    markers, cameras = markers_of(manifest), [own.camera for own in recordings]
    excitation = manifest.excitation
    still_s = excitation.rest_duration_s or end  # without rest interval, the mean position
    still = harmonics.rest_of(manifest, recordings, still_s)
    rest, frame = still.images, still.frame
    given = float(sound["frequency"])
    start = given if np.isfinite(given) else clocks.search_frequency(recordings, begin, end)
    order = HARMONIC_ORDER if start < MIN_FOLDED_RATIO * min(own.rate for own in recordings) else 1
    paces, pace_errors, corrected = clocks.estimate_paces(recordings, begin, end, start, order)
    recordings = [  # corrected about the middle
        own.scale_clock(1 / (1 + float(pace)), 0.5 * (begin + end)) if is_off else own
        for own, pace, is_off in zip(recordings, paces, corrected, strict=True)
    ]
    phases = clocks.phase_advance(recordings, begin, end, start, order)
    frequency = clocks.refine_frequency(start, phases, sound)
    omega = 2 * np.pi * frequency
    exposures = np.array([own.exposure for own in recordings])
    raw = harmonics.fit_tracks(recordings, rest, frame, omega, begin, end, order)
    scatter = np.sqrt(np.mean(raw.sigma**2, axis=1))
    softened = []
    for own, seen in zip(recordings, raw.harmonics, strict=True):
        power = harmonics.noise_near(own, seen, omega, begin, end)
        noisy = replace(seen, covariance=power * seen.covariance)
        softened.append(errors.widen_frozen_scatter(noisy, markers.centres))
    fit = replace(raw, harmonics=[own for own, _ in softened])
    fit, lags, lag_errors = clocks.correct_starts(fit, omega, exposures)
    fit, edges = correct_fit(fit, omega, exposures, still)
    complex_shape = harmonics.deflection_amplitude(fit, omega, exposures)
    force = complex(*sound["force"].values)
    lag = np.pi / 2 - manifest.structure.damping  # behind the force at resonance
    phase = harmonics.common_phase(complex_shape, float(np.angle(force)) - lag if force else None)
    turned = complex_shape * np.exp(-1j * phase)
    shape = turned.real
    error = edges.propagate_std(harmonics.amplitude_std(fit, omega, exposures))
    usual = np.nanmedian(scatter, axis=-1, keepdims=True)
    frozen = scatter < errors.MAX_FROZEN_RATIO * usual  # markers frozen by video compression
    moving = ~frozen.any(axis=0)
    known = fit, omega, exposures, markers.centres, still.thickness
    moved, excess = errors.estimate_in_plane(*known, moving)
    widening = max(np.nan_to_num(excess), 1.0)
    tone = errors.explained_share(recordings, begin, end, frequency, order)
    asked = np.nan if excitation.frequency_hz is None else excitation.frequency_hz
    if np.isfinite(asked):
        errors.check_explained(tone, asked)
    jumps = [
        errors.find_jump(own, seen, omega, begin, end)
        for own, seen in zip(recordings, raw.harmonics, strict=True)
    ]
    alike, apart = _compare_aliases(recordings, raw, begin, end, frequency)
    if excitation.sound == "none":  # without known starts, lags do not distinguish aliases
        apart = np.full_like(apart, np.nan)

    without, differs = errors.without_each(fit, omega, exposures, phase)
    said = {c.name: c.rate_hz for c in manifest.cameras}
    values = {
        **harmonics.describe_rest(replace(still, points=fit.points), recordings),
        "deflection": shape,
        "standard_error": np.hypot(
            widening * error,
            np.hypot(scale_error(frame.scale) * shape, edges.estimate_error(shape)),
        ),
        "error_of_scatter": error,
        "in_plane": np.sqrt(np.sum(np.abs(moved) ** 2, axis=0)),
        "in_plane_excess": excess,
        "quadrature": turned.imag,
        **split_complex("amplitude", complex_shape),
        "phase": np.degrees(np.angle(complex_shape / force)) if force else np.nan * shape,
        "cameras_seen": np.isfinite(fit.sigma).all(axis=1).sum(axis=0),
        "centre_scatter": scatter,
        "frozen": frozen.astype(int),
        "held_back": [size for _, size in softened],
        "without_camera": without,
        "without_deviation": differs,
        "frequency": frequency,
        "frequency_given": asked,
        "frequency_of_tracks": phases.frequency,
        "frequency_deviation": phases.deviation,
        "growth": phases.growth,
        **tone,
        "alias": alike,
        "alias_lag": apart,
        "pace": paces,
        "pace_deviation": pace_errors,
        "corrected": corrected.astype(int),
        "frame_rate_given": [said.get(own.camera.name, np.nan) for own in recordings],
        "uneven": [_frame_jitter(own) for own in recordings],
        "lag": lags,
        "lag_deviation": lag_errors,
        "jump": [size for size, _ in jumps],
        "jump_time": [when + late for (_, when), late in zip(jumps, lags, strict=True)],
        "rest_misfit": reconstruction.misfit_at_rest(cameras, rest),
        "harmonics": order,
        "frames": [np.diff(own.between(begin, end))[0] for own in recordings],
    }
    modes = candidate_modes(manifest.structure)
    beside, best = compare_modes(shape, modes)
    names = {"candidate": [mode.name for mode in modes]}
    attrs = {"most_similar": best, "sound": excitation.sound}
    data = xr.Dataset(label_values(values | beside | names, VARIABLES), attrs=attrs)
    if covariance is None:
        return data
    rows = errors.common_errors([fit], markers, [omega], exposures, covariance)[:, 0]
    return errors.with_common_errors(data, rows, np.exp(-1j * phase))


def _compare_aliases(
    recordings: Sequence[Recording], fit: Fitted, begin: float, end: float, frequency: float
) -> tuple[Array, Array]:
    """Return alias frequencies in Hz, and the largest phase lag of a camera at each in degrees.

    The frames of one camera cannot distinguish aliases. But cameras start at different times, so at
    a wrong frequency they seem to be out of phase. The frequency itself comes first.
    """
    rates, near = np.array([own.rate for own in recordings]), 1 / (end - begin)
    end = min(end, begin + ALIAS_FRAMES / float(rates.min()))
    highest = MAX_ALIAS_RATIO * float(rates.max())
    alike = [frequency, *list_common_aliases(frequency, rates, near, near, highest)]
    exposures = np.array([own.exposure for own in recordings])
    apart = []
    for other in alike:
        omega = 2 * np.pi * other
        own = harmonics.fit_tracks(recordings, fit.rest, fit.frame, omega, begin, end, 1)
        apart.append(np.degrees(np.abs(clocks.phase_lags(own, omega, exposures)[0]).max()))
    return np.array(alike), np.array(apart)


def list_common_aliases(
    frequency: float, rates: Array, near: float, lowest: float, highest: float
) -> list[float]:
    """List the other frequencies in Hz with the same alias as this one at all frame rates.

    Frequencies that are less than `near` apart count as the same.
    """
    shown = fold_frequency(frequency, rates)
    return [
        float(other)
        for other in list_aliases(float(shown[0]), float(rates[0]), highest)
        if other >= lowest
        and abs(other - frequency) > near
        and np.all(np.abs(fold_frequency(other, rates) - shown) < near)
    ]


def _frame_jitter(own: Recording) -> float:
    """Return the rms deviation in s of the frame times from a constant rate."""
    times = own.times
    k = np.arange(0, len(times), -(-len(times) // 4096))  # a subset of the frames suffices
    return float(np.std(times[k] - np.polyval(np.polyfit(k, times[k], 1), k)))


def scale_error(scale: float) -> float:
    """Return the relative scale error of shapes for a measured grid scale; 0 if tolerated."""
    return scale - 1 if abs(scale - 1) > MAX_SCALE_ERROR else 0.0
