"""The cubes of chapter 5, from the measured recordings."""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment.methods import (
    Instant,
    Tracks,
    deflection,
    instant_of,
    predicted,
    tracks_of,
)
from thesis_lib.figure_sets.experiment.parameters import Experiment, Way, method_of, ways
from thesis_lib.figure_sets.experiment.trials import draw, trials
from thesis_lib.laboratory.parameters import NAMES
from thesis_lib.measure.fitting.harmonics import amplitude
from thesis_lib.measure.recordings.markers import Markers, rows_on
from thesis_lib.studies import labels
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vibration.motion import Component
from thesis_lib.vision import lens
from thesis_lib.vision.pinhole import on_sensor
from thesis_lib.vision.simulation import assurance


def run(study: Experiment, data: xr.Dataset, others: xr.Dataset | None = None) -> xr.Dataset:
    """The cube of a study of chapter 5, from the measured recordings.

    `others` are what :func:`.experiment.others.film` makes of other recordings.
    """
    beam = setups.beam()
    markers = rows_on(beam)
    row = markers.middle_row
    part = Component("bending", 1, study.frequency_hz, study.amplitude_mm / 1000)
    reference = part.amplitude * part.shape(beam, beam.markers)
    instant, draws = instant_of(data, beam.damping), draw(study, data)
    settings = study.settings()
    known = {} if others is None else dict(zip(ways(study.others), count(), strict=False))
    if any(_way(study, setting) not in known for setting in settings):
        others = None  # at the width that was given up
    results: list[dict[str, Any]] = []
    for setting in settings:
        index = [NAMES.index(name) for name in _names(study, setting)]
        method, tracks = method_of(setting.case), tracks_for(study, setting, data)
        exposures = data["exposure"].values[index]
        first = deflection(tracks, instant, method, exposures)
        if others is None:
            drawn = trials(tracks, instant, method, draws, index, exposures)[:, row]
        else:
            drawn = others["deflection"].values[:, known[_way(study, setting)], 0]
        measured = np.concatenate([first[None, row], drawn])[None]
        noise = predicted(tracks, method, instant, exposures)
        scale = 100 / np.abs(reference).max()
        error = np.abs(measured - reference) * scale
        results.append(
            {
                "measured_deflection": measured,
                "point_error": error[:, 0],
                "mean_error": np.sqrt(np.nanmean(error**2, axis=-1)),
                "max_point_error": np.nanmax(error, axis=-1),
                "predicted_error": [scale * _rms(noise[row])],
                "mac": assurance(measured, reference),
                "missing": np.mean(np.isnan(measured), axis=-1),
                "in_view": _in_view(tracks, markers),
                "ground_sample_distance": np.mean(
                    [study.distance_mm / 1000 / c.K[0, 0] for c in tracks.cameras]
                ),
                "centre_scatter": _rms(tracks.sigma),
                "grid_residual": tracks.frame.rms,
                "grid_scale": tracks.frame.scale,
                "grid_tilt": np.degrees(tracks.frame.tilt),
                **_harmonic_results(tracks, instant, data, exposures, markers),
            }
        )
    return _cube(study, settings, reference, results, data, others)


def tracks_for(study: Experiment, setting: setups.Setting, data: xr.Dataset) -> Tracks:
    """The tracks that a setting is made of: its cameras' at its width, as its method takes them."""
    beam, method = setups.beam(), method_of(setting.case)
    calibration = "full" if method == "harmonic" else "literal"
    return tracks_of(
        data,
        rows_on(beam),
        _names(study, setting),
        setting.resolution_px[0],
        calibration,
        method == "matched",
        beam.damping,
    )


def _names(study: Experiment, setting: setups.Setting) -> str:
    """The setting's cameras."""
    return "".join(n for n, d in study.directions_deg.items() if d in setting.directions_deg)


def _way(study: Experiment, setting: setups.Setting) -> Way:
    """How a setting measures a recording."""
    return method_of(setting.case), _names(study, setting), setting.resolution_px[0]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _in_view(tracks: Tracks, markers: Markers) -> float:
    """Share of the markers at rest, camera by camera, that lie on the sensor, found or not."""
    frame, grid = tracks.frame, markers.world[:, : markers.count]
    world = frame.R.T @ grid + frame.origin[:, None]
    return float(np.mean([on_sensor(lens.project(c, world)[None], c.size) for c in tracks.cameras]))


def _harmonic_results(
    tracks: Tracks, instant: Instant, data: xr.Dataset, exposures: Array, markers: Markers
) -> dict[str, Any]:
    """Amplitude, phase to the force and standard error of every marker; drive-point mobility."""
    motion = amplitude(tracks, instant.omega, exposures)
    real, imaginary = data["force"].values
    force = complex(real, imaginary) * float(data["full_scale"])
    beam = setups.beam()
    shape = Component().shape(beam, markers.positions[:, : markers.count])
    known = np.isfinite(motion)
    modal = np.vdot(shape[known], motion[known]) / np.vdot(shape[known], shape[known])
    drive = Component().shape(beam, beam.force_point)[0]
    mobility = 1j * instant.omega * modal * drive / force
    row = markers.middle_row
    return {
        "amplitude": np.abs(motion)[None, row],
        "phase": np.degrees(np.angle(motion / force))[None, row],
        "standard_error": predicted(tracks, "harmonic", instant, exposures)[None, row],
        "mobility_real": mobility.real,
        "mobility_imag": mobility.imag,
    }


_VARIABLES = labels.VARIABLES | declared("""
    predicted_error(mode) [percent] rms error by the noise of the centres alone
    missing(mode, trial) [1] share of markers that no two cameras see
    centre_scatter() [px] scatter of the centres about their harmonics
    grid_residual() [m] rms distance of the markers at rest from their grid
    grid_scale() [1] size of the measured grid over the nominal one
    grid_tilt() [degree] angle of the measured plane to the fitted grid
    amplitude(mode, point) [m] amplitude by the harmonic fit
    phase(mode, point) [degree] phase to the force by the harmonic fit
    standard_error(mode, point) [m] standard error of the amplitude by the harmonic fit
    mobility_real() [m s-1 N-1] drive-point mobility, real part
    mobility_imag() [m s-1 N-1] drive-point mobility, imaginary part
""")


def _cube(
    study: Experiment,
    settings: list[setups.Setting],
    reference: Array,
    results: list[dict[str, Any]],
    data: xr.Dataset,
    others: xr.Dataset | None,
) -> xr.Dataset:
    beam, drawn = setups.beam(), "draw of starts, clocks and noise, 0 for the chain's result"
    coords = labels.coordinates(study, study.modes, beam, settings)
    coords = labels.filmed(coords, [study.frequency_hz], drawn, others)
    coords["frequency"][2]["long_name"] = "frequency of the force"
    cube = xr.Dataset(coords=coords, attrs=labels.drawn_by(others))
    cube = cube.assign(labelled({"reference_deflection": reference[None]}, labels.REFERENCE))
    cube = cube.assign(labels.of_settings(settings, results, _VARIABLES))
    natural = 2 * np.pi * study.frequency_hz / np.sqrt(1 - 2 * beam.damping**2)
    omega = 2 * np.pi * study.frequency_hz
    drive = Component().shape(beam, beam.force_point)[0]
    stiffness = natural**2 - omega**2 + 2j * beam.damping * natural * omega
    mobility = 1j * omega * drive**2 / (beam.mass / 4 * stiffness)
    cube["mobility_reference"] = (
        "part",
        [mobility.real, mobility.imag],
        {"units": "m s-1 N-1", "long_name": "drive-point mobility of the beam, resonant there"},
    )
    if "shots_used" in data:
        cube["shots_used"] = ("shots_camera", data["shots_used"].values, data["shots_used"].attrs)
    kept = {
        "missing_share": "tracking_missing",
        "wrong_share": "tracking_wrong",
        "centre_error": "tracking_error",
    }
    for name, new in kept.items():
        cube[new] = ("tracked_width", data[name].values, data[name].attrs)
    text = {"long_name": "width at which frames were tracked", "units": "1"}
    cube["tracked_width"] = ("tracked_width", data["width"].values, text)
    return cube
