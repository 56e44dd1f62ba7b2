"""What the book tells of the thesis's gaps, from ``data/thesis/assumptions.toml``."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from thesis_lib.facts.readings import assumptions
from thesis_lib.files import whole_text

CHAPTERS = {  # pieces of the page: subjects, whose first names the piece
    "assumptions-simulation": ("beam", "plate"),
    "assumptions-sound": ("sound",),
    "assumptions-experiment": ("experiment", "lab"),
}


def _item(item: dict[str, Any]) -> str:
    """One gap: what is open, what was taken, why, and which parameters take it otherwise."""
    given = item.get("parameters", {})
    shown = [f"`{name}={json.dumps(value)}`" for name, value in given.items()]
    shown += [f"`{name}`" for name in item.get("fields", [])]
    links = ", ".join(f"{{ref}}`{name.upper()} <errata-{name}>`" for name in item.get("errata", []))
    lines = [f"**{item['gap']}**", "", f"{item['reading']} *Why:* {item['why']}", ""]
    more = []
    if shown:
        more.append(f"Parameter: {', '.join(shown)}.")
    if "readings" in item:
        more.append("Other readings are {ref}`compared <other-readings>`.")
    if links:
        more.append(f"Errata: {links}.")
    return "\n".join([f"(assumed-{item['id']})=", *lines, " ".join(more), ""])


def _piece(subjects: tuple[str, ...]) -> str:
    known = ("beam", "plate", "sound", "experiment", "lab")
    chosen = [
        item
        for item in assumptions()
        if next(subject for subject in known if subject in item["subjects"]) in subjects
    ]
    return "\n".join(map(_item, chosen))


PIECES: dict[str, Callable[[], str]] = {
    name: partial(_piece, subjects) for name, subjects in CHAPTERS.items()
}


def write(folder: Path) -> None:
    """Write every piece into a folder."""
    for name, piece in PIECES.items():
        text = piece()
        whole_text(folder / f"{name}.md", text)
