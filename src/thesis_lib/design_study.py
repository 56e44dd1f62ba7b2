"""The cube of ``design-law``: the law against simulation, closed forms, findings, equal pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from thesis_lib import design_law, rounding, setups, studies
from thesis_lib.cameras import CameraArray, hemisphere_cameras, on_sensor, pixelate, project
from thesis_lib.design_law import MOTION_PX, cone_cameras, exponent
from thesis_lib.design_request import DesignLaw
from thesis_lib.parameters import camera_study
from thesis_lib.structures import Structure, deflection_shape
from thesis_lib.studies import world_points
from thesis_lib.triangulation import covariance, gain, triangulate

Array = NDArray[np.float64]

# Part (d) is drawn with each of these: projection matrices and rounded images to points.
Estimator = Callable[[Array, Array], Array]
ESTIMATORS: dict[str, Estimator] = {"least squares": triangulate}

MODES = (1, 2, 3)
CHAPTERS = {"beam": setups.beam, "plate": setups.plate}
PARTS = ("distance", "aperture", "resolution", "arrays")
FINDINGS = ("distance", "resolution", "number", "elevation", "aperture")
STEPS = 61  # of a sweep
DRAWS = 20  # for each trial, where one costs little
SWING_PX = 4.0  # range of random motions on the cone: many enough for every fraction alike
FITTED = 50  # trials of filmed vibrations at most

# Dimensions, units, long name.
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "motion_error": (("motion",), "px", "rms rounding error of a motion by the law"),
    "drawn_motion_error": (("motion",), "px", "rms rounding error of a motion, drawn"),
    "law_error": (
        ("setting", "shape"), "percent", "rms error of a setting of the thesis by the law"),
    "simulated_error": (
        ("setting", "shape"), "percent", "rms error of a setting of the thesis over the trials"),
    "naive_error": (
        ("setting", "shape"), "percent", "rms error if roundings were independent, 1/12 px2 each"),
    "cone_error": (
        ("angle", "axis"), "m", "standard deviation at the centre of a cone, closed form"),
    "cone_jacobian_error": (
        ("angle", "axis"), "m", "standard deviation at the centre of a cone, by the Jacobian"),
    "cone_drawn_error": (
        ("angle", "axis"), "m", "rms error of random motions with whole pixels, drawn"),
    "cone_difference": ((), "1", "largest relative difference of closed form and Jacobian"),
    "swept": (("finding", "structure", "step"), "1", "value of the varied parameter"),
    "expected_error": (
        ("finding", "structure", "step"), "percent", "rms error of the markers, amplitudes averaged"),
    "exact_error": (
        ("finding", "structure", "step"), "percent", "rms error of the markers in modes 1 to 3"),
    "centre_error": (
        ("finding", "structure", "step"), "percent", "error at the centre, closed form"),
    "expected_exponent": (
        ("finding", "structure"), "1", "exponent of the error of the markers"),
    "centre_exponent": (("finding", "structure"), "1", "exponent of the error at the centre"),
    "small_exponent": (
        ("finding", "structure"), "1", "exponent of the error of motions far below a pixel"),
    "best_aperture": (("structure",), "degree", "aperture of the least error, low elevation"),
    "wide_gain": (
        ("structure",), "1", "error at an aperture of 60 degrees over the least error"),
    "array_exponent": (
        ("array", "structure"), "1", "exponent of the error in the number of cameras"),
    "width_px": (("count", "rate"), "1", "width of the sensor in px"),
    "height_px": (("count", "rate"), "1", "height of the sensor in px"),
    "frame_rate": (("count", "rate"), "Hz", "frames per second of each camera"),
    "pixel_size": (("count", "rate"), "m", "length of a pixel at the centre"),
    "marker_spacing": (
        ("count", "rate"), "px", "distance of the images of neighbouring markers, at most"),
    "motion_px": (("count", "rate"), "px", "motion of an image at the vibration's peak"),
    "in_view": (("count", "rate"), "1", "share of camera x marker x mode images on the sensor"),
    "average_error": (
        ("count", "rate"), "percent", "error of one frame at the centre, amplitudes averaged"),
    "frame_error": (("count", "rate"), "percent", "rms error of one frame by the law"),
    "drawn_frame_error": (
        ("estimator", "count", "rate"), "percent", "rms error of one frame over the trials"),
    "fit_error": (("count", "rate"), "percent", "error of the fitted amplitude by the law"),
    "independent_fit_error": (
        ("count", "rate"), "percent", "error of the fitted amplitude if frames were independent"),
    "useful_frames": (
        ("count", "rate"), "1", "frames after which more of them tell nothing new"),
    "drawn_fit_error": (
        ("estimator", "count", "rate"), "percent", "rms error of the fitted amplitude, drawn"),
    "quantity": (("quantity",), "1", "what a value is"),
    "value": (("quantity",), "1", "value, in the unit beside it"),
    "unit": (("quantity",), "1", "unit of the value"),
}  # fmt: skip


def run(study: DesignLaw) -> xr.Dataset:
    """The cube of the figure set ``design-law``.

    Parameters
    ----------
    study : DesignLaw
        Validated parameters.

    Returns
    -------
    xarray.Dataset
        (a) along ``motion`` and ``setting``, (b) along ``angle``, (c) along ``finding``,
        (d) along ``count`` and ``rate``; ``quantity``, ``value`` and ``unit`` are what runs are
        compared by.
    """
    cube = xr.Dataset(coords=_coordinates(study))
    for part in (_motions, _settings, _cone, _findings, _arrays, _equal_pixels, _summary):
        for name, values in part(cube, study).items():
            dims, units, words = VARIABLES[name]
            cube[name] = (dims, np.asarray(values), {"units": units, "long_name": words})
    return cube


def _coordinates(study: DesignLaw) -> dict[str, Any]:
    asked = [(one, part) for one in CHAPTERS for part in PARTS]
    every = [(*a, s) for a in asked for s in _study(study, *a).settings()]
    motion = np.unique(np.round(np.concatenate([np.geomspace(0.01, 1, 41), np.linspace(1, 5, 81)]), 9))
    table: dict[str, tuple[str, Any, str, str]] = {
        "motion": ("motion", motion, "px", "motion of an image"),
        "of_structure": ("setting", [a for a, _, _ in every], "1", "what is measured"),
        "of_part": ("setting", [b for _, b, _ in every], "1", "what the study varies"),
        "of_layout": ("setting", [s.case for *_, s in every], "1", "case of the thesis"),
        "label": ("setting", [s.label for *_, s in every], "1", "value with its unit"),
        "shape": ("shape", list(MODES), "1", "mode number"),
        "angle": ("angle", np.arange(5.0, 90.0, 5.0), "degree", "angle of the cone"),
        "axis": ("axis", ["X", "Y", "Z"], "1", "coordinate"),
        "finding": ("finding", list(FINDINGS), "1", "what is varied"),
        "structure": ("structure", list(CHAPTERS), "1", "what is measured"),
        "array": ("array", list(setups.pairs()), "1", "growing array of the thesis"),
        "count": ("count", study.counts, "1", "number of cameras"),
        "rate": ("rate", study.frame_rates_hz, "Hz", "frames per second, about"),
        "estimator": ("estimator", list(ESTIMATORS), "1", "how points are estimated"),
    }  # fmt: skip
    return {
        name: (dim, np.array(values), {"units": units, "long_name": words})
        for name, (dim, values, units, words) in table.items()
    }


def _focal_px(study: DesignLaw, width: float) -> float:
    return study.focal_length_mm * width / study.sensor_width_mm


def _study(study: DesignLaw, structure: str, part: str) -> Any:
    """One of the studies of chapters 3 and 4, with this study's lens, trials and seed."""
    names = ("focal_length_mm", "sensor_width_mm", "trials", "seed")
    return camera_study(f"{structure}-{part}", {name: getattr(study, name) for name in names})


# (a) The law.


def _motions(cube: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """One coordinate: the law, and as many draws."""
    motion = cube["motion"].values
    random = np.random.default_rng(study.seed)
    place = random.uniform(-0.5, 0.5, (DRAWS * study.trials, 1))
    error = pixelate(place + motion) - pixelate(place) - motion
    return {
        "motion_error": np.sqrt(rounding.difference_variance(motion)),
        "drawn_motion_error": np.sqrt(np.mean(error**2, axis=0)),
    }


def _settings(_: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """Every setting of chapters 3 and 4: law, simulation, and independent roundings."""
    law, simulated, naive = [], [], []
    for structure in CHAPTERS:
        for part in PARTS:
            request = _study(study, structure, part)
            made = studies.run(request)
            law.append(made["predicted_error"].values)
            drawn = made["mean_error"].transpose("setting", "mode", "trial").values[:, :, 1:]
            simulated.append(np.sqrt(np.mean(drawn**2, axis=2)))
            deflections = made["reference_deflection"].values
            shapes = np.concatenate([np.zeros_like(deflections[:1]), deflections])
            points = world_points(request.structure, shapes)
            scale = 100 / np.abs(deflections).max(axis=1)
            for setting in request.settings():
                P = setting.cameras(study.focal_length_mm, study.sensor_width_mm).P
                each = np.mean(np.sum(gain(P, points)[2] ** 2, axis=(0, 1)), axis=-1) / 12
                naive.append(scale * np.sqrt(each[1:] + each[0]))
    return {
        "law_error": np.concatenate(law),
        "simulated_error": np.concatenate(simulated),
        "naive_error": naive,
    }


# (b) The cone.


def _cone(cube: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """Closed form, Jacobian, and random motions with whole pixels."""
    distance, n = study.cone_distance_mm / 1000, study.cone_cameras
    focal = _focal_px(study, study.resolution_px[0])
    random = np.random.default_rng(study.seed)
    reach = SWING_PX * distance / focal
    moved = random.uniform(-reach, reach, (3, DRAWS * study.trials))
    shift = random.uniform(-0.5, 0.5, (n, 2, 1, moved.shape[1]))
    points = np.stack([np.zeros_like(moved), moved], axis=1)
    closed, exact, drawn = [], [], []
    for angle in np.radians(cube["angle"].values):
        P = cone_cameras(distance, angle, n, focal, study.resolution_px).P
        closed.append(design_law.cone_covariance(distance, focal, n, angle))
        exact.append(covariance(P, np.zeros(3), MOTION_PX))
        found = triangulate(P, pixelate(project(P, points) + shift) - shift)
        drawn.append(np.sqrt(np.mean((found[:, 1] - found[:, 0] - moved) ** 2, axis=1)))
    variances = np.diagonal(closed, axis1=1, axis2=2)
    scale = np.sqrt(variances[:, :, None] * variances[:, None])
    return {
        "cone_error": np.sqrt(variances),
        "cone_jacobian_error": np.sqrt(np.diagonal(exact, axis1=1, axis2=2)),
        "cone_drawn_error": drawn,
        "cone_difference": np.max(np.abs(np.array(exact) - closed) / scale),
    }


# (c) The findings.


def _rig(study: DesignLaw, structure: str, finding: str, value: float) -> CameraArray:
    """The cameras of one step of a sweep."""
    part = "resolution" if finding == "number" else finding
    printed = setups.table(structure, "aperture" if finding == "elevation" else part)
    width, height = study.resolution_px
    if finding == "number":
        angle = np.radians(study.cone_deg)
        focal = _focal_px(study, width)
        return cone_cameras(study.cone_distance_mm / 1000, angle, int(value), focal, (width, height))
    distance = printed.get("distance_mm", 0) / 1000
    if finding == "distance":
        distance = value
    if finding == "resolution":
        width, height = int(value), round(value * 9 / 16)
    if finding == "aperture":
        azimuth, elevation = [value / 2, -value / 2], printed["elevation_deg"]
    elif finding == "elevation":
        azimuth, elevation = [90.0, -90.0], value
    else:
        azimuth, elevation = [printed["azimuth_deg"], -printed["azimuth_deg"]], printed["elevation_deg"]
    directions = np.radians([azimuth, [elevation] * 2])
    return hemisphere_cameras(distance, *directions, _focal_px(study, width), (width, height))


def _swept(study: DesignLaw, structure: str, finding: str) -> Array:
    """The values of a sweep, over the range of the thesis."""
    if finding == "number":
        return 3.0 + np.arange(STEPS)
    part = "aperture" if finding == "elevation" else finding
    printed = setups.table(structure, part)
    if finding == "distance":
        return np.geomspace(min(printed["distances_mm"]), max(printed["distances_mm"]), STEPS) / 1000
    if finding == "resolution":
        return np.rint(np.geomspace(min(printed["widths_px"]), max(printed["widths_px"]), STEPS))
    if finding == "aperture":
        return np.linspace(2 * min(printed["half_apertures_deg"]), 180, STEPS)
    return np.linspace(min(printed["elevations_deg"]), max(printed["elevations_deg"]), STEPS)


def _expected(cameras: CameraArray, points: Array) -> float:
    """Rms deflection error of markers (3, m) in m, averaged over amplitudes."""
    g = gain(cameras.P, points)[2]
    return float(MOTION_PX * np.sqrt(np.mean(np.sum(g**2, axis=(0, 1)))))


def _exact(cameras: CameraArray, points: Array) -> float:
    """Rms deflection error in m of markers (3, 1 + modes, m), the first of which are at rest."""
    variance = rounding.deflection_variance(cameras.P, points[:, :1], points[:, 1:])
    return float(np.sqrt(np.mean(variance)))


def _shapes(structure: Structure, peak: float) -> Array:
    """Markers (3, 1 + modes, m) at rest and in each mode."""
    shapes = [deflection_shape(structure, mode, structure.markers, peak) for mode in MODES]
    return world_points(structure, np.array([np.zeros_like(shapes[0]), *shapes]))


def _findings(_: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """Distance, resolution, number, elevation and aperture, each by itself."""
    shape = (len(FINDINGS), len(CHAPTERS), STEPS)
    values, expected, exact, small, centre = (np.empty(shape) for _ in range(5))
    best, gained = [], []
    for s, (name, structure) in enumerate((n, make()) for n, make in CHAPTERS.items()):
        peak = float(setups.reading(name)["amplitude_mm"]) / 1000
        usual, tiny = _shapes(structure, peak), _shapes(structure, study.small_amplitude_mm / 1000)
        rest = usual[:, 0]
        for f, finding in enumerate(FINDINGS):
            values[f, s] = _swept(study, name, finding)
            for i, value in enumerate(values[f, s]):
                rig = _rig(study, name, finding, value)
                expected[f, s, i] = 100 * _expected(rig, rest) / peak
                exact[f, s, i] = 100 * _exact(rig, usual) / peak
                small[f, s, i] = 1e5 * _exact(rig, tiny) / study.small_amplitude_mm
            centre[f, s] = 100 * _at_centre(study, name, finding, values[f, s]) / peak
        at_aperture = partial(_rig, study, name, "aperture")
        found = minimize_scalar(
            lambda a, at=at_aperture, rest=rest: _expected(at(a), rest), bounds=(10, 180),
            method="bounded", options={"xatol": 1e-3},
        )  # fmt: skip
        best.append(found.x)
        gained.append(_expected(at_aperture(60.0), rest) / found.fun)
    # Errors follow powers of the parameters themselves, but for elevations: of cos φ.
    base = values.copy()
    base[FINDINGS.index("elevation")] = np.cos(np.radians(base[FINDINGS.index("elevation")]))
    return {
        "swept": values, "expected_error": expected, "exact_error": exact, "centre_error": centre,
        "expected_exponent": _exponents(base, expected), "centre_exponent": _exponents(base, centre),
        "small_exponent": _exponents(base, small), "best_aperture": best, "wide_gain": gained,
    }  # fmt: skip


def _exponents(values: Array, errors: Array) -> Array:
    """Exponents (findings, structures); NaN of the aperture, which is no power."""
    found = np.array([[exponent(x, y) for x, y in zip(*pair, strict=True)]
                      for pair in zip(values, errors, strict=True)])  # fmt: skip
    found[FINDINGS.index("aperture")] = np.nan
    return found


def _at_centre(study: DesignLaw, structure: str, finding: str, values: Array) -> Array:
    """The closed forms along a sweep, in m."""
    focal = _focal_px(study, study.resolution_px[0])
    if finding == "number":
        angle, distance = np.radians(study.cone_deg), study.cone_distance_mm / 1000
        return design_law.cone_deflection_error(distance, focal, values, angle)
    part = "aperture" if finding == "elevation" else finding
    printed = setups.table(structure, part)
    aperture, elevation = 2 * printed.get("azimuth_deg", 90.0), printed.get("elevation_deg")
    distance: Any = printed.get("distance_mm", 0) / 1000
    given: Any = values
    if finding == "distance":
        distance = given
    elif finding == "resolution":
        focal = _focal_px(study, given)
    elif finding == "aperture":
        aperture = given
    else:
        elevation = given
    angles = np.radians(aperture), np.radians(elevation)
    return design_law.pair_deflection_error(distance, focal, *angles)


def _arrays(_: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """The exponent in the number of cameras of the thesis's growing arrays."""
    found = np.empty((len(setups.pairs()), len(CHAPTERS)))
    for s, (name, structure) in enumerate((n, make()) for n, make in CHAPTERS.items()):
        rest = world_points(structure, np.zeros(structure.markers.shape[1]))
        settings = _study(study, name, "arrays").settings()
        for c, case in enumerate(setups.pairs()):
            grown = [setting for setting in settings if setting.case == case]
            errors = [
                _expected(one.cameras(study.focal_length_mm, study.sensor_width_mm), rest)
                for one in grown
            ]
            found[c, s] = exponent([len(one.directions_deg) for one in grown], errors)
    return {"array_exponent": found}


# (d) Many coarse cameras against few sharp ones.


def _equal_pixels(_: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """Cameras on the cone that share a number of pixels per second, around the beam."""
    counts, rates = np.array(study.counts), np.array(study.frame_rates_hz)
    widths, heights, frame_rate = design_law.equal_pixel_rate(
        study.pixels_per_second, counts[:, None], rates
    )
    angle, distance = np.radians(study.cone_deg), study.cone_distance_mm / 1000
    peak = study.amplitude_mm / 1000
    beam = setups.beam()
    shapes = _shapes(beam, peak)
    focal = _focal_px(study, widths)
    grid = np.empty(widths.shape)
    law, view, fitted = grid.copy(), grid.copy(), grid.copy()
    drawn, drawn_fit = (np.empty((len(ESTIMATORS), *grid.shape)) for _ in range(2))
    for (i, k), width in np.ndenumerate(widths):
        rig = cone_cameras(distance, angle, int(counts[i]), focal[i, k], (int(width), int(heights[i, k])))
        law[i, k] = _exact(rig, shapes)
        view[i, k] = np.mean(on_sensor(project(rig.P, shapes[:, 1:]), rig.size))
        filmed = film(float(frame_rate[i, k]), study)
        fitted[i, k] = fitted_by_law(rig, filmed)
        for e, estimate in enumerate(ESTIMATORS.values()):
            drawn[e, i, k] = one_frame(rig, shapes, study, estimate)
            drawn_fit[e, i, k] = filmed_amplitude(rig, filmed, study.seed, estimate)
    percent = 100 / peak
    centre = design_law.cone_deflection_error(distance, focal, counts[:, None], angle)
    motion = peak * np.sin(angle) * focal / distance
    return {
        "width_px": widths, "height_px": heights, "frame_rate": frame_rate,
        "pixel_size": distance / focal, "marker_spacing": beam.marker_spacing * focal / distance,
        "motion_px": motion, "in_view": view, "average_error": percent * centre,
        "frame_error": percent * law, "drawn_frame_error": percent * drawn,
        # MOTION_PX is of two roundings; an amplitude fitted to n frames has 2/n of the variance of one
        "independent_fit_error": percent * centre / np.sqrt(frame_rate * study.duration_s),
        "useful_frames": design_law.useful_frames(motion[..., None] * spread(FITTED)),
        "fit_error": percent * fitted, "drawn_fit_error": percent * drawn_fit,
    }  # fmt: skip


def one_frame(
    rig: CameraArray, points: Array, study: DesignLaw, estimate: Estimator
) -> float:
    """Rms deflection error in m over the trials, of markers (3, 1 + modes, m)."""
    shifts = np.moveaxis(rounding.grid_shifts(study.seed, study.trials, len(rig))[1:], 0, 2)
    shift = shifts[:, :, None, :, None]
    images = project(rig.P, points)[:, :, :, None]
    height = estimate(rig.P, pixelate(images + shift) - shift)[2]
    error = height[1:] - height[0] - points[2, 1:, None]
    return float(np.sqrt(np.mean(error**2)))


@dataclass(frozen=True)
class Film:
    """A point at the centre that vibrates along Z, in every frame of every trial.

    Parameters
    ----------
    points : ndarray, shape (3, trials, frames)
        Where it is, in m.
    peaks : ndarray, shape (trials,)
        Amplitudes in m, from half to one and a half times the asked one: what depends on its
        fraction of a pixel averages out.
    fit : ndarray, shape (trials, 3, frames)
        Pseudo-inverse of the fit: rows for cosine, sine and constant.
    """

    points: Array
    peaks: Array
    fit: Array


def spread(n: int) -> Array:
    """Factors from half to one and a half, whose mean is one."""
    return 0.5 + (np.arange(n) + 0.5) / n


def film(frame_rate: float, study: DesignLaw) -> Film:
    """The vibration as a camera samples it, with random phases and amplitudes."""
    trials, n_frames = min(study.trials, FITTED), round(frame_rate * study.duration_s)
    random = np.random.default_rng(study.seed)
    peaks = study.amplitude_mm / 1000 * spread(trials)
    start = random.uniform(0, 2 * np.pi, (trials, 1))
    turn = 2 * np.pi * study.frequency_hz * np.arange(n_frames) / frame_rate + start
    points = np.zeros((3, trials, n_frames))
    points[2] = peaks[:, None] * np.cos(turn)
    basis = np.stack([np.cos(turn), np.sin(turn), np.ones_like(turn)], axis=2)
    return Film(points, peaks, np.linalg.pinv(basis))


def filmed_amplitude(rig: CameraArray, filmed: Film, seed: int, estimate: Estimator) -> float:
    """Rms error in m of the fitted amplitude: all frames of a camera share one pixel grid."""
    shift = np.moveaxis(rounding.grid_shifts(seed, len(filmed.peaks), len(rig))[1:], 0, 2)[..., None]
    height = estimate(rig.P, pixelate(project(rig.P, filmed.points) + shift) - shift)[2]
    found = (filmed.fit[:, :2] @ height[..., None])[..., 0]
    return float(np.sqrt(np.mean((np.linalg.norm(found, axis=1) - filmed.peaks) ** 2)))


def fitted_by_law(rig: CameraArray, filmed: Film) -> float:
    """The same by the law, to first order: each coordinate repeats its errors from frame to frame.

    On a cone all cameras see the same motion, in v alone.
    """
    v = project(rig.P[:1], filmed.points)[0, 1]
    each = design_law.weighted_error(v, filmed.fit[:, 0])
    g = gain(rig.P, np.zeros(3))[2]
    return float(np.sqrt(np.mean(each**2) * np.sum(g**2)))


def _summary(cube: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """What is published and compared, one number and unit to a row."""
    rows: list[tuple[str, float, str]] = []

    def of(words: str, value: Any, unit: str = "1") -> None:
        rows.append((words, float(value), unit))

    law, naive, drawn = (cube[f"{kind}_error"] for kind in ("law", "naive", "simulated"))
    for one in CHAPTERS:
        rows_of = cube["of_structure"].values == one
        for words, values in (("law over simulated", law / drawn), ("naive over law", naive / law)):
            part = values.values[rows_of]
            of(f"{words}, {one}, least", part.min())
            of(f"{words}, {one}, median", np.median(part))
            of(f"{words}, {one}, largest", part.max())
    for axis in "XYZ":
        ratio = cube["cone_drawn_error"].sel(axis=axis) / cube["cone_error"].sel(axis=axis)
        of(f"cone, drawn over closed form, {axis}", np.sqrt(np.mean(ratio**2)))
    for one in CHAPTERS:
        part = cube.sel(structure=one)
        for finding in FINDINGS[:-1]:
            of(f"exponent of {finding}, {one}", part["expected_exponent"].sel(finding=finding))
            of(f"exponent of {finding} at the centre, {one}",
               part["centre_exponent"].sel(finding=finding))  # fmt: skip
            of(f"exponent of {finding} far below a pixel, {one}",
               part["small_exponent"].sel(finding=finding))  # fmt: skip
        of(f"best aperture, {one}", part["best_aperture"], "degree")
        of(f"error at 60 degrees over the least, {one}", part["wide_gain"])
        for array in setups.pairs():
            of(f"exponent of number in {array}, {one}", part["array_exponent"].sel(array=array))
    for count in study.counts:
        for rate in study.frame_rates_hz:
            here, at = f"{count} cameras, {rate:g} Hz", cube.sel(count=count, rate=rate)
            of(f"width, {here}", at["width_px"], "px")
            of(f"error of one frame by the law, {here}", at["frame_error"], "percent")
            for name in ESTIMATORS:
                one = at.sel(estimator=name)
                of(f"error of one frame, {name}, {here}", one["drawn_frame_error"], "percent")
                of(f"error of the fit, {name}, {here}", one["drawn_fit_error"], "percent")
    words, values, units = (list(column) for column in zip(*rows, strict=True))
    return {"quantity": words, "value": values, "unit": units}
