"""What chapters close with: two or three sentences of result, with numbers from the cubes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.book.conclusions.knobs import KNOBS
from thesis_lib.book.conclusions.strengths import Cubes, Strength, strengths
from thesis_lib.book.pieces.opened import of_subject
from thesis_lib.facts import claims
from thesis_lib.figure_sets.parametric.sound_turn import BEST_DEG, turn_advice
from thesis_lib.figure_sets.planner.parameters import THESIS
from thesis_lib.figure_sets.planner.tables import coarse, with_readable
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.ledger import verdicts
from thesis_lib.plotting.selection import select, stated
from thesis_lib.studies.cubes import percent_text
from thesis_lib.web.markdown import columns

GROUPS = ("beam", "plate", "sound")
_ADVICE = {
    "closer": "closer",
    "wider": "farther apart",
    "lower": "lower",
    "finer": "finer pixels",
    "more": "more cameras",
}


def changes(opened: Cubes, body: str) -> dict[str, tuple[str, str, str]]:
    """By knob: where a body's error is largest and smallest, and what is left of it there.

    A median over cases and modes.
    """
    own = {name: opened[name] for name, study in STUDIES.items() if study.subject == body}
    found = {name: strengths(own, knob)[0] for name, knob in KNOBS.items()}
    return {
        name: (f"{one.ends[0]:g}", f"{one.ends[1]:g}", f"{np.median(one.factors):.2f}")
        for name, one in found.items()
    }


def over_rms(opened: Cubes, body: str) -> Array:
    """Law over the trials' rms of every setting and mode of a body, shape (settings × modes,)."""
    ratios = [
        (cube["predicted_error"].transpose("setting", "mode").values / _rms(cube)).ravel()
        for cube in of_subject(opened, body)
    ]
    return np.concatenate(ratios)


def body(name: str, opened: Cubes) -> str:
    """What each thing that is varied does to the error of a body, and how well that is known."""
    by = changes(opened, name)

    def ends(knob: str, unit: str = "") -> str:
        worst, best, _ = by[knob]
        return f"{best}{unit} in place of {worst}"

    off = 100 * np.max(np.abs(over_rms(opened, name) - 1))
    single = [c["mean_error"][..., 1:] / c["predicted_error"] for c in of_subject(opened, name)]
    low, high = np.quantile(np.concatenate([one.values.ravel() for one in single]), [0.05, 0.95])
    return (
        f"Standing {ends('closer', ' mm')} away leaves {by['closer'][-1]} of the error, and "
        f"{ends('finer', ' pixels')} across leave {by['finer'][-1]} (medians over cases and "
        f"modes). Cameras {ends('lower', '°')} above the structure leave {by['lower'][-1]}, and "
        f"{ends('more', ' cameras')} leave {by['more'][-1]}. The aperture by itself helps little: "
        f"opened at one elevation, {ends('wider', '°')} leaves {by['wider'][-1]}. The law of "
        f"rounding gives every error without a simulation, to within {off:.0f} % of the expected "
        f"one. Nine single runs in ten come to between {low:.2f} and {high:.2f} times the law.\n"
    )


def missed(opened: Cubes) -> str:
    """Report how many claimed values of chapter 3 are missed, and that no reason was found."""
    met = [
        check.inside
        for cube in of_subject(opened, "beam")
        for check in verdicts.check(cube, claims.claims_of(cube.attrs["figure_set"]))
    ]
    return (
        f"Of chapter 3's {len(met)} values {met.count(False)} are missed, more than chance allows, "
        "[for no reason that was found](misses.md)."
    )


def laboratory(opened: Cubes) -> str:
    """The thesis's chain and the best one, with all cameras and pixels."""
    cube = opened["experiment-resolution"]
    thesis, best = (
        _median(select(cube, method, 1).isel(setting=-1)["mean_error"])
        for method in ("matched", "harmonic")
    )
    claim = stated(cube, "matched", 1)[-1]
    said = f"; the thesis states {claim.stated} of its own" if claim else ""
    return (
        "With four cameras the thesis's chain measures the rendered beam to "
        f"{percent_text(thesis)} % (median{said}). Fitted centres, true times and all "
        f"frames leave {percent_text(best)} %. First the template limits the chain, "
        "then the clocks; pixels and cameras count only once both are mended. "
        f"{_chapter_5(opened)}\n"
    )


def _chapter_5(opened: Cubes) -> str:
    """How many of the stated mean errors the rendered recordings meet."""
    checks = [
        one
        for cube in of_subject(opened, "experiment")
        for one in verdicts.check(cube, claims.claims_of(cube.attrs["figure_set"]))
        if one.claim.quantity == "mean_error"
    ]
    return (
        f"Of the {len(checks)} mean errors that the thesis states of its recordings, these meet "
        f"{sum(one.inside for one in checks)}."
    )


def sound(opened: Cubes) -> str:
    """Shape against sound, and what turning two cameras does."""
    arrays, turned = opened["sound-arrays"], opened["sound-aperture"]["turned_coherence"]
    shape, field = (_median(arrays[name]) for name in ("deflection_error", "plane_error"))
    square, askew = (float(turned.sel(turn=turn).median()) for turn in (0, list(BEST_DEG)))
    return (
        f"Arrays of cameras that measure the plate's shape to {percent_text(shape)} % know its "
        f"sound to {percent_text(field)} % (medians), because errors of many markers average out. "
        f"They do not where cameras stand square to the plate: two such cameras make {square:.1f} "
        f"times the error of independent markers, and {askew:.1f} times once turned by a few "
        f"degrees. {turn_advice(opened['sound-aperture'])} The thesis saw no trend because one run "
        "is one draw; in expectation nearer, lower, finer and more help the sound as they help the "
        "shape.\n"
    )


def shapes(opened: Cubes) -> str:
    """How far the two shapes are from the rectangle."""
    whole = _rms(opened["plate-arrays"])
    ratios = [
        float(ratio)
        for name in ("shape-l", "shape-holes")
        for ratio in np.median(_rms(opened[name]) / whole, axis=0)
    ]
    return (
        "The same cameras measure the L and the plate with holes to "
        f"{min(ratios):.2f} to {max(ratios):.2f} times the rectangle's error, by mode. The law of "
        "rounding foretells which. Symmetry changes only how far a single run, with all pixel "
        "grids in line, may lie from the expectation.\n"
    )


def planner(opened: Cubes) -> str:
    """What planning gains over the best of the thesis's layouts, with few cameras and with many."""
    cube = opened["planner"]
    gains = {}
    for body, question in THESIS.items():
        own = cube["thesis_expected"].sel(structure=body).min("thesis_case").values
        planned = coarse(cube, question)["expected_error"].values
        gains[body] = 100 * (1 - planned[: len(own)] / own)
    said = " and ".join(
        f"{here[0]:.0f} % with {int(cube['count'][0])} cameras and {here[-1]:.0f} % with "
        f"{int(cube['count'][-1])} for the {body}"
        for body, here in gains.items()
    )
    return (
        f"With markers that are read from any side, as in the thesis, planned layouts have less "
        f"error than the best of the thesis's: by {said}. So the thesis's best layouts are near "
        f"what is possible. {with_readable(cube)}\nEach limit on places has its price, and a plan "
        "that cannot be names the limit that binds.\n"
    )


def conclusions(opened: Cubes) -> str:
    """The five pieces of advice, in one table: what they bring, and whether they hold."""
    rows = []
    for name, words in _ADVICE.items():
        by = {one.group: one for one in strengths(opened, KNOBS[name])}
        cells = {group: _held(by[group]) for group in GROUPS if group in by}
        rows.append({"advice": words} | cells)
    return columns(rows) + (
        "\nError at the good end of the range over that at the bad end, in simulation: median "
        "over cases, modes and planes; in brackets, in how many of them the advice holds.\n"
    )


def _held(one: Strength) -> str:
    return f"×{np.median(one.factors):.2f} ({one.confident} of {len(one.factors)})"


def _median(errors: xr.DataArray) -> float:
    """Median over the random trials, and all else."""
    return float(errors.isel(trial=slice(1, None)).median())


def _rms(cube: xr.Dataset) -> Array:
    """Rms error over the random trials, shape (settings, modes)."""
    squared = cube["mean_error"].isel(trial=slice(1, None)) ** 2
    rms: Array = np.sqrt(squared.mean("trial").transpose("setting", "mode").values)
    return rms


PIECES: dict[str, Callable[[Cubes], str]] = {
    "beam-result": partial(body, "beam"),
    "plate-result": partial(body, "plate"),
    "laboratory-result": laboratory,
    "sound-result": sound,
    "shapes-result": shapes,
    "planner-result": planner,
    "conclusions-result": conclusions,
}
