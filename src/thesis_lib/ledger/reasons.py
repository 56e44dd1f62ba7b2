"""Why claims differ: one sentence for each, and where the book tells more.

A reason is an erratum or an assumption by ``data/thesis/reasons.csv``, or numbers that exclude each
other, or another interpretation of the thesis that meets the value. Else no explanation was found.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import xarray as xr

from thesis_lib.facts.readings import READINGS
from thesis_lib.facts.reasons import read_reasons
from thesis_lib.ledger.entries import Entry

EXCLUDED = "../errata.html#errata-a9"  # on stated numbers that exclude each other
INTERPRETATIONS = "claims.html#other-readings"
NOT_FOUND = "No explanation was found."


def explained(found: Iterable[Entry], readings: xr.Dataset) -> list[Entry]:
    """Give each claim that differs its reason; other claims stay as they are.

    Parameters
    ----------
    found : iterable of Entry
        The ledger.
    readings : xarray.Dataset
        Which stated values each interpretation meets, the adopted one first:
        ``reading_meets(reading, value)``, ``reading_inside(reading, chapter)``.
    """
    known = {one.id: (one.reason, _link(one.page)) for one in read_reasons().values()}
    values = set(readings["value"].values.tolist())
    made = []
    for entry in found:
        if entry.verdict != "differs":
            made.append(entry)
            continue
        if entry.id in known:
            note, link = known[entry.id]
        elif entry.note:
            note, link = entry.note, EXCLUDED
        elif entry.id in values:
            note, link = _by_interpretation(entry.id, readings), INTERPRETATIONS
        else:
            note, link = NOT_FOUND, INTERPRETATIONS
        made.append(replace(entry, note=note, note_href=link))
    return made


def _by_interpretation(name: str, readings: xr.Dataset) -> str:
    """Say which other interpretation meets a stated value, if any, and what it meets in all."""
    names = readings["reading"].values.tolist()
    met = readings["reading_inside"].sum("chapter").values
    meets = readings["reading_meets"].sel(value=name).values.astype(bool)
    others = _simplest([at for at in range(1, len(names)) if meets[at]], names)
    if not others:
        return f"{NOT_FOUND[:-1]}: none of {len(names) - 1} other interpretations meets this value."
    best = max(others, key=lambda at: met[at])
    adopted = f"the adopted one meets {met[0]}."
    if met[best] > met[0]:
        return (
            f"Another interpretation, “{names[best]}”, meets this value, and {met[best]} values "
            f"in all; {adopted}"
        )
    return (
        f"No explanation was found that fits the other values: “{names[best]}” meets this one, "
        f"but only {met[best]} in all; {adopted}"
    )


def _simplest(chosen: list[int], names: Sequence[str]) -> list[int]:
    """Leave out interpretations that change all that another one changes, and more."""
    changes = {at: READINGS[names[at]].values.items() for at in chosen}
    return [at for at in chosen if not any(other < changes[at] for other in changes.values())]


def _link(page: str) -> str:
    """Return a document of the book as the ledger's page links to it."""
    document, _, anchor = page.partition("#")
    folder, _, name = document.rpartition("/")
    target = f"{name}.html" if folder == "executed" else f"../{document}.html"
    return target + (f"#{anchor}" if anchor else "")
