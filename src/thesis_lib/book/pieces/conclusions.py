"""Chapter 7: the values of its tables, the conclusions at equal pixels, and what came of wishes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from scipy.stats import spearmanr

from thesis_lib.arrays import Array
from thesis_lib.book.pieces import factors
from thesis_lib.book.pieces.opened import Cubes
from thesis_lib.facts import setups
from thesis_lib.facts.claims import read_trends
from thesis_lib.facts.setups import Direction, Setting
from thesis_lib.figure_sets.design_law.sweeps import STRUCTURES, mode_shapes
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.ledger import entries as ledger
from thesis_lib.ledger.trends import MIN_MATERIAL_FALL
from thesis_lib.ledger.verdicts import UNCHANGED, VERDICTS
from thesis_lib.plotting.selection import claimed_errors, error_bars, select_settings
from thesis_lib.templates import render
from thesis_lib.vision.cone_law import MAX_MOTION_FRACTION, pair_noise_error
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras
from thesis_lib.vision.rounding import deflection_variance

FACTOR_WORDS = {
    "closer": "closer",
    "wider": "wider apart",
    "lower": "lower",
    "finer": "finer pixels",
    "more": "more cameras",
}
LEDGER_PARAMETERS = {  # how the ledger's names of a trend's parameter begin
    "closer": "distance d",
    "wider": "aperture alpha",
    "lower": "elevation phi",
    "finer": "resolution",
    "more": "number of cameras",
}
LEVEL_TRENDS = ("flat", "within", "no trend", "at most", "below")  # trends that state no change


def tabulate_factor(name: str, opened: Cubes) -> str:
    """Tabulate how strongly one of the five conclusions holds, group by group."""
    effects = []
    for one in factors.estimate_effects(opened, factors.FACTORS[name]):
        against = {
            "opposite": one.opposite,
            UNCHANGED: one.unchanged,
            "not monotonic": one.not_monotonic,
        }
        texts = [f"{number} {word}" for word, number in against.items() if number]
        effects.append({"effect": one, "predicted": np.median(one.predicted), "against": texts})
    return render(
        __file__,
        "conclusions-factor",
        factor=factors.FACTORS[name],
        effects=effects,
        optimum=_find_optimum(opened) if name == "lower" else None,
        pair=_predict_pair(opened) if name == "wider" else None,
        motion_percent=100 * MAX_MOTION_FRACTION,
    )


def _predict_pair(opened: Cubes) -> list[tuple[float, float]]:
    """Predict by elevation the effect of the aperture on a pair with noise in all coordinates."""
    at: dict[float, float] = {}
    for curve in factors.read_curves(opened, factors.FACTORS["wider"]):
        angles = np.radians(curve.values), np.radians(curve.elevation)
        at[curve.elevation] = factors.end_ratio(pair_noise_error(1, 1, *angles), 1)
    return sorted(at.items())


def _find_optimum(opened: Cubes) -> dict[str, Any] | None:
    """Find the best elevation in the laboratory, and the elevations that are too low."""
    if (cube := opened.get("lab-elevation")) is None:
        return None
    elevations = select_settings(cube, "three-rows", 1)["value"].values
    error = error_bars(cube, "three-rows", 1).band[1]
    best, steepest = int(np.nanargmin(error)), int(np.argmax(elevations))
    lowest = int(np.flatnonzero(np.isfinite(error))[0])
    return {
        "best": elevations[best],
        "error": error[best],
        "steepest": elevations[steepest],
        "lowest": elevations[lowest],
        "to_steepest": error[best] / error[steepest],
        "to_least": error[lowest] / error[best],
        "lost": elevations[np.isnan(error)].tolist(),
    }


def tabulate_stated(opened: Cubes) -> str:
    """Tabulate every sentence of the thesis's conclusions, as the ledger judges it."""
    entries = [
        entry
        for entry in ledger.from_cube(opened["claims"])
        if entry.kind == "trend" and "-concluding-" in entry.id
    ]
    return render(__file__, "conclusions-stated", entries=entries)


def count_trends(opened: Cubes) -> str:
    """Count the trends that the thesis states of each factor, by the verdict of the ledger."""
    entries = {e.id: e for e in ledger.from_cube(opened["claims"]) if e.kind == "trend"}
    parameter = {trend.id: trend.parameter for trend in read_trends()}
    parts = {
        FACTOR_WORDS[name]: [
            e for id, e in entries.items() if parameter.get(id, "").startswith(start)
        ]
        for name, start in LEDGER_PARAMETERS.items()
    }
    used = {e.id for part in parts.values() for e in part}
    parts["anything else"] = [e for id, e in entries.items() if id not in used]
    agreeing = [e for e in entries.values() if e.verdict == "agrees"]
    level = [
        e
        for e in parts[FACTOR_WORDS["wider"]]
        if e.verdict == "agrees" and e.stated in LEVEL_TRENDS
    ]
    totals = ledger.count_verdicts([*entries.values()])
    return render(
        __file__,
        "conclusions-counted",
        verdicts=list(VERDICTS),
        parts=[
            (name, len(part), list(ledger.count_verdicts(part).values()))
            for name, part in parts.items()
        ],
        all={"count": len(entries), "numbers": list(totals.values())},
        differing=[e for e in entries.values() if e.verdict == "differs"],
        rendered=sum(not e.counted for e in entries.values()),
        agree=len(agreeing),
        agree_counted=sum(e.counted for e in agreeing),
        wider=FACTOR_WORDS["wider"],
        level=len(level),
    )


def correlate_sound(opened: Cubes) -> str:
    """Correlate the field's error with the deflection's, in expectation and run by run."""
    rows = []
    for study, pairs in factors.shape_and_sound(opened):
        orders, slopes, draws = [], [], []
        for shape, field in pairs:
            expected = [np.sqrt(np.mean(errors**2, axis=1)) for errors in (shape, field)]
            orders.append(float(spearmanr(*expected).statistic))
            slopes.append(factors.fit_exponent(*expected))
            draws += [
                float(spearmanr(a, b).statistic) for a, b in zip(shape.T, field.T, strict=True)
            ]
        row = {
            "varied": STUDIES[f"sound-{study}"].varied_label,
            "settings": len(pairs[0][0]),
            "orders": orders,
            "single_median": np.median(draws),
            "positive": np.mean(np.array(draws) > 0),
            "exponents": slopes,
        }
        rows.append(row)
    held, curves = factors.sound_trends(opened)
    aperture_held, aperture_curves = factors.sound_trends(opened, "wider")
    return render(
        __file__,
        "conclusions-sound",
        rows=rows,
        held=held,
        curves=curves,
        aperture_held=aperture_held,
        aperture_curves=aperture_curves,
    )


def tabulate_sound_errors(opened: Cubes) -> str:
    """Tabulate how large the errors of the sound are: median, and largest 95 % quantile."""
    rows = []
    for study in factors.SOUND_STUDIES:
        if (cube := opened.get(f"sound-{study}")) is None:
            continue
        drawn = cube["plane_error"].isel(trial=slice(1, None))
        every = drawn.values[np.isfinite(drawn.values)]
        row = {
            "varied": STUDIES[f"sound-{study}"].varied_label,
            "shape": cube["deflection_error"].isel(trial=slice(1, None)).median(),
            "sound": np.median(every),
            "largest": np.nanmax(np.quantile(drawn.transpose("trial", ...).values, 0.95, axis=0)),
            "below": np.mean(every < 10),
        }
        rows.append(row)
    return render(__file__, "conclusions-small", rows=rows)


def tabulate_experiment(opened: Cubes) -> str:
    """Tabulate what the thesis's experiment confirms, by the method of finding centres."""
    rows = []
    for name, factor in (("experiment-resolution", "finer"), ("experiment-cameras", "more")):
        if (cube := opened.get(name)) is None:
            continue
        claim = claimed_errors(cube, "matched", 1)
        for case in dict.fromkeys(cube["case"].values.tolist()):
            if case.endswith("-all"):  # sets of cameras that do not grow
                continue
            alone = replace(
                factors.FACTORS[factor], sources=((case, name, (case,), factors.MEAN_ERRORS),)
            )
            (effect,) = factors.estimate_effects(opened, alone)
            part = select_settings(cube, case, 1)
            drawn = part["mean_error"].transpose("setting", "trial").values[:, 1:]
            labels = part["label"].values
            claimed = [c.stated for c in (claim[0], claim[-1]) if c and case == "matched"]
            row = {
                "conclusion": FACTOR_WORDS[factor],
                "case": case,
                "labels": labels,
                "medians": np.median(drawn, axis=1),
                "effect": effect,
                "claimed": claimed if len(claimed) == 2 else [],
                "holds": _judge_curve(effect, labels[int(np.argmin(np.mean(drawn**2, axis=1)))]),
            }
            rows.append(row)
    return render(__file__, "conclusions-experiment", rows=rows)


def _judge_curve(one: factors.Effect, best: str) -> str:
    """Return whether a conclusion holds in the one curve there is, least at `best`."""
    found = {
        f"not monotonic, best at {best}": one.not_monotonic,
        "yes": one.confident,
        "the opposite": one.opposite,
        UNCHANGED: one.unchanged,
    }
    return next((word for word, number in found.items() if number), "not told apart")


def tabulate_costs(opened: Cubes) -> str:
    """Tabulate what half the error costs, by the exponents of the simulated beam and plate."""
    rows = []
    for name, factor in factors.FACTORS.items():
        for one in factors.estimate_effects(opened, factor):
            if one.group not in ("beam", "plate"):
                continue
            halving = None
            if name in ("closer", "finer", "more"):  # whose errors are a power of the factor
                halving = 2 ** (-1 / float(np.median(one.exponents)))
            row = {
                "conclusion": FACTOR_WORDS[name],
                "symbol": factor.symbol,
                "effect": one,
                "ratio": np.median(one.ratios),
                "factor": halving,
                "pixels": {"finer": (halving or 0) ** 2, "more": halving}.get(name),
                "visible": _visible_fraction(opened, f"{one.group}-", name),
            }
            rows.append(row)
    return render(__file__, "conclusions-costs", rows=rows)


def _visible_fraction(opened: Cubes, subject: str, name: str) -> float | None:
    """Return the least share of marker images on the sensor, at the best end of a factor."""
    shares = []
    for _, figure_set, cases, _ in factors.FACTORS[name].sources:
        if figure_set.startswith(subject) and figure_set in opened:
            cube = opened[figure_set]
            for case in cases or tuple(dict.fromkeys(cube["case"].values.tolist())):
                part = cube.isel(setting=np.flatnonzero(cube["case"].values == case))
                best = 0 if name == "closer" else -1
                shares.append(float(part["in_view"].values[np.argsort(part["value"].values)[best]]))
    return min(shares, default=None)


@dataclass(frozen=True)
class EqualPixels:
    """Errors by the law in %, rms over markers and modes, at equal pixels."""

    #: What is measured, and the growing array of the thesis
    structure: str
    case: str
    n_cameras: int  #: All cameras of the case
    #: Error of all of them, and of the best of its pairs with as many pixels
    array: float
    pair: float

    @property
    def ratio(self) -> float:
        """The pair's error over the array's."""
        return self.pair / self.array


def equal_pixels() -> Iterator[EqualPixels]:
    """Compare each growing array of chapters 3 and 4 with the best of its own pairs, made sharper.

    Arrays that grow from a poor pair cannot tell whether more cameras or finer ones measure better:
    there the number and the places change together. Here they are apart. All cameras of a case have
    N W H pixels; each of its pairs gets as many, so W is √(N/2) times as wide; and the law of
    rounding predicts the error of either, with the lens and amplitude of the studies.
    """
    for name, make in STRUCTURES.items():
        study = camera_study(f"{name}-arrays")
        settings, points = study.settings(), mode_shapes(make(), study.peaks_m[0])
        for case in setups.camera_pairs():
            whole = [one for one in settings if one.case == case][-1]
            directions, n = whole.directions_deg, len(whole.directions_deg)
            pairs = [directions[i : i + 2] for i in range(0, n, 2)]
            array = _law_error(_scale_rig(whole, directions, 1), points)
            best = min(_law_error(_scale_rig(whole, p, np.sqrt(n / 2)), points) for p in pairs)
            yield EqualPixels(name, case, n, array, best)


def _law_error(rig: CameraArray, points: Array) -> float:
    """Return the rms over the modes of markers' errors (3, 1 + modes, m), in % of the largest."""
    variance = deflection_variance(rig.P, points[:, :1], points[:, 1:])
    largest = np.max(np.abs(points[2, 1:]), axis=1)
    return float(100 * np.sqrt(np.mean(variance / largest[:, None] ** 2)))


def _scale_rig(setting: Setting, directions: Sequence[Direction], finer: float) -> CameraArray:
    """Return cameras of a setting in some directions, with `finer` times its pixels across."""
    reading = setups.assumed_values("beam")
    across = finer * setting.resolution_px[0]
    focal = reading["focal_length_mm"] / reading["sensor_width_mm"] * across
    width, height = (round(finer * side) for side in setting.resolution_px)
    azimuth, elevation = np.radians(directions).T
    return hemisphere_cameras(
        setting.distance_mm / 1000, azimuth, elevation, focal, (width, height)
    )


def tabulate_equal_pixels(_: Cubes) -> str:
    """Tabulate arrays and pairs at equal pixels."""
    found = list(equal_pixels())
    return render(
        __file__,
        "conclusions-pixels",
        found=found,
        worse=[one for one in found if one.ratio > 1 + MIN_MATERIAL_FALL],
        better=sum(one.ratio < 1 - MIN_MATERIAL_FALL for one in found),
        material=MIN_MATERIAL_FALL,
        median=np.median([one.ratio for one in found]),
    )


def tabulate_wishes(opened: Cubes) -> str:
    """Tabulate what came of the wishes of sections 5.3 and 7.1, in a number each."""

    def value_of(name: str, compute: Callable[[xr.Dataset], Any]) -> Any:
        cube = opened.get(name)
        return None if cube is None else compute(cube)

    return render(
        __file__,
        "conclusions-wishes",
        distances=value_of("lab-layout", partial(_case_errors, case="distance")),
        apertures=value_of("lab-layout", partial(_case_errors, case="aperture")),
        elevations=_find_optimum(opened),
        pairs=value_of("experiment-cameras", _compare_pairs),
        sets=value_of("lab-layout", _compare_sets),
        coarse=value_of("lab-equal-pixels", _last_settings),
        modes=value_of("lab-modes", _mode_errors),
        torsion=value_of("lab-modes", _read_torsion),
        plate=value_of("lab-plate", partial(_change_ratios, quantities=factors.MEAN_ERRORS)),
        plate_sound=value_of("lab-plate", partial(_change_ratios, quantities=factors.PLANE_ERRORS)),
        ledger=value_of("claims", _symmetry_entry),
        shape=value_of("shape-l", partial(_case_errors, case="4e")),
    )


def _case_errors(cube: xr.Dataset, case: str) -> dict[str, Any]:
    labels = select_settings(cube, case, 1)["label"].values
    return {"labels": labels, "errors": error_bars(cube, case, 1).band[1]}


def _compare_pairs(cube: xr.Dataset) -> dict[str, Any]:
    """Return the best and the worst pair of the experiment's cameras, and the error of all."""
    part = select_settings(cube, "literal-all", 1)
    error = error_bars(cube, "literal-all", 1).band[1]
    pairs = np.flatnonzero(part["n_cameras"].values == 2)
    ends = {"best": pairs[np.argmin(error[pairs])], "worst": pairs[np.argmax(error[pairs])]}
    labels = part["label"].values
    found = {name: {"error": error[i], "label": labels[i]} for name, i in ends.items()}
    whole = error[np.argmax(part["n_cameras"].values)]
    return {"sets": len(error), "all": whole, **found}


def _compare_sets(cube: xr.Dataset) -> dict[str, Any]:
    """Return the median error of pairs of the rendered cameras, and of all."""
    error = error_bars(cube, "subsets", 1).band[1]
    numbers = select_settings(cube, "subsets", 1)["n_cameras"].values
    few, many = (np.nanmedian(error[numbers == n]) for n in (2, numbers.max()))
    return {"sets": len(error), "most": numbers.max(), "pairs": few, "all": many}


def _last_settings(cube: xr.Dataset) -> list[xr.Dataset]:
    cases = dict.fromkeys(cube["case"].values.tolist())
    return [select_settings(cube, case, 1).isel(setting=-1) for case in cases]


def _mode_errors(cube: xr.Dataset) -> dict[str, Any]:
    modes = cube["mode"].values.tolist()
    errors = [(mode, error_bars(cube, "known", mode).band[1][0]) for mode in modes]
    return {"errors": errors, "label": select_settings(cube, "known", modes[-1])["label"].values[0]}


def _read_torsion(cube: xr.Dataset) -> dict[str, Any]:
    mode = int(cube["mode"].values[-1])
    std = select_settings(cube, "known", mode)["torsion_standard_error"].values[0]
    size = float(cube["torsion_reference"])
    return {"mode": mode, "size_um": 1e6 * size, "std_um": 1e6 * float(std)}


def _change_ratios(cube: xr.Dataset, quantities: tuple[str, ...]) -> list[tuple[str, float]]:
    """Return by case the last setting's error over the first's, median over modes and errors."""
    found = []
    for case in dict.fromkeys(cube["case"].values.tolist()):
        bands = [
            error_bars(cube, case, mode, quantity).band[1]
            for mode in cube["mode"].values.tolist()
            for quantity in quantities
        ]
        ratios = [band[-1] / band[0] for band in bands if np.isfinite(band).all()]
        found.append((case, float(np.median(ratios))))
    return found


def _symmetry_entry(cube: xr.Dataset) -> ledger.Entry:
    (entry,) = [e for e in ledger.from_cube(cube) if e.id == "ch3-concluding-t8"]
    return entry


PIECES: dict[str, Callable[[Cubes], str]] = {
    **{f"conclusions-{name}": partial(tabulate_factor, name) for name in factors.FACTORS},
    "conclusions-stated": tabulate_stated,
    "conclusions-counted": count_trends,
    "conclusions-sound": correlate_sound,
    "conclusions-small": tabulate_sound_errors,
    "conclusions-experiment": tabulate_experiment,
    "conclusions-costs": tabulate_costs,
    "conclusions-pixels": tabulate_equal_pixels,
    "conclusions-wishes": tabulate_wishes,
}
