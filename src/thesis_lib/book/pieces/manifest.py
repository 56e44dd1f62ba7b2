"""The book's reference of manifests and warnings, from the models and messages themselves."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from thesis_lib.book.pieces import filming
from thesis_lib.files import whole_text
from thesis_lib.measure.messages import CHECK_GROUPS, NEW_MESSAGES, NOTE_GROUPS, UNCHECKED_MESSAGES
from thesis_lib.measure.recordings.excitation import Excitation, Force, Sought, Sweep
from thesis_lib.measure.recordings.manifest_model import (
    BoardSpec,
    CameraFiles,
    Manifest,
    MarkersSpec,
    Radiation,
    Reuse,
    StructureSpec,
)
from thesis_lib.studies.fields import describe_allowed, unit_of_field
from thesis_lib.templates import render

MANIFEST_PARTS: dict[str, type[BaseModel]] = {
    "manifest": Manifest,
    "structure": StructureSpec,
    "markers": MarkersSpec,
    "cameras": CameraFiles,
    "board": BoardSpec,
    "excitation": Excitation,
    "calibration": Reuse,
    "radiation": Radiation,
    "modes": Sought,
    "force": Force,
    "sweep": Sweep,
}

GROUP_OF_PIECE = {
    "notes": "shape",
    "notes-modes": "modes",
    "notes-sound": "sound",
    "notes-force": "force",
}
"""By piece of the page: the group of notes that it lists."""


def list_fields(part: str) -> str:
    """List the fields of a part of the manifest, as a Markdown definition list.

    Parameters
    ----------
    part : str
        A name of :data:`MANIFEST_PARTS`.
    """
    model = MANIFEST_PARTS[part]
    fields = [
        {
            "name": name,
            "default": _format_default(model, name),
            "meaning": field.description,
            "allowed": describe_allowed(model, name),
        }
        for name, field in model.model_fields.items()
    ]
    return render(__file__, "record-fields", fields=fields)


def _format_default(model: type[BaseModel], name: str) -> str:
    """Return a field's default with its unit, or that it is required."""
    if model.model_fields[name].is_required():
        return "required" + (f", in {unit_of_field(name)}" if unit_of_field(name) else "")
    required = any(field.is_required() for field in model.model_fields.values())
    whole: Any = None if required else model()
    field = model.model_fields[name]
    value = getattr(whole, name) if whole else field.get_default(call_default_factory=True)
    if isinstance(value, BaseModel):
        return "its fields below"
    if value is None:
        return "null" + (f", else in {unit_of_field(name)}" if unit_of_field(name) else "")
    return f"{_format_value(value)} {unit_of_field(name)}".rstrip()


def _format_value(value: Any) -> str:
    """Return a value as it stands in YAML."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_format_value, value))}]"
    number = isinstance(value, float)
    return f"{value:.10g}" if number else json.dumps(value, ensure_ascii=False).strip('"')


PIECES: dict[str, Callable[[], str]] = {
    **{f"record-{part}": partial(list_fields, part) for part in MANIFEST_PARTS},
    "record-warnings": partial(render, __file__, "record-warnings", groups=CHECK_GROUPS),
    "record-unchecked": partial(render, __file__, "record-lines", lines=UNCHECKED_MESSAGES),
    "record-new": partial(render, __file__, "record-lines", lines=NEW_MESSAGES),
    **{
        f"record-{name}": partial(render, __file__, "record-notes", notes=NOTE_GROUPS[group])
        for name, group in GROUP_OF_PIECE.items()
    },
    **filming.PIECES,
}


def write_reference(folder: Path) -> None:
    """Write every piece of :data:`PIECES` into a folder, as ``NAME.md``."""
    for name, piece in PIECES.items():
        whole_text(folder / f"{name}.md", piece())
