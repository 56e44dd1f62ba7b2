"""What the book tells of manifests and warnings, made from the models and limits themselves."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from thesis_lib.book.pieces import answer
from thesis_lib.book.pieces import filming as guidance
from thesis_lib.files import whole_text
from thesis_lib.measure.messages import CHECKS, NEW, NOTES, UNCHECKED, Message
from thesis_lib.measure.recordings.board_fields import BoardSpec
from thesis_lib.measure.recordings.force_fields import Excitation, Force, Sweep
from thesis_lib.measure.recordings.manifest_model import (
    CameraFiles,
    Manifest,
    Markers,
    Structure,
)
from thesis_lib.measure.recordings.radiation_fields import Radiation
from thesis_lib.measure.recordings.reuse import Reuse
from thesis_lib.measure.recordings.sought import Sought
from thesis_lib.studies.vocabulary import allowed_text, unit

PARTS: dict[str, type[BaseModel]] = {
    "manifest": Manifest,
    "structure": Structure,
    "markers": Markers,
    "cameras": CameraFiles,
    "board": BoardSpec,
    "excitation": Excitation,
    "calibration": Reuse,
    "radiation": Radiation,
    "modes": Sought,
    "force": Force,
    "sweep": Sweep,
}


def fields(part: str) -> str:
    """The fields of a part of the manifest, as a Markdown definition list.

    Parameters
    ----------
    part : str
        A name of :data:`PARTS`.
    """
    model = PARTS[part]
    entries = []
    for name, field in model.model_fields.items():
        given = _default(model, name)
        term = f"`{name}` · {given}"
        parts = [str(field.description)]
        if allowed_text(model, name) != "an object":  # whose fields stand in a list of their own
            parts.append(f"Allowed: {allowed_text(model, name)}")
        entries.append((term, ". ".join(_sentence(one) for one in parts) + "."))
    return _definitions(entries)


def _default(model: type[BaseModel], name: str) -> str:
    """A field's default with its unit, or what it says of being given."""
    if model.model_fields[name].is_required():
        return "required" + (f", in {unit(name)}" if unit(name) else "")
    required = any(field.is_required() for field in model.model_fields.values())
    whole: Any = None if required else model()
    field = model.model_fields[name]
    value = getattr(whole, name) if whole else field.get_default(call_default_factory=True)
    if isinstance(value, BaseModel):
        return "its fields below"
    if value is None:
        return "null" + (f", else in {unit(name)}" if unit(name) else "")
    return f"{_shown(value)} {unit(name)}".rstrip()


def _shown(value: Any) -> str:
    """A value as it stands in YAML."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_shown, value))}]"
    number = isinstance(value, float)
    return f"{value:.10g}" if number else json.dumps(value, ensure_ascii=False).strip('"')


def warnings() -> str:
    """Return every check of a manifest, its limit, the reason, and what to do."""
    parts = []
    for title, checks in CHECKS.items():
        entries = []
        for code, one in checks.items():
            space = "" if one.unit == "°" else " "
            term = f"{_named(code)} · {one.limit:g}{space}{one.unit}"
            entries.append((term, f"{one.meaning} {one.remedy}"))
        parts.append(f"*{title}*\n\n{_definitions(entries)}")
    return "\n".join(parts)


def notes(group: str) -> str:
    """Return a group of notes, what each means, and what to do, as a definition list."""
    return _definitions(
        (f"{_named(code)} · {one.pattern}", f"{one.meaning} _What to do._ {one.remedy}")
        for code, one in NOTES[group].items()
    )


def lines(of: Mapping[str, Message]) -> str:
    """Return lines of the command, and what to do about each, as a definition list."""
    return _definitions((one.pattern, one.remedy) for one in of.values())


def _named(code: str) -> str:
    """A name that links lead to."""
    return f"[`{code}`]{{#{code}}}"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _definitions(entries: Iterable[tuple[str, str]]) -> str:
    """A Markdown definition list."""
    escaped = ((term, text.replace("*", r"\*")) for term, text in entries)
    return "\n".join(f"{term}\n: {text}\n" for term, text in escaped)


PIECES: dict[str, Callable[[], str]] = {
    **{f"record-{part}": partial(fields, part) for part in PARTS},
    "record-warnings": warnings,
    "record-unchecked": partial(lines, UNCHECKED),
    "record-new": partial(lines, NEW),
    "record-notes": partial(notes, "shape"),
    "record-notes-modes": partial(notes, "modes"),
    "record-notes-sound": partial(notes, "sound"),
    "record-notes-force": partial(notes, "force"),
    **guidance.PIECES,
    **answer.PIECES,
}


def write(folder: Path) -> None:
    """Write every piece of :data:`PIECES` into a folder, as ``NAME.md``."""
    for name, piece in PIECES.items():
        text = piece()
        whole_text(folder / f"{name}.md", text)
