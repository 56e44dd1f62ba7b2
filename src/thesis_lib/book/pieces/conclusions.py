"""Tables of chapter 7: conclusions, comparison at equal pixels, results of future work."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.book.pieces import factors
from thesis_lib.book.pieces.opened import Cubes
from thesis_lib.facts import claims, setups
from thesis_lib.figure_sets.design_law.sweeps import STRUCTURES, mode_shapes
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.ledger import entries as ledger, trends, verdicts
from thesis_lib.plotting import selection
from thesis_lib.templates import render
from thesis_lib.vision import cone_law, pinhole, rounding

LEVEL_TRENDS = ("flat", "within", "no trend", "at most", "below")  # trends that state no change


def tabulate_factor(name: str, opened: Cubes) -> str:
    """Tabulate how strongly one of the five conclusions holds, group by group.

    For the aperture, the effect on a pair with noise in all coordinates is predicted by elevation.
    """
    factor = factors.FACTORS[name]
    pair: dict[float, float] = {}
    for curve in factors.read_curves(opened, factor) if name == "wider" else ():
        angles = np.radians(curve.values), np.radians(curve.elevation)
        pair[curve.elevation] = factors.end_ratio(cone_law.pair_noise_error(1, 1, *angles), 1)
    return render(
        __file__,
        "conclusions-factor",
        factor=factor,
        effects=factors.estimate_effects(opened, factor),
        median=np.median,
        unchanged=verdicts.UNCHANGED,
        optimum=_find_optimum(opened) if name == "lower" else None,
        pair=sorted(pair.items()),
        motion_percent=100 * cone_law.MAX_MOTION_FRACTION,
    )


def _find_optimum(opened: Cubes) -> dict[str, Any]:
    """Find the best elevation in the laboratory, and the elevations that are too low."""
    cube = opened["lab-elevation"]
    elevations = selection.select_settings(cube, "three-rows", 1)["value"].values
    error = selection.error_bars(cube, "three-rows", 1).band[1]
    best, steepest = int(np.nanargmin(error)), int(np.argmax(elevations))
    lowest = int(np.flatnonzero(np.isfinite(error))[0])
    ends = {"best": best, "steepest": steepest, "lowest": lowest}
    found = {name: {"at": elevations[i], "error": error[i]} for name, i in ends.items()}
    return found | {"lost": elevations[np.isnan(error)].tolist()}


def _list_trends(opened: Cubes) -> list[ledger.Entry]:
    return [entry for entry in ledger.from_cube(opened["claims"]) if entry.kind == "trend"]


def tabulate_stated(opened: Cubes) -> str:
    """Tabulate every sentence of the thesis's conclusions with the ledger's verdict."""
    entries = [entry for entry in _list_trends(opened) if "-concluding-" in entry.id]
    return render(__file__, "conclusions-stated", entries=entries)


def count_trends(opened: Cubes) -> str:
    """Count the trends that the thesis claims for each factor, by the ledger's verdict."""
    entries = _list_trends(opened)
    parameter = {trend.id: trend.parameter for trend in claims.read_trends()}
    parts: dict[str, list[ledger.Entry]] = {}
    left = entries
    for one in factors.FACTORS.values():
        parts[one.conclusion] = [e for e in left if parameter[e.id].startswith(one.parameter)]
        left = [entry for entry in left if entry not in parts[one.conclusion]]
    parts["anything else"] = left
    wider = factors.FACTORS["wider"].conclusion
    return render(
        __file__,
        "conclusions-counted",
        verdicts=verdicts.VERDICTS,
        count=ledger.count_verdicts,
        entries=entries,
        parts=parts,
        wider=wider,
        level=sum(e.verdict == "agrees" and e.stated in LEVEL_TRENDS for e in parts[wider]),
    )


def _read_sound_studies(opened: Cubes) -> list[tuple[str, xr.Dataset]]:
    """Return label and cube of each sound study, with the random trials only."""
    names = [f"sound-{study}" for study in ("distance", "aperture", "resolution", "arrays")]
    return [(STUDIES[name].varied_label, opened[name].isel(trial=slice(1, None))) for name in names]


def correlate_sound(opened: Cubes) -> str:
    """Correlate the ranks of field and deflection errors, in expectation and run by run.

    Each mode and plane with a reference pressure is one correlation over all cases together.
    """
    rows = []
    for varied, cube in _read_sound_studies(opened):
        orders, slopes, draws = [], [], []
        for plane, m in product(cube["plane"].values, range(cube.sizes["mode"])):
            part = cube.isel(mode=m).sel(plane=plane)
            names = ("deflection_error", "plane_error")
            shape, field = (part[name].transpose("setting", "trial").values for name in names)
            if not np.isfinite(field).all():
                continue
            expected = [np.sqrt(np.mean(errors**2, axis=1)) for errors in (shape, field)]
            columns = map(np.column_stack, zip(expected, (shape, field), strict=True))
            common, norm = trends.correlate_ranks(*columns)
            order, *single = common / norm
            orders.append(order)
            slopes.append(factors.fit_exponent(*expected))
            draws += single
        median, positive = np.median(draws), np.mean(np.array(draws) > 0)
        rows.append((varied, cube.sizes["setting"], orders, median, positive, slopes))
    every, aperture = factors.sound_trends(opened), factors.sound_trends(opened, "wider")
    return render(__file__, "conclusions-sound", rows=rows, every=every, aperture=aperture)


def tabulate_sound_errors(opened: Cubes) -> str:
    """Tabulate the errors of the sound: median, and largest 95 % quantile."""
    rows = []
    for varied, cube in _read_sound_studies(opened):
        shape, sound = cube["deflection_error"], cube["plane_error"]
        largest = sound.quantile(0.95, "trial", skipna=False).max()
        below = (sound < 10).sum() / sound.count()
        rows.append((varied, shape.median(), sound.median(), largest, below))
    return render(__file__, "conclusions-small", rows=rows)


def tabulate_experiment(opened: Cubes) -> str:
    """Tabulate which conclusions the thesis's experiment confirms, by centre-detection method."""
    rows = []
    for name, key in (("experiment-resolution", "finer"), ("experiment-cameras", "more")):
        cube, factor = opened[name], factors.FACTORS[key]
        for case in selection.list_cases(cube):
            if case.endswith("-all"):  # sets of cameras that do not grow
                continue
            alone = replace(factor, sources=((case, name, (case,)),))
            (effect,) = factors.estimate_effects(opened, alone)
            part = selection.select_settings(cube, case, 1)
            labels = part["label"].values
            claims = selection.claimed_errors(cube, case, 1) if case == "matched" else [None]
            claimed = [claim.stated for claim in (claims[0], claims[-1]) if claim]
            rms = selection.trial_rms(part["mean_error"]).values
            best = labels[np.nanargmin(rms)]
            against = {
                f"not monotonic, best at {best}": effect.not_monotonic,
                "yes": effect.confident,
                "the opposite": effect.opposite,
                verdicts.UNCHANGED: effect.unchanged,
            }
            holds = next((word for word, n in against.items() if n), "undecided")
            rows.append((factor.conclusion, effect, labels, rms, claimed, holds))
    return render(__file__, "conclusions-experiment", rows=rows)


def tabulate_costs(opened: Cubes) -> str:
    """Tabulate the cost of half the error, by the exponents of the simulated beam and plate."""
    rows = []
    for name, factor in factors.FACTORS.items():
        for one in factors.estimate_effects(opened, factor):
            if one.group not in ("beam", "plate"):
                continue
            halving = None
            if name in ("closer", "finer", "more"):  # whose errors are a power of the factor
                halving = 2 ** (-1 / float(np.median(one.exponents)))
            end = 0 if name == "closer" else -1  # index of the best setting
            shares = [  # of marker images on the sensor
                float(
                    selection.select_settings(opened[of], case, 1).sortby("value")["in_view"][end]
                )
                for group, of, cases in factor.sources
                if group == one.group
                for case in cases or selection.list_cases(opened[of])
            ]
            pixels = {"finer": (halving or 0) ** 2, "more": halving}.get(name)
            rows.append((factor, one, halving, pixels, min(shares)))
    return render(__file__, "conclusions-costs", rows=rows, median=np.median)


def equal_pixels() -> pd.DataFrame:
    """Compare each growing array of chapters 3 and 4 with its best pair at equal total pixels.

    Arrays that grow from a poor pair do not show whether more or finer cameras measure better, as
    number and positions change together. This comparison separates them. All cameras of a case
    have N W H pixels; each of its pairs gets as many, so W is √(N/2) times as wide. The law of
    rounding predicts both errors, with the lens and amplitude of the studies: in %, rms over
    markers and modes, of all cameras (``array``) and of the best pair.
    """
    rows = []
    for name, make in STRUCTURES.items():
        study = camera_study(f"{name}-arrays")
        settings, points = study.settings(), mode_shapes(make(), study.peaks_m[0])
        for case in setups.camera_pairs():
            whole = [one for one in settings if one.case == case][-1]
            directions, n = whole.directions_deg, len(whole.directions_deg)
            pairs = [directions[i : i + 2] for i in range(0, n, 2)]
            array = _predict_error(whole, directions, 1, points)
            best = min(_predict_error(whole, pair, np.sqrt(n / 2), points) for pair in pairs)
            rows.append((name, case, n, array, best, best / array))
    columns = ("structure", "case", "n_cameras", "array", "pair", "ratio")
    return pd.DataFrame(rows, columns=columns)


def _predict_error(
    setting: setups.Setting, directions: Sequence[setups.Direction], finer: float, points: Array
) -> float:
    """Predict the rms error over modes and markers, in % of each mode's largest deflection.

    The cameras are those of a setting in some directions, with `finer` times its pixels across.
    `points` have shape (3, 1 + modes, m), at rest first.
    """
    reading = setups.assumed_values("beam")
    across = finer * setting.resolution_px[0]
    focal = reading["focal_length_mm"] / reading["sensor_width_mm"] * across
    width, height = (round(finer * side) for side in setting.resolution_px)
    azimuth, elevation = np.radians(directions).T
    radius = setting.distance_mm / 1000
    rig = pinhole.hemisphere_cameras(radius, azimuth, elevation, focal, (width, height))
    variance = rounding.deflection_variance(rig.P, points[:, :1], points[:, 1:])
    largest = np.max(np.abs(points[2, 1:]), axis=1)
    return float(100 * np.sqrt(np.mean(variance / largest[:, None] ** 2)))


def tabulate_equal_pixels(_: Cubes) -> str:
    """Tabulate arrays and pairs at equal pixels."""
    found, material = equal_pixels(), trends.MIN_MATERIAL_FALL
    return render(
        __file__,
        "conclusions-pixels",
        found=found.to_dict("records"),
        worse=found[found["ratio"] > 1 + material].to_dict("records"),
        better=sum(found["ratio"] < 1 - material),
        material=material,
        median=found["ratio"].median(),
    )


def tabulate_future_work(opened: Cubes) -> str:
    """Tabulate the results of the future work in sections 5.3 and 7.1, one number each."""
    layouts, plate = opened["lab-layout"], opened["lab-plate"]
    coarse = opened["lab-equal-pixels"]
    judged = ledger.from_cube(opened["claims"])
    return render(
        __file__,
        "conclusions-wishes",
        distances=_case_errors(layouts, "distance"),
        apertures=_case_errors(layouts, "aperture"),
        sets=_case_errors(layouts, "subsets"),
        elevations=_find_optimum(opened),
        pairs=_case_errors(opened["experiment-cameras"], "literal-all"),
        coarse=[
            selection.select_settings(coarse, case, 1).isel(setting=-1)
            for case in selection.list_cases(coarse)
        ],
        modes=_read_modes(opened["lab-modes"]),
        plate=_change_ratios(plate, factors.MEAN_ERRORS),
        plate_sound=_change_ratios(plate, factors.PLANE_ERRORS),
        ledger=next(entry for entry in judged if entry.id == "ch3-concluding-t8"),
        shape=_case_errors(opened["shape-l"], "4e"),
        median=np.nanmedian,
    )


def _case_errors(cube: xr.Dataset, case: str) -> list[dict[str, Any]]:
    """Return the label, number of cameras and median error of each setting of a case in mode 1."""
    part, error = selection.select_settings(cube, case, 1), selection.error_bars(cube, case, 1)
    columns = part["label"].values, part["n_cameras"].values, error.band[1]
    return [
        {"label": label, "n_cameras": n_cameras, "error": median}
        for label, n_cameras, median in zip(*columns, strict=True)
    ]


def _read_modes(cube: xr.Dataset) -> dict[str, Any]:
    """Return the error of each mode in the first setting, and the torsion in the last mode."""
    modes = cube["mode"].values.tolist()
    last = selection.select_settings(cube, "known", modes[-1]).isel(setting=0)
    return {
        "errors": [(mode, selection.error_bars(cube, "known", mode).band[1][0]) for mode in modes],
        "label": last["label"].item(),
        "last": modes[-1],
        "torsion_um": 1e6 * float(cube["torsion_reference"]),
        "std_um": 1e6 * float(last["torsion_standard_error"]),
    }


def _change_ratios(cube: xr.Dataset, quantities: tuple[str, ...]) -> list[tuple[str, float]]:
    """Return by case the last setting's error over the first's, median over modes and errors."""
    found = []
    for case in selection.list_cases(cube):
        bands = [
            selection.error_bars(cube, case, mode, quantity).band[1]
            for mode in cube["mode"].values.tolist()
            for quantity in quantities
        ]
        ratios = [band[-1] / band[0] for band in bands if np.isfinite(band).all()]
        found.append((case, float(np.median(ratios))))
    return found


PIECES: dict[str, Callable[[Cubes], str]] = {
    **{f"conclusions-{name}": partial(tabulate_factor, name) for name in factors.FACTORS},
    "conclusions-stated": tabulate_stated,
    "conclusions-counted": count_trends,
    "conclusions-sound": correlate_sound,
    "conclusions-small": tabulate_sound_errors,
    "conclusions-experiment": tabulate_experiment,
    "conclusions-costs": tabulate_costs,
    "conclusions-pixels": tabulate_equal_pixels,
    "conclusions-wishes": tabulate_future_work,
}
