"""Summaries of the chapters and of the whole book, with numbers from the cubes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.book.pieces import conclusions, factors
from thesis_lib.book.pieces.opened import Cubes, select_subject
from thesis_lib.facts import claims
from thesis_lib.figure_sets.parametric.sound import BEST_DEG, audible_planes, turn_advice
from thesis_lib.figure_sets.planner import figure_set, figures
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.laboratory import parameters, rig
from thesis_lib.ledger import entries as ledger, verdicts
from thesis_lib.plotting import selection
from thesis_lib.studies import cubes
from thesis_lib.templates import render
from thesis_lib.vision import cone_law, rounding

BODY_CHAPTERS = {"beam": "ch3", "plate": "ch4"}
FINDING_GROUPS = ("beam", "plate", "sound")


def describe_chapter(subject: str, opened: Cubes) -> str:
    """Describe the results of a chapter: changes, agreement, the law of rounding."""
    chapter = select_subject(opened, subject)
    changes = _compare_extremes(chapter)
    names = [cube.attrs["figure_set"] for cube in chapter]
    met = list(_check_claims(chapter))
    kinds = list(dict.fromkeys(kind for _, kind, _ in met))
    law = None
    if subject in ("beam", "plate"):
        squared = [cube["mean_error"].isel(trial=slice(1, None)) ** 2 for cube in chapter]
        std = 100 * np.concatenate([relative_rms_std(one) for one in squared])
        law = {
            "ratios": law_over_rms(chapter),
            "trials": squared[0].sizes["trial"],
            "median_std_percent": np.median(std),
            "max_std_percent": np.max(std),
        }
    scatters = []  # of centres, that would give the claimed value of the first setting
    for cube in chapter if subject == "experiment" else ():
        if claim := selection.claimed_errors(cube, "matched", 1)[0]:
            matched, fitted = (
                selection.select_settings(cube, method, 1).isel(setting=0)
                for method in ("matched", "literal")
            )
            wanted = fitted["centre_scatter"] * claim.high / fitted["predicted_error"]
            scatters.append((claim, matched, fitted, wanted))
    return render(
        __file__,
        "chapter",
        quantity="pressure of the plane" if "plane_error" in chapter[0] else "deflection",
        changes=changes,
        columns=list(changes[-1]["cells"]),
        kinds=kinds,
        agreement=[
            (STUDIES[name], [[i for n, k, i in met if (n, k) == (name, kind)] for kind in kinds])
            for name in names
        ],
        totals=[[inside for _, of, inside in met if of == kind] for kind in kinds],
        missed=[one for _, _, one in met] if subject == "beam" else None,
        law=law,
        scatters=scatters,
    )


def _compare_extremes(chapter: Sequence[xr.Dataset]) -> list[dict[str, Any]]:
    """Return the median errors of the first and the last setting of each case."""
    rows: list[dict[str, Any]] = []
    for cube in chapter:
        modes = cube["mode"].values.tolist()
        errors = [error for error in cubes.cube_errors(cube) if error != "max_point_error"]
        for case in selection.list_cases(cube):
            labels = selection.select_settings(cube, case, modes[0])["label"].values
            cells = {}
            for mode, error in product(modes, errors):
                bars = selection.error_bars(cube, case, mode, error)
                if not np.isnan(bars.literal).all():
                    title = f"mode {mode}" + (f", {bars.name}" if bars.name else "")
                    cells[title] = bars.band[1][[0, -1]]
            ends = [str(labels[i]).removesuffix(" cameras") for i in (0, -1)]
            varied = STUDIES[cube.attrs["figure_set"]].varied_label
            rows.append({"case": case, "varied": varied, "ends": ends, "cells": cells})
    rows.sort(key=lambda row: row["case"] if row["case"][0].isdigit() else "")  # others keep order
    return rows


def _check_claims(chapter: Sequence[xr.Dataset]) -> Iterator[tuple[str, str, bool]]:
    """Yield figure set and kind of error of each claimed value, and whether it is met."""
    for cube in chapter:
        name = cube.attrs["figure_set"]
        for check in verdicts.check_claims(cube, claims.claims_of(name)):
            yield name, cubes.SHORT_LABELS[check.claim.quantity], check.inside


def relative_rms_std(squared: xr.DataArray) -> Array:
    """Return the relative standard error of the rms over trials, from squared errors (…, trial)."""
    n = squared.sizes["trial"]
    return np.ravel(squared.std("trial", ddof=1) / squared.mean("trial") / (2 * np.sqrt(n)))


def describe_repeats(opened: Cubes) -> str:
    """Describe the replicates of recordings: number, scatter, and where the first one lies."""
    rows = []
    for study in (one for one in STUDIES.values() if issubclass(one, parameters.ReplicatedStudy)):
        error = opened[study.name]["mean_error"].transpose("trial", ...).values
        error = error[:, np.isfinite(error).all(axis=0)]
        first, others = error[0], error[1:]
        scatter = np.median(others.std(0) / others.mean(0))
        above, below = np.mean(first > others.max(0)), np.mean(first < others.min(0))
        rows.append((study, len(others), scatter, above, below))
    values = {"shift_mm": 1000 * rig.PLACE_STD_M, "turn_deg": np.degrees(rig.TURN_STD_RAD)}
    return render(__file__, "lab-repeats", rows=rows, **values)


def tabulate_sound_scatter(opened: Cubes) -> str:
    """Tabulate the scatter of the error from trial to trial, by mode and plane."""
    chapter = select_subject(opened, "sound")
    rows = []
    for mode, plane in audible_planes(chapter[0]):
        spread, law, known = [], [], []
        for cube in chapter:
            part = cube.sel(mode=mode, plane=plane)
            drawn = part["plane_error"].isel(trial=slice(1, None))
            low, high = drawn.quantile([0.05, 0.95], "trial").values
            spread += list(high / low)
            rms = selection.trial_rms(part["plane_error"])
            law += (part["predicted_error"] / rms).values.tolist()
            known += list(relative_rms_std(drawn**2))
        rows.append((mode, plane, np.median(spread), spread, law, np.median(known)))
    return render(__file__, "sound-scatter", rows=rows)


def tabulate_sound_layouts(opened: Cubes) -> str:
    """Tabulate κ, the rms field error over the rms deflection error, by camera layout."""
    chapter = select_subject(opened, "sound")
    pairs = audible_planes(chapter[0])
    free = [float(chapter[0]["independent_ratio"].sel(mode=m, plane=p)) for m, p in pairs]
    rows: list[dict[str, Any]] = []
    times: dict[float, list[float]] = {1.0: [], 0.0: []}  # by share of cameras square to the plate
    for cube in chapter:
        for case in selection.list_cases(cube):
            azimuth = selection.select_settings(cube, case, pairs[0][0])["camera_azimuth"].values
            off = np.abs((azimuth + 45) % 90 - 45)  # from a multiple of 90°
            square = np.nanmean(np.where(np.isnan(azimuth), np.nan, off < 1e-6), axis=1)
            cells = []
            for (mode, plane), alone in zip(pairs, free, strict=True):
                part = selection.select_settings(cube, case, mode).sel(plane=plane)
                rms = [selection.trial_rms(part[f"{of}_error"]) for of in ("plane", "deflection")]
                ratio = rms[0] / rms[1]
                cells.append(ratio.values[[0, -1]])
                for share, found in times.items():
                    found += (ratio.values[square == share] / alone).tolist()
            rows.append({"case": case, "square": square, "cells": cells})
    rows.sort(key=lambda row: [f"{row['square'][i]:4.0%}" for i in (0, -1)])
    square, oblique = ((np.median(found), min(found), max(found)) for found in times.values())
    values = {"pairs": pairs, "independent": free, "square": square, "oblique": oblique}
    return render(__file__, "sound-layouts", rows=rows, **values)


def error_shares(opened: Cubes, body: str) -> dict[str, dict[str, float]]:
    """Return by factor where a body's error should be largest and least, and the errors' ratio.

    `share` is the error at the best value over that at the worst, median over cases and modes.
    """
    found = {}
    for name, factor in factors.FACTORS.items():
        own = replace(factor, sources=tuple(one for one in factor.sources if one[0] == body))
        (one,) = factors.estimate_effects(opened, own)
        worst, best = one.ends
        found[name] = {"worst": worst, "best": best, "share": float(np.median(one.ratios))}
    return found


def law_over_rms(chapter: Sequence[xr.Dataset]) -> Array:
    """Return predicted error over the trials' rms of beam or plate, shape (settings × modes,)."""
    ratios = [cube["predicted_error"] / selection.trial_rms(cube["mean_error"]) for cube in chapter]
    return np.concatenate([ratio.values.ravel() for ratio in ratios])


def error_over_law(chapter: Sequence[xr.Dataset]) -> Array:
    """Return each random trial's error over its predicted error, in one dimension."""
    ratios = [cube["mean_error"][..., 1:] / cube["predicted_error"] for cube in chapter]
    return np.concatenate([ratio.values.ravel() for ratio in ratios])


def tabulate_scatter(opened: Cubes) -> str:
    """Tabulate the quantiles of the trials' errors over the predicted ones, for beam and plate."""
    rows = [
        (one, np.nanquantile(error_over_law(select_subject(opened, one)), [0.05, 0.5, 0.95]))
        for one in ("beam", "plate")
    ]
    return render(__file__, "rounding-scatter", rows=rows)


def describe_body(body: str, opened: Cubes) -> str:
    """Describe the effect of each factor on a body's error, and the accuracy of the prediction."""
    chapter = select_subject(opened, body)
    by, single = error_shares(opened, body), np.quantile(error_over_law(chapter), [0.05, 0.95])
    off_percent = 100 * np.max(np.abs(law_over_rms(chapter) - 1))
    return render(__file__, "body-result", by=by, law_off_percent=off_percent, single=single)


def describe_laboratory(opened: Cubes) -> str:
    """Describe the errors of the thesis's method and the best one, with all cameras and pixels."""
    cube = opened["experiment-resolution"]
    found = _check_claims(select_subject(opened, "experiment"))
    thesis, best = (
        _trial_median(selection.select_settings(cube, method, 1).isel(setting=-1)["mean_error"])
        for method in ("matched", "harmonic")
    )
    claim = selection.claimed_errors(cube, "matched", 1)[-1]
    met = [inside for _, kind, inside in found if kind == "mean"]
    return render(__file__, "laboratory-result", thesis=thesis, best=best, claim=claim, met=met)


def describe_sound(opened: Cubes) -> str:
    """Describe the errors of shape and sound, and the effect of turning two cameras."""
    arrays, aperture = opened["sound-arrays"], opened["sound-aperture"]
    ratios = [
        aperture["turned_coherence"].sel(mode=mode, plane=plane, drop=True)
        for mode, plane in audible_planes(aperture)
    ]
    ratio = xr.concat(ratios, "audible")
    turned = ratio.sel(turn=list(BEST_DEG))
    by_elevation = turned.median(["audible", "turn"])
    return render(
        __file__,
        "sound-result",
        shape=_trial_median(arrays["deflection_error"]),
        field=_trial_median(arrays["plane_error"]),
        square=float(ratio.sel(turn=0).median()),
        turned=float(turned.median()),
        highest=by_elevation.sortby(by_elevation)[-1],
        advice=turn_advice(aperture),
    )


def describe_shapes(opened: Cubes) -> str:
    """Describe the errors of the two other planar structures relative to the rectangle's."""
    whole = selection.trial_rms(opened["plate-arrays"]["mean_error"]).values
    rms = [selection.trial_rms(opened[name]["mean_error"]) for name in ("shape-l", "shape-holes")]
    ratios = np.ravel([np.median(own.values / whole, axis=0) for own in rms]).tolist()
    return render(__file__, "shapes-result", ratios=ratios)


def describe_planner(opened: Cubes) -> str:
    """Describe the gain of planning over the best of the thesis's layouts."""
    cube = opened["planner"]
    gains = {}
    for body, question in figure_set.THESIS_QUESTIONS.items():
        own = cube["thesis_expected"].sel(structure=body).min("thesis_case").values
        planned = figures.coarse_options(cube, question)["expected_error"].values
        gains[body] = 100 * (1 - planned[: len(own)] / own)
    counts, readable = cube["count"].values.astype(int), figures.with_readable(cube)
    return render(__file__, "planner-result", gains=gains, counts=counts, readable=readable)


def tabulate_advice(opened: Cubes) -> str:
    """Tabulate the effects and verdicts of the five pieces of advice."""
    rows = {
        factor.advice: {one.group: one for one in factors.estimate_effects(opened, factor)}
        for factor in factors.FACTORS.values()
    }
    return render(
        __file__, "conclusions-result", rows=rows, groups=FINDING_GROUPS, median=np.median
    )


def list_findings(opened: Cubes) -> str:
    """List the advice of the thesis with its verdicts, and the findings of the book."""
    entries = [entry for entry in ledger.from_cube(opened["claims"]) if entry.counted]
    ratios = law_over_rms([*select_subject(opened, "beam"), *select_subject(opened, "plate")])
    arrays, trends = opened["sound-arrays"], factors.sound_trends(opened)
    average_px = float(np.sqrt(rounding.mean_difference_variance(1, 0, 1)))
    left = {body: error_shares(opened, body) for body in BODY_CHAPTERS}
    parameter = {trend.id: trend.parameter for trend in claims.read_trends()}
    advice = []
    for name, factor in factors.FACTORS.items():
        judged = {  # by the ledger, for each body
            body: next(
                one
                for one in entries
                if one.id.startswith(f"{chapter}-concluding-")
                and parameter[one.id].startswith(factor.parameter)
            )
            for body, chapter in BODY_CHAPTERS.items()
        }
        advice.append((name, factor.advice, judged))
    return render(
        __file__,
        "home-findings",
        counted=len(entries),
        numbers=ledger.count_verdicts(entries),
        missed=[inside for _, _, inside in _check_claims(select_subject(opened, "beam"))],
        ratios=ratios,
        off=np.max(np.abs(ratios - 1)),
        advice=advice,
        left=left,
        average_px=average_px,
        rule=float(cone_law.cone_deflection_error(1, 1, 4, np.pi / 2)) / 2,
        pair=conclusions.equal_pixels()["ratio"].median(),
        shape=_trial_median(arrays["deflection_error"]),
        sound=_trial_median(arrays["plane_error"]),
        trends=trends,
    )


def _trial_median(errors: xr.DataArray) -> float:
    """Return the median over the random trials and all other dimensions."""
    return float(errors.isel(trial=slice(1, None)).median())


PIECES: dict[str, Callable[[Cubes], str]] = {
    # The end of each chapter: two or three sentences, or a table
    "beam-result": partial(describe_body, "beam"),
    "plate-result": partial(describe_body, "plate"),
    "laboratory-result": describe_laboratory,
    "sound-result": describe_sound,
    "shapes-result": describe_shapes,
    "planner-result": describe_planner,
    "conclusions-result": tabulate_advice,
    # Other sentences and tables
    "home-findings": list_findings,
    **{
        f"{subject}-results": partial(describe_chapter, subject)
        for subject in ("beam", "plate", "sound", "experiment")
    },
    "lab-repeats": describe_repeats,
    "sound-scatter": tabulate_sound_scatter,
    "rounding-scatter": tabulate_scatter,
    "sound-layouts": tabulate_sound_layouts,
}
