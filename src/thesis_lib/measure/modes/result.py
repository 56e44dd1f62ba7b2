"""Modes of a measurement as one labelled dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.measure.fitting.calibration_error import common_errors
from thesis_lib.measure.fitting.harmonics import at_rest, common_phase
from thesis_lib.measure.fitting.models import candidate_modes, scale_model
from thesis_lib.measure.fitting.reconstruction import check_frame, triangulate_seen
from thesis_lib.measure.fitting.result import size_off
from thesis_lib.measure.modes.identify import Asked, identify_modes, modal_assurance
from thesis_lib.measure.modes.shapes import Rest
from thesis_lib.measure.modes.tracks import tracks_of
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.validation import markers_of
from thesis_lib.measure.tracking import tracks
from thesis_lib.studies.schema import label_values, parse_variables
from thesis_lib.vision.lens import projection_matrices

VARIABLES = parse_variables("""
    x(marker) [m] place along the structure
    y(marker) [m] place across the structure
    rest_position(axis, marker) [m] place at rest, from the structure's centre
    frequency(mode) [Hz] natural frequency
    frequency_deviation(mode) [Hz] standard error of the natural frequency
    damping(mode) [1] damping ratio; 0 for steady tones, which show none
    damping_deviation(mode) [1] standard error of the damping ratio
    amplitude_real(mode, marker) [m] complex deflection at `zero`, exp(λ(t − zero)), real part
    amplitude_imag(mode, marker) [m] complex deflection at `zero`, exp(λ(t − zero)), imaginary part
    error_of_scatter(mode, marker) [m] standard error of the real and of the imaginary part of the
        complex deflection, by the scatter of the centres
    deflection(mode, marker) [m] deflection at the maximum of the mode
    quadrature(mode, marker) [m] deflection a quarter of a period after the maximum of the mode
    standard_error(mode, marker) [m] standard error of the deflection and of the quadrature
    scale_deviation(mode) [1] relative standard error of a whole shape, common to all markers
    in_plane_excess(mode) [1] motion in the plane over what scatter explains
    beside(mode) [1] power left near the mode over the noise
    assurance(mode, other) [1] modal assurance criterion of the shapes among each other
    out_of_step(mode) [degree] largest phase by which cameras are apart
    rival(mode) [Hz] frequency that the frames show alike and that fits next best; NaN if there is
        none
    rival_out_of_step(mode) [degree] largest phase by which cameras are apart at the frequency that
        fits next best
    mac(mode, candidate) [1] modal assurance criterion with the model's modes
    model_frequency(candidate) [Hz] frequency of the model's resonance in each candidate mode
    reference_deflection(mode, marker) [m] the most similar mode of the model in the size that fits
        best
    zero() [s] time at which the complex amplitudes hold, on the first camera's clock
    window(end) [s] the part that was fitted
    noise() [px] usual scatter of a coordinate of the centres about the modes
    lag(camera) [s] by how much the images start later than the sound tells
    lag_deviation(camera) [s] standard error of the lag of the images behind the sound
    pace(camera) [1] how much faster than the first camera's the clock runs
    left_out(camera) [1] share of the centres left out, as unlike the neighbours' motion
    frames(camera) [1] frames that the fit used
    frame_rate(camera) [Hz] frames per second, by the camera's own clock
    missing(camera, marker) [1] share of the frames in which a marker is missing
    grid_rms() [m] rms distance of the markers at rest from the manifest's places
    grid_scale() [1] size of the measured grid over the nominal one
    frame_rotation(axis, i) [1] from the calibration's axes to the structure's
    frame_origin(i) [m] the structure's centre in the calibration's frame
    camera_centre(camera, axis) [m] centre of projection from the structure's
    order_frequency(order, place) [Hz] frequencies of the fits with one mode, two modes, …
    order_damping(order, place) [1] damping ratios of the fits with one mode, two modes, …
    line(line) [Hz] frequencies of the spectra
    before(line) [1] power of the tracks over noise
    after(line) [1] power of what the modes leave
""")
SHARED_VARIABLES = parse_variables("""
    shared_real(row, mode, marker) [m] what independent errors of the calibration, of one standard
        deviation each, add to the complex amplitudes, real part
    shared_imag(row, mode, marker) [m] what independent errors of the calibration, of one standard
        deviation each, add to the complex amplitudes, imaginary part
""")


def modes_result(
    manifest: Manifest,
    sound: xr.Dataset,
    recordings: Sequence[tracks.Recording],
    covariance: Array | None = None,
) -> xr.Dataset:
    """Return the modes in some recordings.

    Parameters are those of :func:`thesis_lib.measure.fitting.result.shape_result`.

    Returns
    -------
    xarray.Dataset
        Dimensions ``mode``, ``marker``, ``camera``; of one mode it has what exports take. With a
        covariance it has :data:`SHARED_VARIABLES`, too, and standard errors of shapes hold it.

    Raises
    ------
    ChainError
        If the markers at rest do not fit their places.
    ModalError
        If the tracks do not tell what was asked.
    """
    rest, frame_off = rest_of(manifest, recordings)
    begin, end = fit_window(manifest, sound, recordings)
    seen = tracks_of(recordings, begin, end)
    found = identify_modes(seen, rest, requested_modes(manifest, recordings))
    turns = np.exp([[-1j * common_phase(own)] for own in found.shape])
    shape = found.shape * turns
    aliases = [list(own) + [(np.nan, np.nan)] for own in found.aliases]
    most = max(len(own.frequency) for own in found.orders)
    models = candidate_modes(manifest.structure)
    values: dict[str, Any] = {
        "x": rest.places[0],
        "y": rest.places[1],
        "rest_position": rest.frame.to_beam(rest.points),
        "amplitude_real": found.shape.real,
        "amplitude_imag": found.shape.imag,
        "error_of_scatter": found.deviation,
        "deflection": shape.real,
        "quadrature": shape.imag,
        "standard_error": np.hypot(found.deviation, frame_off * np.abs(shape)),
        "in_plane_excess": found.excess,
        "assurance": modal_assurance(found.shape),
        "out_of_step": np.degrees(np.nanmax(np.abs(found.turn), axis=1)),
        "rival": [own[1][0] for own in aliases],
        "rival_out_of_step": np.degrees([own[1][1] for own in aliases]),
        "window": [begin, end],
        "frames": [len(track.times) for track in seen],
        "frame_rate": [own.rate for own in recordings],
        "missing": [tracks.share_lost(own) for own in recordings],
        "grid_rms": rest.frame.rms,
        "grid_scale": rest.frame.scale,
        "frame_rotation": rest.frame.R,
        "frame_origin": rest.frame.origin,
        "camera_centre": rest.frame.to_beam(np.array([o.camera.centre for o in recordings]).T).T,
        "order_frequency": [_pad(own.frequency, own.frequency, most) for own in found.orders],
        "order_damping": [_pad(own.damping, own.frequency, most) for own in found.orders],
        "line": found.before.frequency,
        "before": found.before.power,
        "after": found.after.power,
    } | {name: getattr(found, name) for name in COMMON_VARIABLES}
    mac = np.array([[_mac(own, model.shape) for model in models] for own in shape.real])
    values |= {
        "mac": mac.reshape(len(shape), len(models)),
        "model_frequency": [model.frequency for model in models],
        "reference_deflection": [
            scale_model(own, models[int(np.nanargmax(row))].shape) if len(models) else np.nan * own
            for own, row in zip(shape.real, mac, strict=True)
        ],
    }
    coords = {
        "camera": ("camera", [o.camera.name for o in recordings], {"long_name": "camera"}),
        "axis": ("axis", ["x", "y", "z"], {"long_name": "axis of the structure"}),
        "candidate": ("candidate", [m.name for m in models], {"long_name": "mode of the model"}),
    }
    data = xr.Dataset(label_values(values, VARIABLES), coords)
    if covariance is None:
        return data
    still = np.zeros(len(recordings))  # of exposures, which the fits are free of
    omegas = [float(pole.imag) for pole in found.poles]
    rows = common_errors(found.fits, markers_of(manifest), omegas, still, covariance)
    shared = np.sqrt(np.sum(np.real(rows * turns) ** 2, axis=0))
    data["standard_error"].values[:] = np.hypot(data["standard_error"].values, shared)
    return data.assign(
        label_values({"shared_real": rows.real, "shared_imag": rows.imag}, SHARED_VARIABLES)
    )


COMMON_VARIABLES = (
    "frequency", "frequency_deviation", "damping", "damping_deviation", "scale_deviation", "beside",
    "zero", "noise", "lag", "lag_deviation", "pace", "left_out",
)  # fmt: skip


def rest_of(manifest: Manifest, recordings: Sequence[tracks.Recording]) -> tuple[Rest, float]:
    """Return the markers at rest, and the relative error of sizes that their grid tells."""
    markers, cameras = markers_of(manifest), [own.camera for own in recordings]
    still = np.array([at_rest(own, manifest.excitation.rest_duration_s) for own in recordings])
    frame = check_frame(cameras, still, markers)
    points, _ = triangulate_seen(projection_matrices(cameras), still)
    thick = manifest.structure.thickness_mm / 1000
    rest = Rest(still, frame, points, markers.centres, thick)
    return rest, size_off(frame.scale)


def fit_window(
    manifest: Manifest, sound: xr.Dataset, recordings: Sequence[tracks.Recording]
) -> tuple[float, float]:
    """Return from when to when the modes are fitted: of a decay, from the largest motion on, s."""
    begin, end = (float(value) for value in sound["steady"].values)
    if (
        not manifest.excitation.behaviour.decays
        or manifest.excitation.steady_interval_s is not None
    ):
        return begin, end
    largest = []
    for own in recordings:
        parts = [*own.parts(begin, end)]
        times = np.concatenate([t for t, _ in parts])
        uv = np.concatenate([part for _, part in parts])
        moved = np.nanmedian(np.abs(uv - np.nanmedian(uv, axis=0)), axis=(1, 2))
        largest.append(times[int(np.nanargmax(moved))] + abs(own.readout) + own.exposure)
    return float(np.median(largest)), end


def requested_modes(manifest: Manifest, recordings: Sequence[tracks.Recording]) -> Asked:
    """Return the manifest's request for modes."""
    sought = manifest.excitation.modes
    highest = sought.to_hz or 0.5 * min(own.rate for own in recordings)
    return Asked(
        (sought.from_hz, highest),
        sought.count,
        manifest.excitation.behaviour.decays,
        sought.near_hz or (),
    )


def _pad(values: Array, by: Array, length: int) -> Array:
    return np.pad(values[np.argsort(by)], (0, length - len(values)), constant_values=np.nan)


def _mac(measured: Array, model: Array) -> float:
    return float(modal_assurance([measured, np.where(np.isfinite(measured), model, np.nan)])[0, 1])
