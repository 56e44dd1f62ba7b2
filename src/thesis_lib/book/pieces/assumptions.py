"""The book's account of the thesis's gaps, from ``data/thesis/assumptions.toml``."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from thesis_lib.facts.readings import list_assumptions
from thesis_lib.files import whole_text
from thesis_lib.templates import render

CHAPTER_SUBJECTS = {  # pieces of the page: subjects, whose first names the piece
    "assumptions-simulation": ("beam", "plate"),
    "assumptions-sound": ("sound",),
    "assumptions-experiment": ("experiment", "lab"),
}
ASSUMPTION_SUBJECTS = ("beam", "plate", "sound", "experiment", "lab")


def _describe_gap(item: dict[str, Any]) -> dict[str, Any]:
    """Return one gap: what is open, what was assumed, why, and which parameters vary it."""
    return item | {
        "parameters": [(k, json.dumps(v)) for k, v in item.get("parameters", {}).items()],
        "fields": item.get("fields", []),
        "compared": "readings" in item,
        "errata": item.get("errata", []),
    }


def format_assumptions(subjects: tuple[str, ...]) -> str:
    """List the gaps whose first subject is one of these."""
    items = [
        _describe_gap(item)
        for item in list_assumptions()
        if next(subject for subject in ASSUMPTION_SUBJECTS if subject in item["subjects"])
        in subjects
    ]
    return render(__file__, "assumptions", items=items)


PIECES: dict[str, Callable[[], str]] = {
    name: partial(format_assumptions, subjects) for name, subjects in CHAPTER_SUBJECTS.items()
}


def write_assumptions(folder: Path) -> None:
    """Write every piece into a folder."""
    for name, piece in PIECES.items():
        whole_text(folder / f"{name}.md", piece())
