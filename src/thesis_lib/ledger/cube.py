"""The ledger as a cube, and back: one variable for each field of its entries."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from thesis_lib.ledger.entries import NAN, Entry

TEXTS = {  # fields that the cube holds as text, and what they are
    "kind": "figure, trend or number",
    "place": "place of a claim in the thesis",
    "case": "case of the thesis that a claim speaks of",
    "modes": "modes that a claim speaks of",
    "what": "subject of a claim",
    "stated": "claimed value or trend",
    "got": "value or trend that the book computes",
    "verdict": "verdict on a claim",
    "note": "reason why a claim differs, or remark",
    "href": "page with the figure of a claim",
    "command": "commands that build the result files by which a claim is judged",
    "note_href": "page that explains the reason",
    "step_back": "largest material step against a trend, which is then not monotonic",
}
UNITS = {  # numbers of figures and trends; those of stray numbers have the units of their texts
    "least": "least claimed value",
    "most": "largest claimed value",
    "literal": "value of the nominal run, or computed number",
    "median": "median of the trials",
    "low": "5 % quantile of the trials",
    "high": "95 % quantile of the trials",
    "confidence": "share of resampled expectations in which a trend holds",
    "single": "share of single trials in which a trend holds",
    "effect": "expected error at the last setting over the first, least change",
    "largest_effect": "expected error at the last setting over the first, largest change",
    "ratio": "median over the nearest claimed value",
}


def as_cube(found: Sequence[Entry], readings: xr.Dataset) -> xr.Dataset:
    """The ledger as a cube: a variable for each field over ``claim``, and the other readings."""
    cube = readings.drop_attrs(deep=False).assign_coords(
        claim=("claim", [e.id for e in found], {"units": "1", "long_name": "name of the claim"})
    )
    for name, words in TEXTS.items():
        values = [e.row[name] for e in found]
        text = [";".join(map(str, v)) if isinstance(v, list) else str(v) for v in values]
        cube[name] = ("claim", text, {"units": "1", "long_name": words})
    for name, words in UNITS.items():
        numbers = [NAN if getattr(e, name) is None else getattr(e, name) for e in found]
        cube[name] = ("claim", np.array(numbers, float), {"units": "1", "long_name": words})
    of = {"claim_chapter": "chapter", "counted": "counted"}
    for name, field in of.items():
        whole = np.array([int(getattr(e, field)) for e in found])
        words = (
            "chapter of the claim" if name == "claim_chapter" else "1 if the totals count a claim"
        )
        cube[name] = ("claim", whole, {"units": "1", "long_name": words})
    return cube


def from_cube(cube: xr.Dataset) -> list[Entry]:
    """The entries that a cube of :func:`as_cube` holds."""
    columns = {name: cube[name].values.tolist() for name in (*TEXTS, *UNITS)}
    columns |= {
        "id": cube["claim"].values.tolist(),
        "chapter": cube["claim_chapter"].values.tolist(),
    }
    columns["counted"] = [bool(value) for value in cube["counted"].values]
    columns["modes"] = [tuple(map(int, filter(None, m.split(";")))) for m in columns["modes"]]
    columns["ratio"] = [None if np.isnan(value) else value for value in columns["ratio"]]
    return [
        Entry(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)
    ]
