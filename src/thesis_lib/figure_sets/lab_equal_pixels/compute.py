"""The cube of ``lab-equal-pixels``: what the recordings show, and what the laws say of their rigs.

All recordings of a rig are alike, trial 0 among them: bands are over recordings. Three laws stand
beside them. By the *law of edges* an image of half the width has half the edge, and N cameras at
equal pixels per second err by N^¼ more; with centres *equally exact* in px N cancels; and of *whole
pixels*, drawn here, least squares and the interval estimator make different things.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.lab_equal_pixels.parameters import Kind, LabEqualPixels
from thesis_lib.figure_sets.lab_equal_pixels.recordings import sensor_of
from thesis_lib.laboratory.localisation import edge_scatter
from thesis_lib.measure.fitting.harmonics import basis
from thesis_lib.studies.labels import REFERENCE, VARIABLES, coordinates, filmed, of_settings
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision.cone_law import cone_directions
from thesis_lib.vision.interval import interval
from thesis_lib.vision.pinhole import pixelate, project
from thesis_lib.vision.simulation import assurance
from thesis_lib.vision.triangulation import gain, triangulate

DRAWS = 12  # of the pixels' grids
RESAMPLED = 2000  # sets of recordings
BAND = (0.05, 0.95)
_VARIABLES = VARIABLES | declared("""
    predicted_error(mode) [percent] rms error by the law of edges
    rms_error(mode) [percent] rms error over markers and recordings
    rms_band(mode, end) [percent] 5 and 95 % of the same over resampled recordings
    ratio(mode) [1] rms error over that of the sharp pair, the fewest cameras with the most pixels
        and the same markers
    ratio_band(mode, end) [1] 5 and 95 % of the same over resampled recordings
    predicted_ratio(mode) [1] the same ratio by the law of edges
    noise_error(mode) [percent] rms error by the scatter of the centres
    pose_error(mode) [percent] rms of what the errors of the calibration change
    common_error(mode) [percent] rms over the markers of what all recordings have in common
    equal_noise_error(mode) [percent] rms error if all centres were as exact in px as the sharp
        pair's are by the law of edges
    rounded_error(mode) [percent] rms error of whole pixels by least squares, drawn
    interval_error(mode) [percent] rms error of whole pixels by the interval estimator, drawn
    frame_rate() [Hz] frames per second of each camera
    marker_diameter() [m] diameter of the markers
    image_height() [px] height of a marker's image at the centre
    marker_loss() [1] share of an amplitude that markers take as they bend, put back
    centre_scatter() [px] scatter of the centres about their harmonics
    edge_scatter() [px] least scatter of a centre's coordinate by the law of edges
    lost() [1] share of the marker images that are missing
    wrong() [1] share of those found that are more than 1 px off
    failed() [1] share of the recordings in which some marker has no deflection
    board_views() [1] pictures of the board that were used, of all
    place_error() [m] rms error of the centres of projection
    turn_error() [rad] rms error of the orientations
""")
_MEANS = ("centre_scatter", "wrong", "board_views", "place_error", "turn_error")


def run(study: LabEqualPixels, data: xr.Dataset) -> xr.Dataset:
    """The cube of ``lab-equal-pixels``, from the dataset of its recordings."""
    settings, plate, filmed_kinds = study.settings(), study.plate, study.filmed_kinds
    shape = deflection_shape(plate, 1, plate.markers, study.amplitude_mm / 1000)
    shots = {
        kind: data.isel(rig=rig, trial=slice(study.trials + 1))
        for rig, kind in enumerate(filmed_kinds)
    }
    errors = {kind: _errors(study, kind, own, shape) for kind, own in shots.items()}
    seen = {kind: _seen(study, kind, shots[kind], errors, shape) for kind in filmed_kinds}
    laws = {
        kind: _laws(study, setting, kind, shape)
        for setting, kind in zip(settings, study.kinds.values(), strict=True)
    }
    for kind in filmed_kinds:
        by_law = laws[kind]["predicted_error"][0] / laws[_sharp(study, kind)]["predicted_error"][0]
        laws[kind]["predicted_ratio"] = [by_law]
    results = [seen[kind] | laws[kind] for kind in study.kinds.values()]
    drawn = "recording, of cameras that are aimed anew"
    coords = filmed(coordinates(study, study.modes, plate, settings), [study.frequency_hz], drawn)
    coords["end"] = ("end", np.array(BAND), {"long_name": "quantile", "units": "1"})
    reference = labelled({"reference_deflection": shape[None]}, REFERENCE)
    cube = xr.Dataset(coords=coords).assign(reference)
    return cube.assign(of_settings(settings, results, _VARIABLES))


def marker_loss(study: LabEqualPixels, kind: Kind) -> float:
    """Share of an amplitude that is lost as markers bend with the plate.

    A deflection w moves an image along v, which its edge tells with the information n_v² dl. So a
    marker shows the mean of w around its edge with these weights: less than at its centre by
    r²/2 · (k_d² ⟨sin² t⟩ + k_s² ⟨cos² t⟩), with the mode's wavenumbers k towards the camera (d) and
    across (s), at the angle t around the marker. On average over all azimuths that is k²r²/4.
    """
    turn = (np.arange(256) + 0.5) * 2 * np.pi / 256
    flat = np.cos(np.radians(study.cone_deg))  # height of an image over its width
    weight = np.sin(turn) ** 2 / np.hypot(flat * np.cos(turn), np.sin(turn))
    share = np.average(np.sin(turn) ** 2, weights=weight)
    azimuth, _ = cone_directions(np.radians(study.cone_deg), kind.count)
    along, across = (np.pi / study.plate.length) ** 2, (np.pi / study.plate.width) ** 2
    towards = np.mean(along * np.sin(azimuth) ** 2 + across * np.cos(azimuth) ** 2)
    sideways = along + across - towards
    bent = share * towards + (1 - share) * sideways
    return float((kind.diameter / 2000) ** 2 / 2 * bent)


def _errors(study: LabEqualPixels, kind: Kind, own: xr.Dataset, shape: Array) -> Array:
    """Errors of the deflections of a rig's recordings, (recordings, points), in %."""
    found = own["deflection"].isel(part=0).values / (1 - marker_loss(study, kind))
    return np.asarray(100 * (found - shape) / np.abs(shape).max(), float)


def _sharp(study: LabEqualPixels, kind: Kind) -> Kind:
    """The fewest cameras with most pixels that film the same markers."""
    others = [one for one in study.filmed_kinds if one.diameter == kind.diameter]
    return min(others, key=lambda one: (one.count, -one.size[0]))


def _seen(
    study: LabEqualPixels, kind: Kind, own: xr.Dataset, errors: dict[Kind, Array], shape: Array
) -> dict[str, Any]:
    """What the recordings of one rig show."""
    error, sharp = errors[kind], _sharp(study, kind)
    measured = shape * (1 + 0 * error) + error * np.abs(shape).max() / 100
    scale = 100 / np.abs(shape).max()
    moved = (own["deflection"] - own["known_deflection"]).isel(part=0).values
    again, of_sharp = _resampled(error, study.seed), _resampled(errors[sharp], study.seed + 1)
    ratio = 1 + 0 * again if kind == sharp else again / of_sharp
    focal = study.focal_length_mm / study.sensor_width_mm * kind.size[0]
    return {name: float(own[name].mean()) for name in _MEANS} | {
        "measured_deflection": measured[None],
        "mean_error": [rms(error, 1)],
        "max_point_error": [np.fmax.reduce(np.abs(error), axis=1)],
        "point_error": [np.abs(error[0])],
        "mac": [assurance(measured, shape)],
        "in_view": 1.0,  # others are refused
        "ground_sample_distance": study.distance_mm / 1000 / focal,
        "rms_error": [rms(error)],
        "rms_band": [np.quantile(again, BAND)],
        "ratio": [rms(error) / rms(errors[sharp])],
        "ratio_band": [np.quantile(ratio, BAND)],
        "noise_error": [scale * rms(own["deviation"].values)],
        "pose_error": [scale * rms(moved)],
        "common_error": [_common(error)],
        "frame_rate": kind.frame_rate,
        "marker_diameter": kind.diameter / 1000,
        "image_height": kind.diameter
        / study.distance_mm
        * focal
        * np.cos(np.radians(study.cone_deg)),
        "marker_loss": marker_loss(study, kind),
        "lost": float(own["missing"].mean()),
        "failed": np.mean(np.isnan(error).any(axis=1)),
    }


def rms(values: Array, axis: int | None = None) -> Array:
    """Root mean square of what is known; NaN where nothing is."""
    known = np.isfinite(values)
    count = np.count_nonzero(known, axis=axis)
    total = np.sum(np.where(known, values, 0.0) ** 2, axis=axis)
    return np.asarray(np.sqrt(total / np.where(count, count, np.nan)))


def _resampled(error: Array, seed: int) -> Array:
    """Rms of errors (recordings, points) over sets of as many recordings, drawn from them."""
    each = rms(error, 1)
    chosen = np.random.default_rng([seed, 11]).integers(0, len(error), (RESAMPLED, len(error)))
    return rms(each[chosen], 1)


def _common(error: Array) -> float:
    """Rms over the points of the mean over recordings, less what scatter leaves of it."""
    if len(error) < 2:
        return float("nan")
    left = np.nanmean(error, axis=0) ** 2 - np.nanvar(error, axis=0, ddof=1) / len(error)
    return float(np.sqrt(max(np.nanmean(left), 0.0)))


def _laws(study: LabEqualPixels, setting: Setting, kind: Kind, shape: Array) -> dict[str, Any]:
    """What laws and drawn pixels say of one rig."""
    P = setting.cameras(study.focal_length_mm, study.sensor_width_mm).P
    plate, frames = study.plate, round(study.duration_s * kind.frame_rate)
    g = gain(P, world_points(plate, np.zeros_like(shape)))[2]
    scale = 100 / np.abs(shape).max()
    edges = [_edges(study, one) for one in (kind, _sharp(study, kind))]
    own, alike = (
        # of a sinusoid's part in phase 2/n of the variance is left
        scale * float(np.sqrt(2 / frames * np.mean(np.einsum("cim,i->m", g**2, each**2))))
        for each in edges
    )
    rounded, by_interval = (
        scale * rms(drawn) for drawn in _whole_pixels(study, P, kind, shape, float(rms(edges[0])))
    )
    return {
        "predicted_error": [own],
        "equal_noise_error": [alike],
        "edge_scatter": rms(edges[0]),
        "rounded_error": [rounded],
        "interval_error": [by_interval],
    }


def _edges(study: LabEqualPixels, kind: Kind) -> Array:
    """Least scatter of a centre's u and v, px: a marker at the plate's centre."""
    focal = study.focal_length_mm / study.sensor_width_mm * kind.size[0]
    width = kind.diameter * focal / study.distance_mm
    height = width * float(np.cos(np.radians(study.cone_deg)))
    return edge_scatter(width, height, replace(sensor_of(study), shot=kind.shot_noise))


def _whole_pixels(
    study: LabEqualPixels, P: Array, kind: Kind, shape: Array, noise_px: float
) -> tuple[Array, Array]:
    """Errors (draws, points) in m, of films of whole pixels, by least squares and *interval*."""
    frames = round(study.duration_s * kind.frame_rate)
    omega = 2 * np.pi * study.frequency_hz
    fit = np.linalg.pinv(basis(omega, np.arange(frames) / kind.frame_rate, 1))
    draw = np.random.default_rng([study.seed, 12, kind.count, frames])
    found = np.empty((2, DRAWS, len(shape)))
    for d in range(DRAWS):
        phase = draw.uniform(0, 2 * np.pi)
        motion = np.cos(omega * np.arange(frames) / kind.frame_rate + phase)
        images = project(P, world_points(study.plate, np.outer(motion, shape)))
        shift = draw.uniform(-0.5, 0.5, (len(P), 2))[:, :, None, None]
        noise = noise_px * draw.standard_normal(images.shape)
        seen = pixelate(images + noise + shift) - shift
        for e, points in enumerate((triangulate(P, seen), interval(P, seen, noise_px).points)):
            waves = fit[1:] @ points[2]
            found[e, d] = np.array([np.cos(phase), -np.sin(phase)]) @ waves - shape
    return found[0], found[1]
