"""From tracks, clocks and calibrated cameras to deflection shapes, in one labelled dataset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import add
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.fitting.frequency import Advance, advance, look_for
from thesis_lib.measure.fitting.harmonics import (
    Fitted,
    Harmonics,
    amplitude,
    deviation,
    mean_of,
    sums_of,
)
from thesis_lib.measure.fitting.models import Candidate, candidates, scaled
from thesis_lib.measure.fitting.reconstruction import checked_frame
from thesis_lib.measure.recordings.check import markers_of
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.tracking.tracks import Recording, lost_share
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vision.lens import distorted
from thesis_lib.vision.simulation import assurance

ORDER = 2  # harmonics of the images that are fitted
FOLDED = 0.2  # of the frame rate; from there on the second harmonic's alias nears the first's
VARIABLES = declared("""
    x(marker) [m] place along the structure
    y(marker) [m] place across the structure
    deflection(marker) [m] deflection at its maximum
    standard_error(marker) [m] standard error of it by the centres' scatter
    quadrature(marker) [m] deflection a quarter of a period later
    amplitude_real(marker) [m] complex amplitude, exp(+jωt), on the first camera's clock, real part
    amplitude_imag(marker) [m] the same, imaginary part
    phase(marker) [degree] phase to the force; NaN if that is unknown
    rest_position(axis, marker) [m] place at rest, from the structure's centre
    cameras_seen(marker) [1] cameras that a marker's deflection rests on
    missing(camera, marker) [1] share of the frames in which a marker is missing
    centre_scatter(camera, marker) [px] rms scatter of a coordinate of the centres about its
        harmonics
    without_camera(camera, marker) [m] deflection from all cameras but one; NaN with two cameras
    without_deviation(camera, marker) [m] standard deviation of its difference from that of all
        cameras
    frequency() [Hz] frequency of the fit
    frequency_of_tracks() [Hz] frequency that the tracks show
    frequency_deviation() [Hz] its standard error
    growth() [1] change of the amplitude over the steady part
    harmonics() [1] harmonics of the images that were fitted
    frames(camera) [1] frames that the fit used
    grid_rms() [m] rms distance of the markers at rest from their places
    grid_scale() [1] size of the measured grid over the nominal one
    frame_rotation(axis, i) [1] from the calibration's axes to the structure's
    frame_origin(i) [m] the structure's centre in the calibration's frame
    camera_centre(camera, axis) [m] centre of projection from the structure's
    mac(candidate) [1] modal assurance criterion with the model's mode
    model_frequency(candidate) [Hz] frequency of that mode's resonance by the model
    reference_deflection(marker) [m] the most similar mode of the model in the size that fits best
    point_error(marker) [percent] distance from it over its largest deflection
    mean_error() [percent] root of the mean square of these (eq. 3.22)
""")


def result(manifest: Manifest, sound: xr.Dataset, recordings: Sequence[Recording]) -> xr.Dataset:
    """Deflection shape, its standard errors, and what they rest on.

    Parameters
    ----------
    manifest : Manifest
        What was recorded.
    sound : xarray.Dataset
        What the sound tells: ``frequency`` in Hz, given or found, or NaN; ``of_sound`` and
        ``of_sound_deviation``, what the force's signal has, or NaN; ``force``, 0 if unknown;
        ``steady``.
    recordings : sequence of Recording
        Cameras, clocks and tracks.

    Returns
    -------
    xarray.Dataset
        Dimensions ``marker``, ``camera``, ``candidate``, ``axis``.

    Raises
    ------
    ChainError
        If the markers at rest do not fit their places.
    FrequencyError
        If no frequency is given and none is found.
    """
    begin, end = (float(value) for value in sound["steady"].values)
    markers, cameras = markers_of(manifest), [own.camera for own in recordings]
    rest = np.array([_at_rest(own, manifest.excitation.rest_s) for own in recordings])
    frame = checked_frame(cameras, rest, markers)
    given = float(sound["frequency"])
    start = given if np.isfinite(given) else look_for(recordings, begin, end)
    order = ORDER if start < FOLDED * min(own.rate for own in recordings) else 1
    motion = advance(recordings, begin, end, start, order)
    frequency = _best(start, motion, sound)
    omega = 2 * np.pi * frequency
    harmonics = [
        _harmonics(own, still, omega, begin, end, order)
        for own, still in zip(recordings, rest, strict=True)
    ]
    exposures = np.array([own.exposure for own in recordings])
    scatter = np.sqrt(np.mean([h.sigma**2 for h in harmonics], axis=1))
    fit = Fitted(cameras, [_not_frozen(own) for own in harmonics], rest, frame)
    complex_shape = amplitude(fit, omega, exposures)
    force = complex(*sound["force"].values)
    phase = _common_phase(complex_shape, force, manifest.structure.damping)
    turned = complex_shape * np.exp(-1j * phase)
    shape, error = turned.real, deviation(fit, omega, exposures)

    without, differs = _without_each(fit, omega, exposures, phase)
    values = {
        "x": markers.centres[0],
        "y": markers.centres[1],
        "deflection": shape,
        "standard_error": error,
        "quadrature": turned.imag,
        "amplitude_real": complex_shape.real,
        "amplitude_imag": complex_shape.imag,
        "phase": np.degrees(np.angle(complex_shape / force)) if force else np.nan * shape,
        "rest_position": frame.to_beam(fit.points),
        "cameras_seen": np.isfinite(fit.sigma).all(axis=1).sum(axis=0),
        "missing": [lost_share(own) for own in recordings],
        "centre_scatter": scatter,
        "without_camera": without,
        "without_deviation": differs,
        "frequency": frequency,
        "frequency_of_tracks": motion.frequency,
        "frequency_deviation": motion.deviation,
        "growth": motion.growth,
        "harmonics": order,
        "frames": [np.diff(own.between(begin, end))[0] for own in recordings],
        "grid_rms": frame.rms,
        "grid_scale": frame.scale,
        "frame_rotation": frame.R,
        "frame_origin": frame.origin,
        "camera_centre": frame.to_beam(np.array([c.centre for c in cameras]).T).T,
    }
    modes = candidates(manifest.structure)
    compared, best = _compared(shape, modes)
    coords = {
        "camera": ("camera", [c.name for c in cameras], {"long_name": "camera"}),
        "axis": ("axis", ["x", "y", "z"], {"long_name": "axis of the structure"}),
        "candidate": ("candidate", [m.name for m in modes], {"long_name": "mode of the model"}),
    }
    return xr.Dataset(labelled(values | compared, VARIABLES), coords, {"most_similar": best})


def _best(start: float, motion: Advance, sound: xr.Dataset) -> float:
    """The frequency in Hz of the fit: what was given or looked for, unless tracks or sound differ.

    The more certain of the two decides, if it is three standard errors away.
    """
    found = [
        (motion.deviation, motion.frequency),
        (float(sound["of_sound_deviation"]), float(sound["of_sound"])),
    ]
    known = [(error, value) for error, value in found if np.isfinite([error, value]).all()]
    error, value = min(known, default=(np.nan, start))
    return value if abs(value - start) > 3 * error else start


def _at_rest(own: Recording, seconds: float) -> Array:
    """Mean centres before the motion, without distortion, (2, markers), px."""
    last = own.delay + seconds - 1 / own.rate
    parts = [uv for _, uv in own.parts(own.delay, last)]
    return mean_of(np.concatenate(parts))


def _harmonics(
    own: Recording, still: Array, omega: float, begin: float, end: float, order: int
) -> Harmonics:
    """Harmonics of the tracks of one camera, part by part about the markers' places at rest.

    A rolling shutter sees every marker at the time of its row; the harmonics are those at the
    frames' times.
    """
    middle, sums = still, []
    for times, uv in own.parts(begin, end):
        middle = np.where(np.isfinite(middle), middle, mean_of(uv))
        sums.append(sums_of(omega, times, uv - middle, order))
        sums = [reduce(add, sums)]
    rows = distorted(own.camera, middle)[1] / own.camera.size[1]
    return sums[0].solve().raised(middle).earlier(omega, own.readout * (rows - 0.5))


def _not_frozen(own: Harmonics) -> Harmonics:
    """The same with no less scatter than half of what the camera's markers have.

    A video's compression may keep a marker still; its place is not better known for that.
    """
    least = 0.5 * np.nanmedian(own.sigma) if np.isfinite(own.sigma).any() else np.nan
    return replace(own, sigma=np.maximum(own.sigma, least))


def _common_phase(shape: ComplexArray, force: complex, damping: float) -> float:
    """Phase in rad that leaves least of the shape in quadrature.

    Of the two that do, half a period apart, it is the one that a force at resonance gives; where
    the force is unknown, the one in which the largest deflection is upward.
    """
    phase = 0.5 * float(np.angle(np.nansum(shape**2)))
    if force:
        upside_down = np.cos(phase - (np.angle(force) - (np.pi / 2 - damping))) < 0
    else:
        real = np.real(shape * np.exp(-1j * phase))
        upside_down = real[np.nanargmax(np.abs(real))] < 0
    return phase + np.pi if upside_down else phase


def _without_each(fit: Fitted, omega: float, exposures: Array, phase: float) -> tuple[Array, Array]:
    """Shapes from all cameras but one, and how far they should be from that of all.

    Both (cameras, markers), in m. The estimate of all is the best of all their combinations, so the
    difference has the variance of the part less that of all.
    """
    count = len(fit.cameras)
    shapes = np.full((count, fit.rest.shape[2]), np.nan)
    deviations, best = shapes.copy(), deviation(fit, omega, exposures)
    for left_out in range(count if count > 2 else 0):
        kept = [i for i in range(count) if i != left_out]
        part = Fitted(
            [fit.cameras[i] for i in kept],
            [fit.harmonics[i] for i in kept],
            fit.rest[kept],
            fit.frame,
        )
        turned = amplitude(part, omega, exposures[kept]) * np.exp(-1j * phase)
        shapes[left_out] = turned.real
        more = deviation(part, omega, exposures[kept]) ** 2 - best**2
        deviations[left_out] = np.sqrt(np.where(more > 0, more, np.nan))
    return shapes, deviations


def _compared(shape: Array, modes: list[Candidate]) -> tuple[dict[str, Any], str]:
    """The measured shape against the model's modes, and the name of the most similar."""
    mac = np.array([assurance(shape, mode.shape) for mode in modes])
    best = modes[int(np.nanargmax(mac))] if np.isfinite(mac).any() else None
    reference = scaled(shape, best.shape) if best else np.full_like(shape, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = 100 * np.abs(shape - reference) / np.abs(reference).max()
    values = {
        "mac": mac,
        "model_frequency": [mode.frequency for mode in modes],
        "reference_deflection": reference,
        "point_error": error,
        "mean_error": rms(error),
    }
    return values, best.name if best else ""


def rms(values: Array) -> float:
    """Root mean square of what is known; NaN if nothing is."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else np.nan
