"""The cube of ``lab-plate``: deflections of a rendered plate, and the sound that follows from them.

The frames are far too few for the plate's frequencies, so harmonics are fitted at the known ones.
What is left are errors of the centres, each marker's own. The same cameras with whole pixels, as in
chapters 4 and 6, are put beside it by the law of rounding: there, markers err together.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import j1

from thesis_lib.acoustics import radiation
from thesis_lib.acoustics.planes import pistons
from thesis_lib.acoustics.plate_sound import PlateSound
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.lab_plate.measured import at_maximum, filled, neighbours
from thesis_lib.figure_sets.lab_plate.parameters import MARKER, LabPlate, stands_of
from thesis_lib.figure_sets.lab_plate.recordings import plate_rig
from thesis_lib.laboratory import direct
from thesis_lib.laboratory.recordings import found_in
from thesis_lib.measure.fitting.aliasing import alias
from thesis_lib.measure.fitting.harmonics import amplitude, deviation
from thesis_lib.measure.fitting.reconstruction import normal_gain
from thesis_lib.studies import labels
from thesis_lib.studies.labels import VARIABLES, coordinates, field_coordinates, filmed, of_settings
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vibration.motion import amplitudes
from thesis_lib.vibration.plate import Plate
from thesis_lib.vibration.structure import (
    deflection_shape,
    peak_deflection,
    resonance,
    world_points,
)
from thesis_lib.vision import rounding
from thesis_lib.vision.simulation import assurance

PARAMETERS = {
    "distance": "distance_mm",
    "aperture": "aperture_deg",
    "elevation": "elevation_deg",
    "resolution": "width_px",
    "cameras": "n_cameras",
}


def run(study: LabPlate, data: xr.Dataset, others: xr.Dataset | None = None) -> xr.Dataset:
    """The cube of ``lab-plate``, from the dataset of its recordings.

    `others` are what :func:`.lab_plate.others.film` makes of other recordings.
    """
    plate, settings = study.plate, study.settings()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "k times the size of a piston")  # the table says so
        sounds = [
            PlateSound.of(
                plate,
                study.planes,
                study.medium,
                resonance(plate, mode),
                deflection_shape(plate, mode, plate.markers, peak),
            )
            for mode, peak in zip(study.modes, study.peaks_m, strict=True)
        ]
    results: list[dict[str, Any]] = []
    for number, setting in enumerate(settings):
        again = None if others is None else others["deflection"].values[:, number]
        each = [
            _results(study, data, setting, mode, heard, None if again is None else again[:, m])
            for m, (mode, heard) in enumerate(zip(study.modes, sounds, strict=True))
        ]
        results.append({name: np.array([one[name] for one in each]) for name in each[0]})
        results[-1] |= {
            "in_view": 1.0,  # others are refused
            "ground_sample_distance": setting.distance_mm
            / 1000
            * study.sensor_width_mm
            / (study.focal_length_mm * setting.resolution_px[0]),
        }
    reference = labelled({"reference_deflection": [h.reference for h in sounds]}, _TRUTH)
    cube = xr.Dataset(
        coords=_coordinates(study, plate, settings, others), attrs=labels.drawn_by(others)
    ).assign(reference)
    cube = cube.assign(of_settings(settings, results, _VARIABLES))
    return cube.assign(labelled(_fields(cube, study, sounds), _TRUTH))


_VARIABLES = VARIABLES | declared("""
    predicted_error(mode) [percent] rms error by the noise of the centres alone
    missing(mode, trial) [1] share of markers that too few cameras see
    centre_scatter(mode) [px] scatter of the centres about the harmonic
    plane_error(mode, trial, plane) [percent] rms pressure error over a plane (eq. 6.8), of the
        plane's largest reference pressure
    predicted_plane_error(mode, plane) [percent] the same by the noise of the centres alone
    power_error(mode, trial) [percent] radiated power over the true one, less one
    predicted_power_error(mode) [percent] rms power error by the noise of the centres alone
    neighbour_correlation(mode) [1] correlation of the errors of neighbouring markers, as rendered
    rounded_error(mode) [percent] rms error of these cameras with whole pixels
    rounded_plane_error(mode, plane) [percent] rms pressure error of these with whole pixels
    rounded_power_error(mode) [percent] rms power error of these with whole pixels
    rounded_correlation(mode) [1] correlation of neighbouring errors with whole pixels
""")


def _results(
    study: LabPlate,
    data: xr.Dataset,
    setting: Setting,
    mode: int,
    heard: PlateSound,
    again: Array | None,
) -> dict[str, Any]:
    """What the cameras of one setting make of one mode, as rendered and in trials.

    Those are deflections from other recordings, (trials, markers) in `again`, or drawn.
    """
    measured, noise, scatter = measure(study, data, setting, mode)
    if again is not None:
        measured = np.concatenate([measured[:1], again])
    reference = heard.reference
    scale = 100 / np.abs(reference).max()
    error = np.abs(measured - reference) * scale
    missing = np.isnan(noise)
    complete = filled(study.plate.markers, measured)
    covariance = np.diag(np.where(missing, np.nanmean(noise**2), noise**2))
    points = world_points(study.plate, np.stack([np.zeros_like(reference), reference]))
    P = setting.cameras(study.focal_length_mm, study.sensor_width_mm).P
    rounded = rounding.deflection_covariance(P, points[:, 0], points[:, 1])
    return {
        "measured_deflection": measured,
        "point_error": error[0],
        "mean_error": np.sqrt(np.nanmean(error**2, axis=-1)),
        "max_point_error": np.nanmax(error, axis=-1),
        "predicted_error": scale * np.sqrt(np.nanmean(noise**2)),
        "mac": assurance(measured, reference),
        "missing": np.mean(np.isnan(measured), axis=-1),
        "centre_scatter": scatter,
        "plane_error": heard.plane_errors(complete),
        "predicted_plane_error": heard.expected_plane_errors(covariance),
        "power_error": heard.power_errors(complete),
        "predicted_power_error": heard.expected_power_error(covariance),
        "neighbour_correlation": neighbours(complete[:1] - reference, study.grid),
        "rounded_error": scale * np.sqrt(np.mean(np.diag(rounded))),
        "rounded_plane_error": heard.expected_plane_errors(rounded),
        "rounded_power_error": heard.expected_power_error(rounded),
        "rounded_correlation": neighbours(
            np.linalg.cholesky(rounded + 1e-9 * np.trace(rounded) * np.eye(len(rounded))).T,
            study.grid,
        ),
    }


def measure(
    study: LabPlate, data: xr.Dataset, setting: Setting, mode: int
) -> tuple[Array, Array, float]:
    """Deflections of a setting and a mode, from the recordings and in trials.

    Trials draw noise of the centres, as large as the tracks show, about where the markers truly
    were.

    Returns
    -------
    measured : ndarray, shape (1 + trials, markers)
        At the maximum of the deflection, m; NaN where too few cameras see a marker.
    noise : ndarray, shape (markers,)
        Standard deviation by the noise of the centres, m.
    scatter : float
        Of the centres, rms over all, px.
    """
    chosen = stands_of(setting)
    rig = plate_rig(study, study.seed, mode, chosen)
    first = study.modes.index(mode) * len(study.stands)
    found = [found_in(data, first + study.stands.index(stand))[0] for stand in chosen]
    omega, exposure = resonance(study.plate, mode), study.exposure_ms / 1000
    fit = direct.fit_of(rig, found, omega, 1)
    noise = deviation(fit, omega, exposure)
    truth = amplitudes(rig.motion, rig.markers.centres, omega / (2 * np.pi))
    seen = np.asarray(np.isfinite(fit.sigma).all(axis=1))
    gains = np.nan_to_num(normal_gain(fit.P, fit.frame, fit.points, seen))
    spread = np.sqrt([0.5 * (h.covariance[1, 1] + h.covariance[2, 2]) for h in fit.harmonics])
    each = np.nan_to_num(gains * spread * fit.sigma) / np.sinc(omega * exposure / (2 * np.pi))
    motion = np.empty((1 + study.trials, len(noise)), complex)
    motion[0] = amplitude(fit, omega, exposure)
    for k in range(1, len(motion)):
        drawn = np.random.default_rng([study.seed, 8, k]).standard_normal((2, *each.shape))
        motion[k] = truth + np.sum(each * (drawn[0] + 1j * drawn[1]), axis=(0, 1))
    motion[:, np.isnan(noise)] = np.nan
    return at_maximum(study.plate, mode, motion), noise, float(np.sqrt(np.nanmean(fit.sigma**2)))


def _coordinates(
    study: LabPlate, plate: Plate, settings: list[Setting], others: xr.Dataset | None
) -> dict[str, Any]:
    cases = list(dict.fromkeys(setting.case for setting in settings))
    hertz = [resonance(plate, mode) / (2 * np.pi) for mode in study.modes]
    drawn = "draw of the centres' noise, 0 for what was rendered"
    coords = filmed(coordinates(study, study.modes, plate, settings), hertz, drawn, others)
    varied = np.array([PARAMETERS[s.case] for s in settings])
    coords["parameter"] = ("setting", varied, coords["parameter"][2])
    return {**coords, **field_coordinates(study.planes, cases)}


def _fields(cube: xr.Dataset, study: LabPlate, sounds: list[PlateSound]) -> dict[str, Any]:
    """Fields of the truth and of the best and worst settings, and what scales them."""
    plate, chosen = study.plate, labels.extremes(cube)
    reference = np.array([heard.fields(heard.reference) for heard in sounds])
    deflections = np.nan_to_num(cube["measured_deflection"].values[:, :, 0].astype(float))
    measured = np.array(
        [
            [[sounds[m].fields(deflections[s, m]) for s in of_case[m]] for m in range(len(sounds))]
            for of_case in chosen.values()
        ]
    )
    size = [
        heard.omega / study.medium.speed_of_sound * max(pistons(plate).size) for heard in sounds
    ]
    efficiency = []
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "k times the size of a piston")
        for heard in sounds:
            velocity = heard.omega * heard.reference
            efficiency.append(
                radiation.radiation_efficiency(pistons(plate), velocity, heard.omega, study.medium)
            )
    hertz, radius = cube["frequency"].values, MARKER * study.spacing / 2
    waves = np.sqrt(
        [h.omega * np.sqrt(plate.mass_per_area / plate.bending_stiffness) for h in sounds]
    )
    return {
        **_complex("pressure_reference", reference),
        **_complex("pressure_measured", measured),
        "best_and_worst": list(chosen.values()),
        "largest_pressure": [heard.largest for heard in sounds],
        "independent_ratio": [heard.independent_ratios for heard in sounds],
        "piston_size": size,
        "radiation_efficiency": efficiency,
        "alias_frequency": alias(hertz, study.frame_rate_hz),
        "exposure_loss": 1 - np.sinc(hertz * study.exposure_ms / 1000),
        "marker_loss": 1 - 2 * j1(waves * radius) / (waves * radius),
        "force_deflection": [peak_deflection(plate, mode) for mode in study.modes],
    }


def _complex(name: str, values: ComplexArray) -> dict[str, Array]:
    parts = {"real": values.real, "imag": values.imag}
    return {f"{name}_{part}": numbers.astype("float32") for part, numbers in parts.items()}


_TRUTH = declared("""
    reference_deflection(mode, point) [m] true deflection of the markers at its maximum
    pressure_reference_real(mode, plane, u, z) [Pa] true pressure, real part
    pressure_reference_imag(mode, plane, u, z) [Pa] true pressure, imaginary part
    pressure_measured_real(case, mode, extreme, plane, u, z) [Pa] pressure of what was rendered,
        real part
    pressure_measured_imag(case, mode, extreme, plane, u, z) [Pa] pressure of what was rendered,
        imaginary part
    best_and_worst(case, mode, extreme) [1] index of the setting with the lowest and highest
        deflection error, by the median over the trials
    largest_pressure(mode, plane) [Pa] largest reference pressure, NaN where a plane is nodal
    independent_ratio(mode, plane) [1] plane error over mean deflection error for errors of equal
        size, marker by marker
    piston_size(mode) [1] wavenumber times the longer side of a piston; above 1 it is hardly a point
        source
    radiation_efficiency(mode) [1] radiated power over that of a plane wave of the same mean square
        velocity
    alias_frequency(mode) [Hz] where the vibration shows below half of the frame rate
    exposure_loss(mode) [1] share of an amplitude that the exposure takes
    marker_loss(mode) [1] share of an amplitude that is lost as a marker shows the mean of the plate
        under it
    force_deflection(mode) [m] peak of the deflection by a force of 1 N
""")
