"""The numbers that the book's prose includes: computed from the cubes and the library."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.book.conclusions.strengths import Cubes
from thesis_lib.book.pieces.opened import Opened, of_subject
from thesis_lib.book.pieces.results import missed
from thesis_lib.facts import claims
from thesis_lib.figure_sets.parametric.sound_sum import heard
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES
from thesis_lib.figure_sets.repeated import FEW
from thesis_lib.laboratory.another import SHIFT, TURN
from thesis_lib.ledger import verdicts
from thesis_lib.plotting.selection import error_bars, select, stated
from thesis_lib.studies import cubes
from thesis_lib.web.markdown import columns, table


def _chapter(opened: Cubes, subject: str) -> list[xr.Dataset]:
    if isinstance(opened, Opened):
        opened.wanted |= {name for name in opened.without if STUDIES[name].subject == subject}
    return of_subject(opened, subject)


def beam_results(opened: Cubes) -> str:
    """What comes out for the beam: changes, agreement, the law of rounding."""
    chapter = _chapter(opened, "beam")
    unexplained = missed(opened) + "\n"
    return "\n".join([_changes(chapter), _agreement(chapter), unexplained, _law(chapter)])


def plate_results(opened: Cubes) -> str:
    """What comes out for the plate: changes, agreement, the law of rounding."""
    chapter = _chapter(opened, "plate")
    return "\n".join([_changes(chapter), _agreement(chapter), _law(chapter)])


def sound_results(opened: Cubes) -> str:
    """What comes out for the sound: changes and agreement."""
    return "\n".join([_changes(_chapter(opened, "sound")), _agreement(_chapter(opened, "sound"))])


def experiment_results(opened: Cubes) -> str:
    """What comes out of the experiment, and what would explain its scatter."""
    chapter = _chapter(opened, "experiment")
    return "\n".join([_changes(chapter), _agreement(chapter), *map(_explaining_scatter, chapter)])


def _explaining_scatter(cube: xr.Dataset) -> str:
    """How inexact centres would have to be to give what the thesis states of the first setting."""
    by = {m: select(cube, m, 1).isel(setting=0) for m in ("matched", "literal")}
    claim = stated(cube, "matched", 1)[0]
    if claim is None:
        return ""
    scatter = {method: float(part["centre_scatter"]) for method, part in by.items()}
    wanted = scatter["literal"] * claim.high / float(by["literal"]["predicted_error"])
    return (
        f"Centres that scatter, each by itself, by {wanted:.2f} px would give the {claim.stated} "
        f"stated of {by['literal']['label'].item()}. Matched ones scatter by "
        f"{scatter['matched']:.2f} px, fitted ones by {scatter['literal']:.3f} px.\n"
    )


def repeats(opened: Cubes) -> str:
    """Whether bands are over other recordings, how many, and how far the first is from these."""
    rows, drawn = [], []
    for name in (one for one, figure_set in FIGURE_SETS.items() if figure_set.others):
        cube = opened[name]
        error = cube["mean_error"].transpose("trial", ...).values
        if not cube.attrs["draws"].endswith("recordings"):
            drawn.append(f"[{STUDIES[name].title}](executed/{name}.ipynb)")
            continue
        error = error[:, np.isfinite(error).all(axis=0)]
        first, others = error[0], error[1:]
        rows.append(
            {
                "figure set": f"[{STUDIES[name].title}](executed/{name}.ipynb)",
                "other recordings": str(len(others)),
                "scatter of the error": f"{np.median(others.std(0) / others.mean(0)):.0%}",
                "the first is above all": f"{np.mean(first > others.max(0)):.0%}",
                "below all": f"{np.mean(first < others.min(0)):.0%}",
            }
        )
    text = ""
    if rows:
        text = columns(rows) + (
            "\nTrials, and with them bands and verdicts, are *other recordings* here: each camera "
            f"put up again, to {1000 * SHIFT:g} mm and {np.degrees(TURN):g}°, with other starts "
            "and other noise, rendered and measured in the same way. *Scatter*: standard deviation "
            "of the rms error between recordings over its mean, median of all settings and "
            "modes; then the share of these in which the first recording errs most or least.\n"
        )
    if drawn:
        text += (
            f"\nOf {', '.join(drawn)} fewer than {FEW} other recordings are data: there trials "
            "draw starts, clocks and noise on the tracks of the one recording.\n"
        )
    return text


def _changes(chapter: Sequence[xr.Dataset]) -> str:
    """First and last setting of each case in expectation."""
    rows, header = [], ["case", "varied", "from → to"]
    columns: list[str] = []
    for cube in chapter:
        for case in dict.fromkeys(cube["case"].values.tolist()):
            modes = cube["mode"].values.tolist()
            labels = select(cube, case, modes[0])["label"].values
            cells = {}
            for mode in modes:
                for error in cubes.errors(cube):
                    bars = error_bars(cube, case, mode, error)
                    if error == "max_point_error" or np.isnan(bars.literal).all():
                        continue
                    first, last = bars.band[1][0], bars.band[1][-1]
                    title = f"mode {mode}" + (f", {bars.name}" if bars.name else "")
                    text = cubes.percent_text
                    cells[title] = f"{text(first)} → {text(last)} (×{last / first:.2f})"
            columns = list(cells)
            varied = STUDIES[cube.attrs["figure_set"]].varied_label
            ends = " → ".join(str(labels[i]).removesuffix(" cameras") for i in (0, -1))
            rows.append([case, varied, ends, *cells.values()])
    rows.sort(key=lambda row: row[0] if row[0][0].isdigit() else "")  # others stay as they are
    what = "pressure of the plane" if "plane_error" in chapter[0] else "deflection"
    return (
        "From the first setting of each case to the last: the median over the trials of the mean "
        f"(rms) error, in % of the largest reference {what}, and its change.\n\n"
    ) + table([*header, *columns], rows)


def _agreement(chapter: Sequence[xr.Dataset]) -> str:
    """How many of the stated values are met, by figure set and kind of error."""
    kinds: dict[str, dict[str, list[bool]]] = {}
    for cube in chapter:
        name = cube.attrs["figure_set"]
        for check in verdicts.check(cube, claims.claims_of(name)):
            kind = cubes.SHORT[check.claim.quantity]
            kinds.setdefault(kind, {}).setdefault(name, []).append(check.inside)
    names = [cube.attrs["figure_set"] for cube in chapter]
    rows = [
        [f"[{STUDIES[name].title}](executed/{name}.ipynb)"]
        + [f"{sum(met.get(name, []))} of {len(met.get(name, []))}" for met in kinds.values()]
        for name in names
    ]
    total = ["**the chapter**"]
    for met in kinds.values():
        every = [inside for checks in met.values() for inside in checks]
        total.append(f"**{sum(every)} of {len(every)}** ({np.mean(every):.0%})")
    words = {"mean": "mean errors", "peak": "peak errors"}
    return "How many of the values that the thesis states are met:\n\n" + table(
        ["figure set", *(words.get(kind, f"errors on {kind}") for kind in kinds)], [*rows, total]
    )


def _law(chapter: Sequence[xr.Dataset]) -> str:
    """The law of rounding against the rms over the trials."""
    ratios, uncertainty = [], []
    for cube in chapter:
        squared = cube["mean_error"].isel(trial=slice(1, None)) ** 2
        ratios.append((cube["predicted_error"] / np.sqrt(squared.mean("trial"))).values)
        uncertainty.append(_standard_error(squared))
    flat = np.concatenate([ratio.ravel() for ratio in ratios])
    trials = chapter[0].sizes["trial"] - 1
    return (
        f"\nOver the {flat.size} settings and modes the law's prediction divided by the rms over "
        f"{trials} trials lies between {flat.min():.3f} and {flat.max():.3f}. The rms of so few "
        "trials is itself uncertain: its standard error is "
        f"{100 * np.median(np.concatenate(uncertainty)):.1f} % in the median and "
        f"{100 * np.max(np.concatenate(uncertainty)):.1f} % at worst.\n"
    )


def _standard_error(squared: xr.DataArray) -> Array:
    """Relative standard error of the rms over the trials, from squared errors (…, trial)."""
    n = squared.sizes["trial"]
    return np.ravel(squared.std("trial", ddof=1) / squared.mean("trial") / (2 * np.sqrt(n)))


def scatter_table(opened: Cubes) -> str:
    """How far one rounding scatters, by mode and plane."""
    chapter = _chapter(opened, "sound")
    rows = []
    for mode, plane in heard(chapter[0]):
        spread, law, known = [], [], []
        for cube in chapter:
            part = cube.sel(mode=mode, plane=plane)
            drawn = part["plane_error"].transpose("setting", "trial")[:, 1:]
            low, high = np.quantile(drawn.values, [0.05, 0.95], axis=1)
            spread += list(high / low)
            law += list(part["predicted_error"].values / np.sqrt(np.mean(drawn.values**2, axis=1)))
            known += list(_standard_error(drawn**2))
        widest = f"{np.median(spread):.1f} ({min(spread):.1f}–{max(spread):.1f})"
        rows.append(
            {
                "mode, plane": f"{mode}, {plane}",
                "95 % over 5 % of the trials": widest,
                "law over rms of the trials": f"{min(law):.2f}–{max(law):.2f}",
                "standard error of that rms": f"{100 * np.median(known):.0f} %",
            }
        )
    return columns(rows) + "\nMedians and ranges over all settings of the chapter.\n"


def layouts(opened: Cubes) -> str:
    """Rms field error over rms deflection error, by case: what the layout does to κ."""
    chapter = _chapter(opened, "sound")
    pairs = heard(chapter[0])
    free = [float(chapter[0]["independent_ratio"].sel(mode=m, plane=p)) for m, p in pairs]
    rows = []
    times: dict[float, list[float]] = {1.0: [], 0.0: []}  # by the share that stands square
    for cube in chapter:
        for case in dict.fromkeys(cube["case"].values.tolist()):
            square = _square_to_the_plate(select(cube, case, pairs[0][0]))
            cells = []
            for (mode, plane), alone in zip(pairs, free, strict=True):
                part = select(cube, case, mode)
                field = part["plane_error"].sel(plane=plane).transpose("setting", "trial").values
                shape = part["deflection_error"].transpose("setting", "trial").values
                ratio = np.sqrt(np.mean(field[:, 1:] ** 2, 1) / np.mean(shape[:, 1:] ** 2, 1))
                cells.append(f"{ratio[0]:.2f} → {ratio[-1]:.2f}")
                for share, found in times.items():
                    found += (ratio[square == share] / alone).tolist()
            rows.append([case, f"{square[0]:.0%} → {square[-1]:.0%}", *cells])
    independent = ["", "independent errors", *(f"{one:.2f}" for one in free)]
    rows = [independent, *sorted(rows, key=lambda row: (len(row[1]), row[1]))]
    header = ["case", "square to the plate", *(f"mode {m}, {p}" for m, p in pairs)]
    said = (
        f"×{np.median(found):.1f} (×{min(found):.1f} to ×{max(found):.1f}) where {words}"
        for found, words in zip(times.values(), ("all cameras do", "none does"), strict=True)
    )
    return table(header, rows) + (
        "\nFirst setting → last setting of each case, from the rms over the trials. Over that of "
        "independent errors, median and range over all settings, modes and planes, by whether "
        f"cameras stand square: {', '.join(said)}.\n"
    )


def _square_to_the_plate(part: xr.Dataset) -> Array:
    """Share of each setting's cameras whose azimuth is a multiple of 90°."""
    azimuth = part["camera_azimuth"].values
    off = np.abs((azimuth + 45) % 90 - 45)
    return np.nanmean(np.where(np.isnan(azimuth), np.nan, off < 1e-6), axis=1)
