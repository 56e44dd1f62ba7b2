"""The cube of ``design-law``, and further values for its tables.

The cube holds the law, simulations, findings, equal pixels, estimators and dither.
"""

import json
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import ArrayLike, IntArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.design_law import shares, sweeps
from thesis_lib.figure_sets.design_law.figure_set import DesignLaw
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.studies.schema import label_values, list_quantities, read_variables
from thesis_lib.vibration.structure import world_points
from thesis_lib.vision import cone_law, dither, pinhole, rounding, simulation, triangulation

CHAPTER_PARTS = ("distance", "aperture", "resolution", "arrays")  # of chapters 3 and 4
MOTIONS_PX = np.unique(np.round([*np.geomspace(0.01, 1, 41), *np.linspace(0.5, 5, 91)], 9))
CONE_ANGLES_DEG = np.arange(5.0, 86.0)
DRAWS_PER_TRIAL = 20  # where a draw costs little
# Smaller differences vary with the processor; `variables.toml` explains it
MAX_PROCESSOR_DIFFERENCE = 1e-13

VARIABLES = read_variables(__file__, "cube")


def run(study: DesignLaw) -> xr.Dataset:
    """Compute the cube of the figure set ``design-law``.

    (a) along ``motion`` and ``setting``, (b) along ``angle``, (c) along ``finding`` and for pairs
    along ``tilt`` and ``opening``, (d) along ``count`` and ``rate``, (e) estimators along
    ``equidistant_rig``, ``noise`` and ``unequal_distance``, with noise at equal pixels along
    ``count``, ``image_noise`` and ``approach``, (f) dither along ``fitted_amplitude``, ``shake``
    and ``disc``. Runs are compared by ``quantity``, ``value`` and ``unit``.
    """
    asked = product(sweeps.STRUCTURES, CHAPTER_PARTS)
    every = [(*a, s) for a in asked for s in sweeps.thesis_study(study, *a).settings()]
    coords = {
        "motion": MOTIONS_PX,
        "of_structure": [a for a, _, _ in every],
        "of_part": [b for _, b, _ in every],
        "of_layout": [s.case for *_, s in every],
        "label": [s.label for *_, s in every],
        "shape": list(sweeps.SWEPT_MODES),
        "angle": CONE_ANGLES_DEG,
        "axis": ["X", "Y", "Z"],
        "finding": list(sweeps.SWEPT_FINDINGS),
        "structure": list(sweeps.STRUCTURES),
        "array": list(setups.camera_pairs()),
        "amplitudes": ["of the thesis", "averaged"],
        "tilt": list(sweeps.ELEVATIONS_DEG),
        "opening": list(sweeps.APERTURES_DEG),
        "count": study.counts,
        "rate": study.frame_rates_hz,
        "estimator": list(shares.ESTIMATORS),
        "rule": list(simulation.ESTIMATORS),
        "equidistant_rig": list(shares.EQUIDISTANT_COUNTS),
        "noise": list(shares.RIG_NOISES_PX),
        "image_noise": shares.NOISES_PX,
        "approach": list(shares.ESTIMATORS),
        "mistake": list(shares.ASSUMED_MISTAKES),
        "unequal_distance": [
            ", ".join(f"{d:g}" for d in one) for one in shares.UNEQUAL_DISTANCES_M
        ],
        "fitted_amplitude": shares.FITTED_AMPLITUDES_PX,
        "shake": shares.SHAKES_PX,
        "disc": shares.DISC_DIAMETERS_PX,
    }
    cube = xr.Dataset(coords=label_values(coords, VARIABLES))
    parts = (
        _motions,
        _settings,
        _cone,
        sweeps.fit_findings,
        sweeps.fit_arrays,
        sweeps.pair_errors,
        shares.equal_pixels,
        shares.simulate_estimators,
        shares.noisy_shares,
        shares.simulate_dither,
    )
    for part in parts:
        cube = cube.assign(label_values(part(study), VARIABLES))
    return cube.assign(label_values(summarise_law(cube, study), VARIABLES))


def _motions(study: DesignLaw) -> dict[str, ArrayLike]:
    """Return (a) along `motion`: rms errors of one coordinate, by the law and simulated."""
    random = np.random.default_rng(study.seed)
    place = random.uniform(-0.5, 0.5, (DRAWS_PER_TRIAL * study.trials, 1))
    error = pinhole.pixelate(place + MOTIONS_PX) - pinhole.pixelate(place) - MOTIONS_PX
    return {
        "motion_error": np.sqrt(rounding.difference_variance(MOTIONS_PX)),
        **sweeps.with_std("drawn_motion_error", simulation.rms_with_std(error)),
    }


def _settings(study: DesignLaw) -> dict[str, ArrayLike]:
    """Return (a) along `setting` of chapters 3 and 4: law, simulation, independent roundings."""
    law, simulated, naive = [], [], []
    for structure, part in product(sweeps.STRUCTURES, CHAPTER_PARTS):
        request = sweeps.thesis_study(study, structure, part)
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
            squares = np.sum(triangulation.triangulation_gain(P, points)[2] ** 2, axis=(0, 1))
            each = np.mean(squares, axis=-1) / 12
            naive.append(scale * np.sqrt(each[1:] + each[0]))
    return {
        "law_error": np.concatenate(law),
        "simulated_error": np.concatenate(simulated),
        "naive_error": naive,
    }


def _cone(study: DesignLaw) -> dict[str, ArrayLike]:
    """Compute (b), the cone, by closed form, Jacobian, and random motions with whole pixels."""
    distance, n = study.cone_distance_mm / 1000, study.cone_cameras
    focal = study.focal_length_mm / study.sensor_width_mm * study.resolution_px[0]
    random = np.random.default_rng(study.seed)
    reach = sweeps.CONE_MOTION_PX * distance / focal
    moved = random.uniform(-reach, reach, (3, DRAWS_PER_TRIAL * study.trials))
    shift = random.uniform(-0.5, 0.5, (n, 2, 1, moved.shape[1]))
    points = np.stack([np.zeros_like(moved), moved], axis=1)
    closed, exact, drawn = [], [], []
    for angle in np.radians(CONE_ANGLES_DEG):
        P = cone_law.cone_cameras(distance, angle, n, focal, study.resolution_px).P
        closed.append(cone_law.cone_covariance(distance, focal, n, angle))
        exact.append(triangulation.point_covariance(P, np.zeros(3), cone_law.MOTION_PX))
        found = triangulation.triangulate(
            P, pinhole.pixelate(pinhole.project(P, points) + shift) - shift
        )
        drawn.append(simulation.rms_with_std((found[:, 1] - found[:, 0] - moved).T))
    variances = np.diagonal(closed, axis1=1, axis2=2)
    scale = np.sqrt(variances[:, :, None] * variances[:, None])
    return {
        "cone_error": np.sqrt(variances),
        "cone_jacobian_error": np.sqrt(np.diagonal(exact, axis1=1, axis2=2)),
        **sweeps.with_std("cone_drawn_error", zip(*drawn, strict=True)),
        "cone_difference": max(
            MAX_PROCESSOR_DIFFERENCE, np.max(np.abs(np.array(exact) - closed) / scale)
        ),
    }


def summarise_law(cube: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """Return the published and compared quantities, one number and unit per row."""
    rows: list[tuple[str, float, str]] = []

    def add_quantity(words: str, value: Any, unit: str = "1") -> None:
        rows.append((words, float(value), unit))

    def add_along(words: str, values: xr.DataArray, unit: str) -> None:
        """Add each value along the only dimension of a variable, with its coordinate in `words`."""
        for one in values:
            add_quantity(words.format(one[values.dims[0]].item()), one, unit)

    law, naive, simulated = (cube[f"{kind}_error"].values for kind in ("law", "naive", "simulated"))
    for one in sweeps.STRUCTURES:
        at = cube["of_structure"].values == one
        ratios = {"law over simulated": law / simulated, "naive over law": naive / law}
        picks: Any = {"least": np.min, "median": np.median, "largest": np.max}
        for (words, ratio), (kind, pick) in product(ratios.items(), picks.items()):
            add_quantity(f"{words}, {one}, {kind}", pick(ratio[at]))
    for axis in "XYZ":
        over = cube["cone_drawn_error"].sel(axis=axis) / cube["cone_error"].sel(axis=axis)
        add_quantity(f"cone, drawn over closed form, {axis}", np.sqrt(np.mean(over**2)))
    for words, kind in (("rounded", ""), ("independent noise", "_noise")):
        over = cube[f"drawn_pair{kind}_error"] / cube[f"pair{kind}_error"]
        add_quantity(f"pairs, drawn over closed form, {words}", np.sqrt(np.mean(over**2)))
    for one in sweeps.STRUCTURES:
        part = cube.sel(structure=one)
        where = {"expected": "", "centre": " at the centre", "small": " far below a pixel"}
        for finding, (kind, words) in product(sweeps.SWEPT_FINDINGS[:-1], where.items()):
            exponent = part[f"{kind}_exponent"].sel(finding=finding)
            add_quantity(f"exponent of {finding}{words}, {one}", exponent)
        for kind in cube["amplitudes"].values:
            taken, words = part.sel(amplitudes=kind), f"amplitudes {kind}, {one}"
            add_quantity(f"best aperture, {words}", taken["best_aperture"], "degree")
            add_quantity(f"error at 60 degrees over the least, {words}", taken["wide_gain"])
        add_along(f"exponent of number in {{}}, {one}", part["array_exponent"], "1")
    fitted = {"one frame": "frame", "the fit": "fit"}
    for count, rate in product(study.counts, study.frame_rates_hz):
        here, part = f"{count} cameras, {rate:g} Hz", cube.sel(count=count, rate=rate)
        add_quantity(f"width, {here}", part["width_px"], "px")
        for words, kind in fitted.items():
            add_quantity(f"error of {words} by the law, {here}", part[f"{kind}_error"], "percent")
        for name, (words, kind) in product(shares.ESTIMATORS, fitted.items()):
            drawn = part[f"drawn_{kind}_error"].sel(estimator=name)
            add_quantity(f"error of {words}, {name}, {here}", drawn, "percent")
    for name in simulation.ESTIMATORS:
        part = cube.sel(rule=name)
        errors = part["equidistant_rig_error"].values
        power = simulation.fit_exponent(cube["equidistant_rig"].values, errors)
        add_quantity(f"exponent of number, random layouts, {name}", power)
        along = {"equidistant_rig": "cameras", "noise": "px noise", "unequal_distance": "m"}
        for dim, unit in along.items():
            add_along(f"error, {name}, {{}} {unit}", 1e6 * part[f"{dim}_error"], "um")
    add_along("noise that halves the gain, {} cameras", cube["tolerated_noise"], "px")
    for count in study.counts:
        part, here = cube.sel(count=count), f"{count} cameras"
        interval = part["noisy_share_error"].sel(approach="interval")
        add_along(f"error, interval, {here}, {{:g}} px noise", 1e6 * interval, "um")
        known = part["equal_pixels_tolerated_noise"].dropna("approach")
        add_along(f"noise that halves the gain at equal pixels, {{}}, {here}", known, "px")
    along = {"fitted_amplitude": "amplitude", "shake": "shake", "disc": "diameter"}
    for dim, words in along.items():
        ratio = cube[f"drawn_{dim}_error"] / cube[f"{dim}_error"]
        add_quantity(f"dither by {words}, drawn over closed form", np.sqrt(np.mean(ratio**2)))
    return list_quantities(rows)


SHOWN_NOISES_PX = (0.0, 0.05, 0.1, 0.3)
DITHERED = {  # kind of dither: its name in words, and values to list in px
    "fitted_amplitude": ("amplitude", (0.25, 0.5, 1, 2, 5)),
    "shake": ("shake", (0.1, 0.2, 0.3, 0.5)),
    "disc": ("diameter", (3, 5, 10)),
}
_OF_MARKERS = {"marker": shares.MARKER_DIAMETER_M, "followed_px": shares.MIN_TRACKED_HEIGHT_PX}


def largest_std(cube: xr.Dataset, *names: str) -> float:
    """Return the largest relative standard error of drawn variables, NaN for a single draw."""
    stds = [(cube[f"{name}_std"] / cube[name].where(cube[name] > 0)).values for name in names]
    largest = float(np.fmax.reduce(np.concatenate([np.ravel(one) for one in stds])))
    return largest if np.isfinite(largest) else np.nan


def compare_settings(cube: xr.Dataset) -> dict[str, Any]:
    """Compare the law and independent roundings with the simulation."""
    rows = []
    for one in cube["structure"].values:
        part = cube.isel(setting=np.flatnonzero(cube["of_structure"].values == one))
        law = (part["law_error"] / part["simulated_error"]).values
        naive = (part["naive_error"] / part["law_error"]).values
        rows.append({"structure": one, "law": law, "median": np.median(law), "naive": naive})
    worst = (cube["naive_error"] / cube["law_error"]).argmax(...)
    return {"rows": rows, "worst": cube.isel(worst)}


def describe_cone(cube: xr.Dataset) -> dict[str, Any]:
    """Return the largest drawn motion, and the one up to which closed forms hold."""
    asked = json.loads(cube.attrs["parameters"])
    pixel = asked["sensor_width_mm"] / (asked["focal_length_mm"] * asked["resolution_px"][0])
    return {
        "largest_motion": sweeps.CONE_MOTION_PX * pixel,
        "max_motion": cone_law.MAX_MOTION_FRACTION,
        "std": largest_std(cube, "cone_drawn_error"),
    }


def compare_exponents(cube: xr.Dataset) -> dict[str, Any]:
    """Return exponents of the findings at the centre, over all markers, and far below a pixel."""
    known = cube["centre_exponent"].notnull().all("structure").values
    nearest = cube["swept"].sel(finding="distance").min("step")
    peaks = [setups.assumed_values(one)["amplitude_mm"] for one in cube["structure"].values]
    return {
        "findings": [cube.isel(finding=i) for i in np.flatnonzero(known)],
        "motions": 100 * (sweeps.AMPLITUDE_RANGE[1] * np.array(peaks) / nearest.values),
        "max_motion": cone_law.MAX_MOTION_FRACTION,
    }


def summarise_findings(cube: xr.Dataset) -> dict[str, Any]:
    """Return the error at 20° elevation over that at the lowest, structure by structure."""
    low = cube.sel(finding="elevation")
    gains = [
        np.interp(20, part["swept"], part["expected_error"]) / float(part["expected_error"][0])
        for part in iterate_slices(low, "structure")
    ]
    return {"lowest": low["swept"][0, 0], "gains": gains}


def compare_estimators(cube: xr.Dataset) -> dict[str, Any]:
    """Return the exponents of the estimators in the number of cameras."""
    errors = cube["equidistant_rig_error"].transpose("rule", ...)
    return {
        "exponents": [simulation.fit_exponent(cube["equidistant_rig"], one) for one in errors],
        "distance": shares.CROWD_DISTANCE_M,
        "std": largest_std(cube, "equidistant_rig_error"),
    }


def list_dither(cube: xr.Dataset) -> dict[str, Any]:
    """List the residual error of one rounded coordinate at a few motions, shakes and sizes."""
    rows = []
    for name, (kind, values) in DITHERED.items():
        for value in values:
            at = cube.sel({name: value}, method="nearest")
            error, simulated = at[f"{name}_error"], at[f"drawn_{name}_error"]
            rows.append({"kind": kind, "value": at[name], "error": error, "drawn": simulated})
    std = largest_std(cube, *(f"drawn_{name}_error" for name in DITHERED))
    whole = dither.FRAME_VARIANCE_PX2**0.5
    return {"rows": rows, "whole": whole, "frames": shares.SHAKE_FRAMES, "std": std}


def compare_shares(cube: xr.Dataset, short: bool = False) -> dict[str, Any]:
    """Return numbers of cameras at equal pixels per second; few, middle and most if `short`."""
    counts: list[int] = cube["count"].values.tolist()
    followed = cube["count"].where(cube["marker_height"] >= shares.MIN_TRACKED_HEIGHT_PX, 0)
    most = [int(largest) for largest in followed.max("count").values]  # or 0, at each rate
    if short:  # and the largest numbers whose markers can be tracked
        ordered = sorted(counts)
        counts = sorted({ordered[0], ordered[len(counts) // 2], ordered[-1], *filter(None, most)})
    return {
        "counts": counts,
        "few": int(cube["count"].min()),
        "many": int(cube["count"].max()),
        "slow": float(cube["rate"].min()),
        "fast": float(cube["rate"].max()),
        "most": most[int(np.argmin(cube["rate"].values))],
        "std": largest_std(cube, "drawn_frame_error", "drawn_fit_error"),
        **_OF_MARKERS,
    }


def list_noisy(cube: xr.Dataset) -> dict[str, Any]:
    """Return numbers of cameras and noises for the table of errors with noise."""
    slowest = cube.sel(rate=cube["rate"].min())
    counts = np.sort(cube["count"].values)
    return {"counts": counts, "slowest": slowest, "shown": SHOWN_NOISES_PX, **_OF_MARKERS}


def _double_counts(cube: xr.Dataset) -> IntArray:
    """Return the numbers of cameras that are the smallest one times a power of two."""
    counts = np.sort(cube["count"].values)
    return np.asarray(counts[np.log2(counts / counts[0]) % 1 == 0])


def summarise_noisy(cube: xr.Dataset) -> dict[str, Any]:
    """Return the table of errors with noise for fewer numbers of cameras, and its main numbers."""
    errors, least = 1e6 * cube["noisy_share_error"], 1e6 * cube["least_share_error"]
    squares, centre, interval = (errors.sel(approach=name) for name in errors["approach"].values)
    few, many = int(cube["count"].min()), int(cube["count"].max())
    some = {"count": many, "image_noise": SHOWN_NOISES_PX[1]}
    loud = {"image_noise": cube["image_noise"].values >= SHOWN_NOISES_PX[-1]}
    stds = cube["noisy_share_error_std"] / cube["noisy_share_error"]
    below = (least / interval - 1) / stds.sel(approach=interval["approach"].item())
    return list_noisy(cube) | {
        "counts": _double_counts(cube),
        "few": few,
        "many": many,
        "noise": SHOWN_NOISES_PX[1],
        "loud": SHOWN_NOISES_PX[-1],
        "interval": interval.sel(some),
        "centre": centre.sel(some),
        "squares": squares.sel(some),
        "least": least.sel(some),
        "sharp": interval.sel(some | {"count": few}),
        "tolerated": cube["equal_pixels_tolerated_noise"].sel(approach="interval").dropna("count"),
        "level": (squares.max("count") / squares.min("count")).isel(loud).max() - 1,
        "known": stds.isel(loud).max(),
        "efficiency": ((least / interval) ** 2).isel(loud).min(),
        "below": max(0.0, float(below.max())),
        "worse": max(0.0, float((interval / np.minimum(squares, centre)).max()) - 1),
    }


def list_mistakes(cube: xr.Dataset) -> dict[str, Any]:
    """Return the errors of *interval* with wrongly assumed noise or outliers, and the extremes."""
    names = [str(one) for one in cube["approach"].values]
    squares, centre, interval = (cube["mistaken_error"].sel(approach=name) for name in names)
    doubled, rows = _double_counts(cube), []
    for mistake, (noise, _, _) in shares.ASSUMED_MISTAKES.items():
        for count in doubled[1::2] if len(doubled) > 1 else doubled:
            at = cube.sel(mistake=mistake, count=count)
            right = at["noisy_share_error"].sel(approach=names[-1], image_noise=noise)
            errors, stds = at["mistaken_error"], at["mistaken_error_std"]
            row = {"mistake": mistake, "count": count, "right": right, "errors": errors}
            rows.append(row | {"stds": stds, "agreeing": at["feasible_fraction"]})
    (low, (noise, less, _)), (high, (_, more, _)), (spoilt, _) = shares.ASSUMED_MISTAKES.items()
    over = (interval / squares).sel(mistake=low)
    worst = {"worse": over.max() - 1, "count": int(over.idxmax("count"))}
    return {
        "names": names,
        "rows": rows,
        "outlier_px": shares.OUTLIER_PX,
        "low": {"told": less, "noise": noise, **worst},
        "high": {"told": more, "ratio": (interval / centre).sel(mistake=high).max()},
        "many": max(doubled),
        "spoilt": (interval / squares).sel(mistake=spoilt, count=max(doubled)),
    }


TEXTS = {
    "motion": lambda cube: {"std": largest_std(cube, "drawn_motion_error")},
    "settings": compare_settings,
    "cone": describe_cone,
    "exponents": compare_exponents,
    "findings": summarise_findings,
    "pairs": lambda cube: {"std": largest_std(cube, "drawn_pair_error", "drawn_pair_noise_error")},
    "shares": compare_shares,
    "few-shares": partial(compare_shares, short=True),
    "estimators": compare_estimators,
    "noisy": list_noisy,
    "few-noisy": summarise_noisy,
    "mistakes": list_mistakes,
    "dither": list_dither,
}
