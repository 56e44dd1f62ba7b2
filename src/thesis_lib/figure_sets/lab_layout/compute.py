"""The cubes of ``lab-elevation`` and ``lab-layout``, from their tracked recordings.

Trial 0 is the harmonic fit to the noisy tracks, as it stands. Trials 1 … are other recordings or,
where there are none, what they would give: the fit to the quiet tracks, which holds the bias, and
new noise of each camera's centres, as the recording shows it marker by marker. A camera's draw
depends on the seed, the trial and its number alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.lab_layout.fits import (
    Recording,
    chosen,
    law,
    mean,
    measured,
    noise_gain,
    rms,
)
from thesis_lib.figure_sets.lab_layout.parameters import Layouts
from thesis_lib.laboratory.localisation import edge_scatter
from thesis_lib.measure.fitting.harmonics import amplitude
from thesis_lib.measure.fitting.reconstruction import real_shape
from thesis_lib.studies import labels
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vibration.motion import amplitudes
from thesis_lib.vision.simulation import assurance


def draws(study: Layouts, cameras: int, markers: int) -> Array:
    """Noise of all trials, with a standard deviation of one: (trials, cameras, 2, markers)."""
    noise = np.empty((study.trials, cameras, 2, markers))
    for k in range(study.trials):
        for camera in range(cameras):
            rng = np.random.default_rng([study.seed, 7, k + 1, camera])
            noise[k, camera] = rng.standard_normal((2, markers))
    return noise


def run(study: Layouts, data: xr.Dataset, others: xr.Dataset | None = None) -> xr.Dataset:
    """The cube of a study, from its recordings' tracks (:func:`.lab_layout.recordings.run`).

    `others` are what :func:`.lab_layout.others.film` makes of other recordings.
    """
    settings, recordings = study.settings(), study.filmed_settings()
    films = [
        measured(study, recording, noisy, quiet)
        for recording, noisy, quiet in zip(
            recordings, data["tracks"].values, data["quiet"].values, strict=True
        )
    ]
    exact = _constant_noise(recordings, films)
    most = max(len(recording.directions_deg) for recording in recordings)
    noise = draws(study, most, setups.beam().n_markers)
    results = []
    for number, setting in enumerate(settings):
        whole = study.recorded(setting)
        index = [whole.directions_deg.index(direction) for direction in setting.directions_deg]
        film = films[recordings.index(whole)]
        again = None if others is None else others["deflection"].values[:, number, 0]
        results.append(_result(study, setting, film, index, noise, exact[setting.case], again))
    return _cube(study, settings, results, others)


def _constant_noise(recordings: list[Setting], films: list[Recording]) -> dict[str, Array]:
    """For each case the centres' noise (u, v) in px of the recording that has the least."""
    least: dict[str, Array] = {}
    for recording, film in zip(recordings, films, strict=True):
        own = rms(film.scatter, 0)
        best = least.setdefault(recording.case, own)
        if np.nan_to_num(np.hypot(*own), nan=np.inf) < np.nan_to_num(np.hypot(*best), nan=np.inf):
            least[recording.case] = own
    return least


def _result(
    study: Layouts,
    setting: Setting,
    film: Recording,
    index: list[int],
    noise: Array,
    exact: Array,
    again: Array | None,
) -> dict[str, Any]:
    """What one setting shows, by the cameras `index` of its recording, and in others again."""
    rig, row = film.rig, film.rig.markers.middle_row
    omega, exposure = 2 * np.pi * study.frequency_hz, study.exposure_ms / 1000
    truth = amplitudes(rig.motion, rig.markers.centres, study.frequency_hz)[row]
    phase = float(np.angle(truth[-1]))
    reference = np.real(truth * np.exp(-1j * phase))
    scale = 100 / np.abs(reference).max()
    noisy, quiet = (chosen(fit, rig, index) for fit in (film.noisy, film.quiet))
    shapes = np.full((2 + study.trials, len(reference)), np.nan)  # filmed, quiet, trials
    gains = np.full((len(index), 2, len(reference)), np.nan)
    if noisy is not None and quiet is not None:
        for shape, fit in zip(shapes, (noisy, quiet), strict=False):
            shape[:] = real_shape(amplitude(fit, omega, exposure), phase)[row]
        gains = noise_gain(noisy, omega, exposure, film.roots[index], row)
        shapes[2:] = shapes[1] + np.einsum("cim,tcim->tm", gains, noise[:, index])
    if again is not None:
        shapes = np.concatenate([shapes[:2], again])
    values = np.delete(shapes, 1, axis=0)[None]
    error = np.abs(values - reference) * scale
    predicted = law(rig, index, omega, exact)
    focal = np.array([rig.cameras[i].K[0, 0] for i in index])
    per_metre = focal / (setting.distance_mm / 1000)
    width = per_metre * rig.markers.diameter  # of a marker's image at the beam's centre
    height = width * np.sin(np.radians([elevation for _, elevation in setting.directions_deg]))
    edges = [edge_scatter(w, h, rig.stations[0].sensor) for w, h in zip(width, height, strict=True)]
    return {
        "reference": reference,
        "measured_deflection": values,
        "point_error": error[:, 0],
        "mean_error": rms(error, -1),
        "max_point_error": np.fmax.reduce(error, axis=-1),
        "predicted_error": [scale * rms(predicted, 0)],
        "noise_error": [scale * rms(np.sqrt(np.sum(gains**2, axis=(0, 1))), 0)],
        "bias_error": [scale * rms(shapes[1] - reference, 0)],
        "mac": assurance(values, reference),
        "missing": np.mean(np.isnan(values), axis=-1),
        "in_view": 1.0,  # a request whose cameras do not see the whole beam is refused
        "ground_sample_distance": np.mean(1 / per_metre),
        "image_height": np.min(height),
        "centre_scatter": rms(film.noise[index], (0, 1, 3)),
        "edge_scatter": rms(np.array(edges), 0),
        "centre_bias": rms(film.bias[index], (0, 1, 3)),
        "lost": np.mean(film.lost[index]),
        "wrong": mean(film.wrong[index]),
    }


# Beside those of the parametric studies, in their order; float64 where rounding matters.
_VARIABLES = labels.VARIABLES | declared("""
    predicted_error(mode) [percent] rms error by the first-order law, centres as exact as those of
        the case's best recording
    noise_error(mode) [percent] rms error by the scatter of the centres alone
    bias_error(mode) [percent] rms error without noise
    missing(mode, trial) [1] share of markers that no two cameras see
    image_height() [px] least height of a marker's image at the centre
    centre_scatter(axis) [px] standard deviation of the centres by noise
    edge_scatter(axis) [px] least scatter of a centre by the law of edges
    centre_bias(axis) [px] rms error of the centres without noise
    lost() [1] share of marker images that are missing
    wrong() [1] share of those found that are more than 1 px off
""")


def _cube(
    study: Layouts,
    settings: list[Setting],
    results: list[dict[str, Any]],
    others: xr.Dataset | None,
) -> xr.Dataset:
    drawn = "draw of the centres' noise, 0 for the rendered run"
    coords = labels.filmed(
        labels.coordinates(study, study.modes, setups.beam(), settings),
        [study.frequency_hz],
        drawn,
        others,
    )
    reference = {"reference_deflection": results[0]["reference"][None]}
    cube = xr.Dataset(coords=coords, attrs=labels.drawn_by(others))
    cube = cube.assign(labelled(reference, labels.REFERENCE))
    varied = [study.varied_of(setting.case) for setting in settings]
    cube["parameter"] = ("setting", varied, cube["parameter"].attrs)
    if len(set(varied)) > 1:
        cube["value"].attrs["long_name"] += ", in the unit of its name"
    cube["axis"] = ("axis", ["u", "v"], {"long_name": "image coordinate", "units": "1"})
    return cube.assign(labels.of_settings(settings, results, _VARIABLES))
