"""What the page on chapter 7 includes: its conclusions as tables, from the cubes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.stats import spearmanr

from thesis_lib.book.conclusions.knobs import KNOBS
from thesis_lib.book.conclusions.pixels import pixels
from thesis_lib.book.conclusions.strengths import (
    Cubes,
    Strength,
    curves,
    exponent,
    shape_and_sound,
    signed,
    spread,
    step,
    strengths,
)
from thesis_lib.book.conclusions.wishes import fulfilled
from thesis_lib.facts.claims import read_trends
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.ledger import entries as ledger
from thesis_lib.ledger.entries import from_cube
from thesis_lib.ledger.verdicts import UNCHANGED, VERDICTS
from thesis_lib.plotting.selection import error_bars, select, stated
from thesis_lib.studies.cubes import percent_text
from thesis_lib.vision.cone_law import MAX_MOTION_FRACTION, pair_noise_error
from thesis_lib.web.markdown import columns, table

# Numbers of one cell stay on one line.
TOGETHER = str.maketrans({" ": "\N{NO-BREAK SPACE}", "–": "\N{WORD JOINER}–\N{WORD JOINER}"})
TURNED = {  # what the ledger calls the parameter of a trend, and what this page calls it
    "closer": "distance d",
    "wider": "aperture alpha",
    "lower": "elevation phi",
    "finer": "resolution",
    "more": "number of cameras",
}
LEVEL = ("flat", "within", "no trend", "at most", "below")  # of trends that state no change
WORDS = {
    "closer": "closer",
    "wider": "wider apart",
    "lower": "lower",
    "finer": "finer pixels",
    "more": "more cameras",
}


def _knob(name: str, opened: Cubes) -> str:
    """How strongly one of the five conclusions holds, group by group."""
    knob = KNOBS[name]
    rows = []
    for one in strengths(opened, knob):
        others = {
            "opposite": one.opposite,
            UNCHANGED: one.unchanged,
            "not monotonic": one.not_monotonic,
        }
        said = ", ".join(f"{number} {word}" for word, number in others.items() if number)
        against = f" ({said})" if said else ""
        row = {
            "error of": one.group,
            knob.label: f"{one.ends[0]:g} → {one.ends[1]:g}",
            "error changes by": f"×{spread(one.factors)}",
            "as stated": f"×{spread(one.stated)}" if one.stated.size else "—",
            f"exponent of {knob.symbol}": spread(one.exponents),
            "by the law": signed(float(np.median(one.predicted))),
        }
        row = {header: cell.translate(TOGETHER) for header, cell in row.items()}
        holds = f"{one.confident} of {len(one.factors)}{against}"
        rows.append(row | {"holds in": holds, "single runs": f"{one.single:.0%}"})
    more = {"lower": _optimum, "wider": _pair}
    return columns(rows) + (more[name](opened) if name in more else "")


def _pair(opened: Cubes) -> str:
    """What a pair gives at the centre: to noise in all its coordinates, and to whole pixels."""
    at: dict[float, float] = {}
    for curve in curves(opened, KNOBS["wider"]):
        angles = np.radians(curve.values), np.radians(curve.elevation)
        at[curve.elevation] = step(pair_noise_error(1, 1, *angles), 1)
    words = [f"×{at[elevation]:.2f} at {elevation:g}°" for elevation in sorted(at)]
    return (
        f"\nAt the centre, for motions up to {100 * MAX_MOTION_FRACTION:g} % of the distance, one "
        "expects of noise, {eq}`eq-pair-noise`, by the elevation, "
        f"{', '.join(words)}; and of whole pixels, {{eq}}`eq-pair-rounded`, no change.\n"
        if words
        else ""
    )


def _optimum(opened: Cubes) -> str:
    """How low is too low, in the laboratory."""
    name, case = "lab-elevation", "three-rows"
    if name not in opened:
        return ""
    part = select(opened[name], case, 1)
    elevations = part["value"].values
    error = error_bars(opened[name], case, 1).band[1]
    best, steep = int(np.nanargmin(error)), int(np.argmax(elevations))
    low = int(np.flatnonzero(np.isfinite(error))[0])
    lost = " and ".join(f"{value:g}°" for value in elevations[np.isnan(error)]) or "no elevation"
    return (
        f"\nThe rendered beam has its least error at {elevations[best]:g}°: "
        f"×{error[best] / error[steep]:.2f} of that at {elevations[steep]:g}°. At "
        f"{elevations[low]:g}° it is {error[low] / error[best]:.0f} times the least, and at {lost} "
        "there is no result.\n"
    )


def _stated(opened: Cubes) -> str:
    """Return every sentence of the thesis's conclusions, as the ledger judges it."""
    rows = [
        [
            str(entry.chapter),
            entry.what,
            entry.verdict + (f", not monotonic: {entry.step_back}" if entry.step_back else ""),
            *(f"{v:.0%}" if np.isfinite(v) else "—" for v in (entry.confidence, entry.single)),
        ]
        for entry in from_cube(opened["claims"])
        if entry.kind == "trend" and "-concluding-" in entry.id
    ]
    return table(["chapter", "what is concluded", "verdict", "confidence", "single runs"], rows)


def _counted(opened: Cubes) -> str:
    """All trends that the thesis states of each knob, by the verdict of the ledger."""
    entries = {e.id: e for e in from_cube(opened["claims"]) if e.kind == "trend"}
    parameter = {trend.id: trend.parameter for trend in read_trends()}
    parts = {
        WORDS[name]: [e for id, e in entries.items() if parameter.get(id, "").startswith(start)]
        for name, start in TURNED.items()
    }
    used = {e.id for part in parts.values() for e in part}
    parts["anything else"] = [e for id, e in entries.items() if id not in used]
    parts["in all"] = list(entries.values())
    rows = [
        [f"{len(part)} on {name}" if name != "in all" else f"**{len(part)} in all**"]
        + [str(number) for number in ledger.totals(part).values()]
        for name, part in parts.items()
    ]
    wider = parts[WORDS["wider"]]
    level = sum(e.verdict == "agrees" and e.stated in LEVEL for e in wider)
    differing = [e for e in entries.values() if e.verdict == "differs"]
    of_sound = sum(e.chapter == 6 for e in differing)
    apart = [e for e in entries.values() if not e.counted]
    agree, there = (
        sum(e.verdict == "agrees" for e in some)
        for some in (entries.values(), (e for e in entries.values() if e.counted))
    )
    return table(["trends that the thesis states", *VERDICTS], rows) + (
        f"\nOf the {len(differing)} that differ, {of_sound} are of chapter 6. Rendered recordings "
        f"judge {len(apart)}: so {agree} agree here, and {there} in the ledger's totals. A trend "
        "that agrees may state that an error hardly changes, or stays within bounds: of those on "
        f"*{WORDS['wider']}* that agree, {level} do.\n"
    )


def _sound(opened: Cubes) -> str:
    """Whether the error of the field follows that of the deflection, in expectation and by draw."""
    rows = []
    for study, pairs in shape_and_sound(opened):
        orders, slopes, draws = [], [], []
        for shape, field in pairs:
            expected = [np.sqrt(np.mean(errors**2, axis=1)) for errors in (shape, field)]
            orders.append(float(spearmanr(*expected).statistic))
            slopes.append(exponent(*expected))
            draws += [
                float(spearmanr(a, b).statistic) for a, b in zip(shape.T, field.T, strict=True)
            ]
        rows.append(
            {
                "varied": STUDIES[f"sound-{study}"].varied_label,
                "settings": str(len(pairs[0][0])),
                "rank correlation, expected": spread(orders),
                "of one run (median)": signed(float(np.median(draws))),
                "runs in which it is positive": f"{np.mean(np.array(draws) > 0):.0%}",
                "exponent of the deflection's error": spread(slopes),
            }
        )
    held, of = sound_trends(opened)
    apart, of_apart = sound_trends(opened, "wider")
    return columns(rows) + (
        f"\nOver distance, elevation, resolution and number, {held} of {of} curves of the sound's "
        "error (one for each case, mode and plane) fall towards the good end by more than a tenth, "
        f"with 95 % confidence. Over the aperture alone {apart} of {of_apart} do.\n"
    )


def sound_trends(opened: Cubes, *knobs: str) -> tuple[int, int]:
    """Count the simulated curves of the sound's error that fall as the shape's do, and all curves.

    Over some knobs; if none is named, over all but the aperture.
    """
    found = [
        one
        for name in knobs or [name for name in KNOBS if name != "wider"]
        for one in strengths(opened, KNOBS[name])
        if one.group == "sound"
    ]
    return sum(one.confident for one in found), sum(len(one.factors) for one in found)


def _small(opened: Cubes) -> str:
    """How large the errors of the sound are, by study: largest 95 % quantile, and median."""
    rows = []
    for study in ("distance", "aperture", "resolution", "arrays"):
        try:
            cube = opened[f"sound-{study}"]
        except KeyError:
            continue
        drawn = cube["plane_error"].isel(trial=slice(1, None))
        every = drawn.values[np.isfinite(drawn.values)]
        worst = np.nanmax(np.quantile(drawn.transpose("trial", ...).values, 0.95, axis=0))
        shape = cube["deflection_error"].isel(trial=slice(1, None))
        rows.append(
            {
                "varied": STUDIES[f"sound-{study}"].varied_label,
                "deflection: median, %": percent_text(float(shape.median())),
                "sound: median, %": percent_text(float(np.median(every))),
                "sound: largest 95 % quantile, %": percent_text(float(worst)),
                "runs below 10 %": f"{np.mean(every < 10):.1%}",
            }
        )
    return columns(rows)


def _experiment(opened: Cubes) -> str:
    """What the thesis's experiment confirms, by the way in which centres are found and read."""
    rows = []
    for name, knob in (("experiment-resolution", "finer"), ("experiment-cameras", "more")):
        try:
            cube = opened[name]
        except KeyError:
            continue
        claim = stated(cube, "matched", 1)
        for case in dict.fromkeys(cube["case"].values.tolist()):
            if case.endswith("-all"):  # sets of cameras that do not grow
                continue
            one = _of_case(opened, name, case, knob)
            part = select(cube, case, 1)
            drawn = part["mean_error"].transpose("setting", "trial").values[:, 1:]
            first, last = np.median(drawn, axis=1)[[0, -1]]
            given = [c.stated if c and case == "matched" else "" for c in (claim[0], claim[-1])]
            labels = part["label"].values
            best = labels[int(np.argmin(np.mean(drawn**2, axis=1)))]
            rows.append(
                {
                    "conclusion": WORDS[knob],
                    "chain": case,
                    "from → to": f"{labels[0]} → {labels[-1]}",
                    "median error, %": f"{percent_text(first)} → {percent_text(last)}",
                    "error changes by": f"×{one.factors[0]:.2f}",
                    "as stated": " → ".join(given) if all(given) else "—",
                    "single runs": f"{one.single:.0%}",
                    "holds": _held(one, best),
                }
            )
    return columns(rows) + (
        "\nMedians over many recordings. [The experiment's page](laboratory.md) shows the first "
        "recording, too, whose errors differ.\n"
    )


def _held(one: Strength, best: str) -> str:
    """Return whether a conclusion holds in the one curve there is, least at `best`."""
    found = {
        f"not monotonic, best at {best}": one.not_monotonic,
        "yes": one.confident,
        "the opposite": one.opposite,
        UNCHANGED: one.unchanged,
    }
    return next((word for word, number in found.items() if number), "not told apart")


def _of_case(opened: Cubes, name: str, case: str, knob: str) -> Strength:
    """One case of chapter 5 over its own knob."""
    alone = replace(KNOBS[knob], sources=((case, name, (case,), ("mean_error",)),))
    return strengths(opened, alone)[0]


def _costs(opened: Cubes) -> str:
    """What half the error costs, by the exponents of the simulated beam and plate."""
    rows = []
    data: Mapping[str, Callable[[float], str]] = {
        "closer": lambda factor: "as much",
        "finer": lambda factor: f"×{factor**2:.1f}",
        "more": lambda factor: f"×{factor:.1f}",
    }
    for name, knob in KNOBS.items():
        both = {one.group: one for one in strengths(opened, knob) if one.group in ("beam", "plate")}
        for group, one in both.items():
            best = float(np.median(one.factors))
            if name in data:
                factor = 2 ** (-1 / float(np.median(one.exponents)))
                half, much = f"{knob.symbol} ×{factor:.2f}", data[name](factor)
            else:
                half = f"within the range (×{best:.2f})" if best <= 0.5 else "not in the range"
                much = "as much"
            rows.append(
                {
                    "what is turned": WORDS[name],
                    "error of": group,
                    "half the error": half,
                    "pixels to store": much,
                    "range of the thesis": f"{one.ends[0]:g} → {one.ends[1]:g}",
                    "error changes by": f"×{best:.2f}",
                    "markers in view": _in_view(opened, f"{group}-", name),
                }
            )
    return columns(rows)


def _in_view(opened: Cubes, subject: str, name: str) -> str:
    """Least share of marker images on the sensor, in the settings at the best end of a knob."""
    shares = []
    for _, figure_set, cases, _ in KNOBS[name].sources:
        if figure_set.startswith(subject) and figure_set in opened:
            cube = opened[figure_set]
            for case in cases or tuple(dict.fromkeys(cube["case"].values.tolist())):
                part = cube.isel(setting=np.flatnonzero(cube["case"].values == case))
                best = 0 if name == "closer" else -1
                shares.append(float(part["in_view"].values[np.argsort(part["value"].values)[best]]))
    return f"{min(shares):.0%}" if shares else "—"


PIECES: dict[str, Callable[[Cubes], str]] = {
    **{f"conclusions-{name}": partial(_knob, name) for name in KNOBS},
    "conclusions-stated": _stated,
    "conclusions-counted": _counted,
    "conclusions-sound": _sound,
    "conclusions-small": _small,
    "conclusions-experiment": _experiment,
    "conclusions-costs": _costs,
    "conclusions-pixels": lambda _: pixels(),
    "conclusions-wishes": fulfilled,
}
