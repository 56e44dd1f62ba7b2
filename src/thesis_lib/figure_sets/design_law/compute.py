"""The cube of ``design-law``: the law, simulations, findings, equal pixels, estimators, dither."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from thesis_lib.facts import setups
from thesis_lib.figure_sets.design_law import shares, sweeps
from thesis_lib.figure_sets.design_law.figure_set import DesignLaw
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.vibration.structure import world_points
from thesis_lib.vision import cone_law, rounding, simulation
from thesis_lib.vision.cone_law import MOTION_PX, cone_cameras
from thesis_lib.vision.pinhole import pixelate, project
from thesis_lib.vision.triangulation import point_covariance, triangulate, triangulation_gain

CHAPTER_PARTS = ("distance", "aperture", "resolution", "arrays")  # of chapters 3 and 4
MOTIONS_PX = np.unique(np.round([*np.geomspace(0.01, 1, 41), *np.linspace(0.5, 5, 91)], 9))  # px
CONE_ANGLES_DEG = np.arange(5.0, 86.0)  # degrees, of the cone
DRAWS_PER_TRIAL = 20  # for each trial, where one costs little
# What differs by less is equal on some processors and not on others; `variables.toml` says so
MAX_PROCESSOR_DIFFERENCE = 1e-13

VARIABLES = read_variables(__file__, "cube")
COORDINATES = read_variables(__file__, "coordinates")


def run(study: DesignLaw) -> xr.Dataset:
    """Compute the cube of the figure set ``design-law``.

    (a) along ``motion`` and ``setting``, (b) along ``angle``, (c) along ``finding`` and for pairs
    along ``tilt`` and ``opening``, (d) along ``count`` and ``rate``, (e) estimators along
    ``equidistant_rig``, ``noise`` and ``unequal_distance``, with noise at equal pixels along
    ``count``, ``image_noise`` and ``approach``, (f) dither along ``fitted_amplitude``, ``shake``
    and ``disc``; ``quantity``, ``value`` and ``unit`` are what runs are compared by.
    """
    cube = xr.Dataset(coords=_coordinates(study))
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


def _coordinates(study: DesignLaw) -> dict[str, Any]:
    asked = [(one, part) for one in sweeps.STRUCTURES for part in CHAPTER_PARTS]
    every = [(*a, s) for a in asked for s in sweeps.thesis_study(study, *a).settings()]
    values = {
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
        "approach": list(shares.TRACKING_APPROACHES),
        "mistake": list(shares.ASSUMED_MISTAKES),
        "unequal_distance": [
            ", ".join(f"{d:g}" for d in one) for one in shares.UNEQUAL_DISTANCES_M
        ],
        "fitted_amplitude": shares.FITTED_AMPLITUDES_PX,
        "shake": shares.SHAKES_PX,
        "disc": shares.DISC_DIAMETERS_PX,
    }
    return label_values(values, COORDINATES)


# (a) The law.


def _motions(study: DesignLaw) -> dict[str, ArrayLike]:
    """Return one coordinate: the law, and as many draws."""
    random = np.random.default_rng(study.seed)
    place = random.uniform(-0.5, 0.5, (DRAWS_PER_TRIAL * study.trials, 1))
    error = pixelate(place + MOTIONS_PX) - pixelate(place) - MOTIONS_PX
    drawn, std = simulation.rms_with_std(error)
    return {
        "motion_error": np.sqrt(rounding.difference_variance(MOTIONS_PX)),
        "drawn_motion_error": drawn,
        "drawn_motion_error_std": std,
    }


def _settings(study: DesignLaw) -> dict[str, ArrayLike]:
    """Return every setting of chapters 3 and 4: law, simulation, and independent roundings."""
    law, simulated, naive = [], [], []
    for structure in sweeps.STRUCTURES:
        for part in CHAPTER_PARTS:
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
                each = (
                    np.mean(np.sum(triangulation_gain(P, points)[2] ** 2, axis=(0, 1)), axis=-1)
                    / 12
                )
                naive.append(scale * np.sqrt(each[1:] + each[0]))
    return {
        "law_error": np.concatenate(law),
        "simulated_error": np.concatenate(simulated),
        "naive_error": naive,
    }


# (b) The cone.


def _cone(study: DesignLaw) -> dict[str, ArrayLike]:
    """Compute the cone by closed form, Jacobian, and random motions with whole pixels."""
    distance, n = study.cone_distance_mm / 1000, study.cone_cameras
    focal = study.focal_length_mm / study.sensor_width_mm * study.resolution_px[0]
    random = np.random.default_rng(study.seed)
    reach = sweeps.CONE_MOTION_PX * distance / focal
    moved = random.uniform(-reach, reach, (3, DRAWS_PER_TRIAL * study.trials))
    shift = random.uniform(-0.5, 0.5, (n, 2, 1, moved.shape[1]))
    points = np.stack([np.zeros_like(moved), moved], axis=1)
    closed, exact, drawn = [], [], []
    for angle in np.radians(CONE_ANGLES_DEG):
        P = cone_cameras(distance, angle, n, focal, study.resolution_px).P
        closed.append(cone_law.cone_covariance(distance, focal, n, angle))
        exact.append(point_covariance(P, np.zeros(3), MOTION_PX))
        found = triangulate(P, pixelate(project(P, points) + shift) - shift)
        drawn.append(simulation.rms_with_std((found[:, 1] - found[:, 0] - moved).T))
    variances = np.diagonal(closed, axis1=1, axis2=2)
    scale = np.sqrt(variances[:, :, None] * variances[:, None])
    return {
        "cone_error": np.sqrt(variances),
        "cone_jacobian_error": np.sqrt(np.diagonal(exact, axis1=1, axis2=2)),
        "cone_drawn_error": [rms for rms, _ in drawn],
        "cone_drawn_error_std": [std for _, std in drawn],
        "cone_difference": max(
            MAX_PROCESSOR_DIFFERENCE, np.max(np.abs(np.array(exact) - closed) / scale)
        ),
    }


def summarise_law(cube: xr.Dataset, study: DesignLaw) -> dict[str, ArrayLike]:
    """Return the published and compared quantities, one number and unit to a row."""
    rows: list[tuple[str, float, str]] = []

    def add_quantity(words: str, value: Any, unit: str = "1") -> None:
        rows.append((words, float(value), unit))

    def add_along(words: str, values: xr.DataArray, unit: str) -> None:
        """Add each value of a variable along one dimension, whose coordinate is in the words."""
        for one in values:
            add_quantity(words.format(one[values.dims[0]].item()), one, unit)

    law, naive, simulated = (cube[f"{kind}_error"].values for kind in ("law", "naive", "simulated"))
    for one in sweeps.STRUCTURES:
        at = cube["of_structure"].values == one
        ratios = {"law over simulated": law / simulated, "naive over law": naive / law}
        for words, ratio in ratios.items():
            add_quantity(f"{words}, {one}, least", ratio[at].min())
            add_quantity(f"{words}, {one}, median", np.median(ratio[at]))
            add_quantity(f"{words}, {one}, largest", ratio[at].max())
    for axis in "XYZ":
        over = cube["cone_drawn_error"].sel(axis=axis) / cube["cone_error"].sel(axis=axis)
        add_quantity(f"cone, drawn over closed form, {axis}", np.sqrt(np.mean(over**2)))
    for words, kind in (("rounded", ""), ("independent noise", "_noise")):
        over = cube[f"drawn_pair{kind}_error"] / cube[f"pair{kind}_error"]
        add_quantity(f"pairs, drawn over closed form, {words}", np.sqrt(np.mean(over**2)))
    for one in sweeps.STRUCTURES:
        part = cube.sel(structure=one)
        where = {"expected": "", "centre": " at the centre", "small": " far below a pixel"}
        for finding in sweeps.SWEPT_FINDINGS[:-1]:
            for kind, words in where.items():
                exponent = part[f"{kind}_exponent"].sel(finding=finding)
                add_quantity(f"exponent of {finding}{words}, {one}", exponent)
        for kind in cube["amplitudes"].values:
            taken, words = part.sel(amplitudes=kind), f"amplitudes {kind}, {one}"
            add_quantity(f"best aperture, {words}", taken["best_aperture"], "degree")
            add_quantity(f"error at 60 degrees over the least, {words}", taken["wide_gain"])
        add_along(f"exponent of number in {{}}, {one}", part["array_exponent"], "1")
    for count in study.counts:
        for rate in study.frame_rates_hz:
            here, part = f"{count} cameras, {rate:g} Hz", cube.sel(count=count, rate=rate)
            add_quantity(f"width, {here}", part["width_px"], "px")
            add_quantity(f"error of one frame by the law, {here}", part["frame_error"], "percent")
            add_quantity(f"error of the fit by the law, {here}", part["fit_error"], "percent")
            for name in shares.ESTIMATORS:
                for words, kind in (("one frame", "frame"), ("the fit", "fit")):
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
    return dict(zip(("quantity", "value", "unit"), zip(*rows, strict=True), strict=True))
