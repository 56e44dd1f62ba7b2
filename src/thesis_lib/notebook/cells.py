"""Parameter cells of notebooks, written from the parameters that figure sets declare."""

from __future__ import annotations

import json
from pathlib import Path
from textwrap import shorten
from typing import Any

from thesis_lib.files import whole_file
from thesis_lib.studies.request import Study, describe_parameters, whole_numbers

MAX_LINE_LENGTH = 100
MAX_VALUE_LENGTH = 86  # with the name: longer lists stand one element a line


def parameter_cell(model: type[Study]) -> str:
    """Return a cell that sets every parameter to its default, with type, unit and meaning.

    A meaning that is too long for its line is shortened; ``thesis list`` prints all of it.
    """
    return "\n".join(_assignment(row) for row in describe_parameters(model))


def _assignment(row: dict[str, str]) -> str:
    default = json.loads(row["default"])
    start = f"{row['name']}: {type(default).__name__} = "
    value = _literal(default)
    if len(start + value) > MAX_VALUE_LENGTH:
        value = _literal(default, lines=True)
    room = MAX_LINE_LENGTH - len((start + value).rpartition("\n")[2]) - len("  # ")
    parts = [row["unit"].replace("°", "degrees"), row["meaning"]]
    if row["allowed"].startswith('"'):  # a choice
        parts.insert(0, row["allowed"])
    meaning = ", ".join(filter(None, parts))
    return f"{start}{value}  # {shorten(meaning, room, placeholder=' …')}"


def _literal(value: Any, lines: bool = False) -> str:
    """Write a default as Python reads it, with double quotes; an element a line if asked."""
    if not lines:
        return json.dumps(whole_numbers(value), ensure_ascii=False)
    if isinstance(value, dict):
        parts = [f"{json.dumps(key, ensure_ascii=False)}: {_literal(value[key])}" for key in value]
        return "{\n" + "".join(f"    {part},\n" for part in parts) + "}"
    return "[\n" + "".join(f"    {_literal(one)},\n" for one in value) + "]"


def write_cell(notebook: Path, model: type[Study]) -> bool:
    """Write the parameter cell of a notebook again; return whether it has changed."""
    import nbformat

    document = nbformat.read(notebook, as_version=4)
    (cell,) = [one for one in document.cells if "parameters" in one.metadata.get("tags", [])]
    source = parameter_cell(model)
    if changed := cell.source != source:
        cell.source = source
        whole_file(notebook, lambda part: nbformat.write(document, part))
    return changed
