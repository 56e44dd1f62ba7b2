"""The table of all claims, and what the other tables of the ledger's page need."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from itertools import product
from typing import Any

import anywidget
import numpy as np
import traitlets
import xarray as xr
from scipy.stats import binomtest

from thesis_lib.facts.readings import READINGS
from thesis_lib.figure_sets.claims import readings
from thesis_lib.ledger import entries as ledger
from thesis_lib.ledger import trends
from thesis_lib.ledger.entries import KIND_WORDS, Entry, from_cube
from thesis_lib.ledger.series import RESAMPLE_COUNT
from thesis_lib.ledger.verdicts import (
    UNCHANGED,
    VERDICTS,
    WIDENING_POINTS,
    WIDENING_POINTS_BELOW_10,
)
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.web.fragment import COLOURS_CSS, copy_plain, join_modules, read_asset, static_html

_LEDGER_SCRIPT = join_modules("ledger")
_LEDGER_STYLE = COLOURS_CSS + read_asset("ledger.css")
NO_SCRIPT_TEXT = "This table needs JavaScript; `thesis claims` prints the same."
_VERDICT_ORDER = ("differs", "undefined", UNCHANGED, "within scatter", "agrees")


class LedgerTable(anywidget.AnyWidget):
    """A table of claims with their verdicts.

    The reader filters by chapter, case, mode, verdict and kind, searches and sorts. On a page
    without a kernel the filters stand in the address, as in ``claims.html?chapter=3&mode=1``, and
    ``claims.html#claim-ID`` shows and marks one claim whatever the filters.

    Parameters
    ----------
    data : dict
        ``{"rows": [row, …], "folded": n}``: one :attr:`thesis_lib.ledger.entries.Entry.row` per
        claim in the order to show; the last n, 0 by default, are shown only if asked for.
    """

    _esm = _LEDGER_SCRIPT
    _css = _LEDGER_STYLE
    data = traitlets.Dict().tag(sync=True)

    @traitlets.validate("data")
    def _plain(self, proposal: Mapping[str, Any]) -> Any:
        return copy_plain(proposal["value"])

    def __repr__(self) -> str:
        rows = self.data.get("rows", [])
        found = Counter(row["verdict"] for row in rows if row["counted"])
        counts = ", ".join(f"{found[one]} {one}" for one in VERDICTS)
        return f"LedgerTable({len(rows)} claims, {found.total()} counted: {counts})"

    def _repr_mimebundle_(self, **kwargs: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        data, metadata = super()._repr_mimebundle_(**kwargs) or ({}, {})
        page = static_html(
            _LEDGER_SCRIPT,
            _LEDGER_STYLE,
            {"data": self.data, "page": True},
            NO_SCRIPT_TEXT,
            prints=True,
        )
        return {**data, "text/plain": repr(self), "text/html": page}, metadata


def count_totals(cube: xr.Dataset) -> dict[str, Any]:
    """Count verdicts by chapter and kind; rendered recordings and bookkeeping stand apart."""
    found = from_cube(cube)
    rows = []
    for chapter, kind, counted in product(ledger.THESIS_CHAPTERS, KIND_WORDS, (True, False)):
        part = [e for e in found if (e.chapter, e.kind, e.counted) == (chapter, kind, counted)]
        if part:
            words = {"chapter": chapter, "kind": KIND_WORDS[kind], "counted": counted}
            rows.append(words | _count(part))
    every = _count([entry for entry in found if entry.counted])
    return {"rows": rows, "every": every, "verdicts": VERDICTS}


def _count(found: list[Entry]) -> dict[str, Any]:
    return {"count": len(found), "verdicts": ledger.count_verdicts(found)}


def compare_power(cube: xr.Dataset) -> dict[str, Any]:
    """Show how many claimed values the model meets and would meet, also with other errors."""
    own = int(np.flatnonzero(cube["factor"].values == 1)[0])
    rows: list[dict[str, Any]] = [
        {
            "chapter": int(part["chapter"]),
            "claims": int(part["power_claims"]),
            "expected": float(part["power_expected"]),
            "met": int(part["power_scaled"][own]),
            "scaled": part["power_scaled"].values,
        }
        for part in iterate_slices(cube, "chapter")
        if part["power_claims"]
    ]
    claims, met, expected = (sum(row[key] for row in rows) for key in ("claims", "met", "expected"))
    return {"rows": rows, "claims": claims, "met": met, "expected": expected / claims}


RULES = {  # tolerances, which are equal for all claims
    "wider": WIDENING_POINTS,
    "wider_below_10": WIDENING_POINTS_BELOW_10,
    "effect": f"{trends.MIN_MATERIAL_FALL:.0%}",
    "confident": trends.MIN_CONFIDENCE,
    "resamples": RESAMPLE_COUNT,
    "unchanged": UNCHANGED,
    "one_run_flat": trends.ONE_RUN_FLAT,
    "alike": trends.MAX_ALIKE_RATIO,
}


def list_differing(cube: xr.Dataset) -> dict[str, Any]:
    """List the claims that differ by what they have in common; bookkeeping is folded away."""
    found = [e for e in from_cube(cube) if e.verdict in ("differs", "undefined")]
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


def _is_mean(entry: Entry) -> bool:
    return entry.kind == "figure" and entry.what.startswith("mean")


_ENTRY_GROUPS: dict[str, Callable[[Entry], bool]] = {
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
    """Show all claims, to filter and search: differing ones first, conclusions first of those."""
    found = sorted(from_cube(cube), key=_importance)
    folded = sum(entry.kind == "number" and not entry.counted for entry in found)
    return LedgerTable(data={"rows": [entry.row for entry in found], "folded": folded})


def _importance(entry: Entry) -> tuple[bool, int, bool, int, float]:
    """Sort bookkeeping behind, by verdict, conclusions first, by kind, and by size of deviation."""
    last = entry.kind == "number" and not entry.counted
    ratio = 1.0 if np.isnan(entry.ratio) else entry.ratio
    apart = abs(np.log(ratio)) if ratio > 0 else np.inf
    concluded = entry.kind == "trend" and "-concluding-" in entry.id
    kind = ("trend", "figure", "number").index(entry.kind)
    return last, _VERDICT_ORDER.index(entry.verdict), not concluded, kind, -apart


def _interpretations(cube: xr.Dataset) -> list[dict[str, Any]]:
    """Return the agreement under each interpretation, the adopted one first."""
    rows = []
    for part in iterate_slices(cube, "reading"):
        gained, lost = int(part["gained"]), int(part["lost"])
        rows.append(
            {
                "name": part["reading"].item(),
                "met": part["reading_inside"].values,
                "claims": part["reading_claims"].sum("outcome").values,
                "gained": gained,
                "lost": lost,
                "chance": binomtest(gained, gained + lost).pvalue if gained + lost else 1.0,
                "log_residual": part["log_residual"].values,
            }
        )
    return rows


def list_commands(cube: xr.Dataset) -> dict[str, Any]:
    """List the command that runs chapter 3 under each interpretation."""
    names = cube["reading"].values.tolist()
    return {"commands": {name: readings.format_command(READINGS[name]) for name in names}}


def best_reading(cube: xr.Dataset) -> dict[str, Any]:
    """State whether an interpretation agrees better than the adopted one, beyond chance."""
    adopted, *others = rows = _interpretations(cube)
    met = [row["met"].sum() for row in rows]
    better = [
        row["name"]
        for row, number in zip(others, met[1:], strict=True)
        if number > met[0] and row["chance"] < 0.05
    ]
    return {"adopted": adopted, "best": rows[int(np.argmax(met))], "better": better}


TEXTS = {
    "totals": count_totals,
    "power": compare_power,
    "rules": lambda _: RULES,
    "differing": list_differing,
    "interpretations": lambda cube: {"rows": _interpretations(cube)},
    "commands": list_commands,
    "best": best_reading,
}
