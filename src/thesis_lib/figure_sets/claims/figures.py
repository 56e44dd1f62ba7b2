"""Figures and tables of the ledger: claimed against computed values, chapter by chapter."""

from collections.abc import Callable, Mapping
from itertools import product
from typing import Any

import anywidget
import numpy as np
import scipy
import traitlets
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from thesis_lib.facts.setups import READINGS
from thesis_lib.figure_sets.claims.compute import format_command
from thesis_lib.ledger import entries as ledger, trends, verdicts
from thesis_lib.plotting import style
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.web.html import COLOURS_CSS, copy_plain, join_modules, read_asset, static_html

VERDICT_MARKS = {  # verdict: colour and shape, so that colour is not the only cue
    "agrees": (style.BLUE, "o"),
    "within scatter": (style.SKY, "D"),
    "differs": (style.RED, "^"),
}


def chapter(cube: xr.Dataset, number: int) -> Figure:
    """Plot claimed against reproduced errors of a chapter, and their ratios."""
    every = [e for e in ledger.from_cube(cube) if e.kind == "figure" and e.chapter == number]
    part = [e for e in every if np.isfinite([e.least, e.most, e.median]).all()]
    bounds = sum(not np.isfinite([e.least, e.most]).all() for e in every)
    drawing, (left, right) = style.subplots(1, 2, figsize=(7.6, 3.6))
    ends = [e.least for e in part] + [e.most for e in part] + [e.high for e in part]
    span = np.array([0.7 * min(*ends, *(e.low for e in part)), 1.4 * max(ends)])
    left.plot(span, span, color=style.REFERENCE_COLOR, lw=1, zorder=1)
    for verdict, (color, shape) in VERDICT_MARKS.items():
        chosen = [(e.least, e.most, e.low, e.median, e.high) for e in part if e.verdict == verdict]
        if not chosen:
            continue
        least, most, low, median, high = np.array(chosen).T
        stated = np.sqrt(least * most)
        reach, band = (stated - least, most - stated), (median - low, high - median)
        look: Any = {"ls": "none", "marker": shape, "ms": 4, "color": color, "elinewidth": 0.6}
        left.errorbar(stated, median, band, reach, label=f"{verdict} ({len(chosen)})", **look)
    left.set(xscale="log", yscale="log", xlim=span, ylim=span, aspect="equal")
    left.set(xlabel="claimed, %", ylabel="this book, %")
    left.set_title("(a) claimed against median and 5–95 % band")
    for axis in (left.xaxis, left.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    title = f"without {bounds} bounds" if bounds else None
    left.legend(loc="upper left", title=title, title_fontsize="small")
    ratios = np.log2([e.median / np.sqrt(e.least * e.most) for e in part])
    words, middle = np.array([e.verdict for e in part]), float(np.median(ratios))
    edge = max(1.0, np.ceil(4 * np.abs(ratios).max()) / 4)
    bins = np.arange(-edge, edge + 0.01, 0.25).tolist()
    stacks = [ratios[words == verdict] for verdict in VERDICT_MARKS]
    colors = [color for color, _ in VERDICT_MARKS.values()]
    right.hist(stacks, bins=bins, stacked=True, label=list(VERDICT_MARKS), color=colors)
    ticks = np.arange(-np.floor(edge), np.floor(edge) + 1)
    right.set_xticks(ticks, [f"{2.0**tick:g}" for tick in ticks])
    right.axvline(0, color=style.REFERENCE_COLOR, lw=1)
    right.axvline(middle, color=style.BLACK_COLOR, lw=1, ls="--")
    where: Any = {"ha": "right", "va": "top", "transform": right.transAxes, "fontsize": 8}
    right.text(0.98, 0.96, f"median ratio {2**middle:.2f}", **where)
    right.yaxis.set_major_locator(MaxNLocator(integer=True))
    right.set(title="(b) median over claimed", xlabel="ratio", ylabel="claimed values")
    return drawing


def readings(cube: xr.Dataset) -> Figure:
    """Draw the number of claimed values that each interpretation meets, by chapter."""
    names, inside = cube["reading"].values, cube["reading_inside"].values
    total = int(cube["reading_claims"].isel(reading=0).sum())
    drawing, axes = style.subplots(figsize=(7.6, 0.5 + 0.22 * len(names)))
    place, left = np.arange(len(names))[::-1], np.zeros(len(names))
    for number, color, part in zip((3, 4, 6), style.CYCLE_COLORS, inside.T, strict=False):
        axes.barh(place, part, 0.75, left, color=color, label=f"chapter {number}")
        left += part
    axes.axvline(left[0], color=style.BLACK_COLOR, lw=0.8, ls="--")
    axes.set_yticks(place, names, fontsize=8)
    axes.set(xlim=(0, total), xlabel=f"claimed values met, of {total}")
    axes.grid(visible=False, axis="y")
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.4, 1.0), ncols=3, bbox_transform=drawing.transFigure
    )
    return drawing


_LEDGER_SCRIPT = join_modules("ledger")
_LEDGER_STYLE = COLOURS_CSS + read_asset("ledger.css")
NO_SCRIPT_TEXT = "This table needs JavaScript; `thesis claims` prints the same."
_VERDICT_ORDER = ("differs", "undefined", verdicts.UNCHANGED, "within scatter", "agrees")


class LedgerTable(anywidget.AnyWidget):
    """A table of claims with their verdicts.

    The reader filters by chapter, case, mode, verdict and kind, searches and sorts. On a page
    without a kernel the filters are in the URL, as in ``claims.html?chapter=3&mode=1``, and
    ``claims.html#claim-ID`` shows and highlights one claim regardless of the filters.

    Parameters
    ----------
    data : dict
        ``{"rows": [row, …]}``: one :attr:`thesis_lib.ledger.entries.Entry.row` per claim in the
        order to show.
    """

    _esm = _LEDGER_SCRIPT
    _css = _LEDGER_STYLE
    data = traitlets.Dict().tag(sync=True)

    @traitlets.validate("data")
    def _plain(self, proposal: Mapping[str, Any]) -> Any:
        return copy_plain(proposal["value"])

    def _repr_mimebundle_(self, **kwargs: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        data, metadata = super()._repr_mimebundle_(**kwargs) or ({}, {})
        shown = {"data": self.data, "page": True}
        page = static_html(_LEDGER_SCRIPT, _LEDGER_STYLE, shown, NO_SCRIPT_TEXT, prints=True)
        return {**data, "text/plain": NO_SCRIPT_TEXT, "text/html": page}, metadata


def count_totals(cube: xr.Dataset) -> dict[str, Any]:
    """Count verdicts by chapter and kind; rendered recordings and bookkeeping are separate."""
    found = ledger.from_cube(cube)
    rows = []
    for chapter, kind, counted in product(ledger.THESIS_CHAPTERS, ledger.KIND_WORDS, (True, False)):
        part = [e for e in found if (e.chapter, e.kind, e.counted) == (chapter, kind, counted)]
        if part:
            words = {"chapter": chapter, "kind": ledger.KIND_WORDS[kind], "counted": counted}
            rows.append({**words, "count": len(part), "verdicts": ledger.count_verdicts(part)})
    part = [entry for entry in found if entry.counted]
    every = {"count": len(part), "verdicts": ledger.count_verdicts(part)}
    return {"rows": rows, "every": every, "verdicts": verdicts.VERDICTS}


RULES = {  # tolerances, the same for all claims
    "wider": verdicts.WIDENING_POINTS,
    "wider_below_10": verdicts.WIDENING_POINTS_BELOW_10,
    "effect": f"{trends.MIN_MATERIAL_FALL:.0%}",
    "confident": trends.MIN_CONFIDENCE,
    "resamples": verdicts.RESAMPLE_COUNT,
    "unchanged": verdicts.UNCHANGED,
    "one_run_flat": trends.ONE_RUN_FLAT,
    "alike": trends.MAX_ALIKE_RATIO,
}


def list_differing(cube: xr.Dataset) -> dict[str, Any]:
    """List the differing claims by common cause; those that do not count are separate."""
    found = [e for e in ledger.from_cube(cube) if e.verdict in ("differs", "undefined")]
    groups = {}
    for words, belongs in _ENTRY_GROUPS.items():
        groups[words] = [entry for entry in found if entry.counted and belongs(entry)]
        found = [entry for entry in found if entry not in groups[words]]
    apart = {
        words: [e for e in found if e.kind in kinds] for words, kinds in _SEPARATE_ENTRIES.items()
    }
    return {
        "groups": {words: part for words, part in groups.items() if part},
        "apart": {words: part for words, part in apart.items() if part},
    }


def _is_mean(entry: ledger.Entry) -> bool:
    return entry.kind == "figure" and entry.what.startswith("mean")


_ENTRY_GROUPS: dict[str, Callable[[ledger.Entry], bool]] = {
    "mean errors that are larger here": lambda e: _is_mean(e) and e.ratio > 1,
    "mean errors that are smaller here": _is_mean,
    "largest errors of a marker, which the thesis reads off a bar of a figure": lambda e: (
        e.kind == "figure" and "marker" in e.what
    ),
    "errors of the sound, one draw each": lambda e: e.kind == "figure",
    "trends of the sound, seen or missed in one draw": lambda e: (
        e.kind == "trend" and e.chapter == 6
    ),
    "other trends": lambda e: e.kind == "trend",
    "numbers at odds with the thesis's own formulas, tables or text": lambda e: e.kind == "number",
}
"""Causes that differing claims share; the first that holds counts."""

_SEPARATE_ENTRIES = {
    "values of chapter 5, judged by rendered recordings": ("figure", "trend"),
    "bookkeeping: counts of printed rows, arithmetic on printed numbers": ("number",),
}


def ledger_table(cube: xr.Dataset) -> LedgerTable:
    """Return a table of all claims: differing ones first, with conclusions before other kinds."""
    found = sorted(ledger.from_cube(cube), key=_importance)
    return LedgerTable(data={"rows": [entry.row for entry in found]})


def _importance(entry: ledger.Entry) -> tuple[bool, int, bool, int, float]:
    """Return a sort key: bookkeeping last, verdict, conclusions first, kind, size of deviation."""
    last = entry.kind == "number" and not entry.counted
    ratio = 1.0 if np.isnan(entry.ratio) else entry.ratio
    apart = abs(np.log(ratio)) if ratio > 0 else np.inf
    concluded = entry.kind == "trend" and "-concluding-" in entry.id
    kind = ("trend", "figure", "number").index(entry.kind)
    return last, _VERDICT_ORDER.index(entry.verdict), not concluded, kind, -apart


def _interpretations(cube: xr.Dataset) -> list[dict[str, Any]]:
    """Return the agreement under each interpretation, the adopted one first."""
    return [
        {
            "name": part["reading"].item(),
            "met": part["reading_inside"].values,
            "claims": part["reading_claims"].sum("outcome").values,
            "gained": (gained := int(part["gained"])),
            "lost": (lost := int(part["lost"])),
            # p-value of the two-sided sign test
            "chance": min(1.0, 2 * scipy.special.bdtr(min(gained, lost), gained + lost, 0.5)),
            "log_residual": part["log_residual"].values,
        }
        for part in iterate_slices(cube, "reading")
    ]


def best_reading(cube: xr.Dataset) -> dict[str, Any]:
    """Return the adopted and best interpretation, and those better than adopted beyond chance."""
    adopted, *others = rows = _interpretations(cube)
    ahead = [row for row in others if row["met"].sum() > adopted["met"].sum()]
    better = [row["name"] for row in ahead if row["chance"] < 0.05]
    best = rows[int(np.argmax([row["met"].sum() for row in rows]))]
    return {"adopted": adopted, "best": best, "better": better}


TEXTS = {
    "totals": count_totals,
    "rules": lambda _: RULES,
    "differing": list_differing,
    "interpretations": lambda cube: {"rows": _interpretations(cube)},
    "commands": lambda cube: {
        "commands": {one: format_command(READINGS[one]) for one in cube["reading"].values.tolist()}
    },
    "best": best_reading,
}
