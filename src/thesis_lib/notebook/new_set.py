"""New figure sets from the template next to this file, and the parameter cells of notebooks."""

import json
import keyword
import re
from pathlib import Path
from textwrap import shorten
from typing import Any

from thesis_lib.figure_sets.registry import CHAPTER_SETS, FIGURE_SETS
from thesis_lib.files import project_root, staging, whole_file, whole_text
from thesis_lib.studies.fields import format_given
from thesis_lib.studies.request import Study, describe_parameters, whole_numbers
from thesis_lib.text import RefusedError

MAX_LINE_LENGTH = 100
MAX_VALUE_LENGTH = 86  # with the name: longer lists have one element per line


def parameter_cell(model: type[Study]) -> str:
    """Return a cell that sets every parameter to its default, with type, unit and meaning.

    A meaning that is too long for its line is shortened; ``thesis list`` prints all of it.
    """
    lines = []
    for row in describe_parameters(model):
        default = row["default"]
        start = f"{row['name']}: {type(default).__name__} = "
        value = _literal(default)
        if len(start + value) > MAX_VALUE_LENGTH:
            value = _literal(default, lines=True)
        room = MAX_LINE_LENGTH - len((start + value).rpartition("\n")[2]) - len("  # ")
        choice = row["allowed"] if row["allowed"].startswith('"') else ""
        parts = choice, row["unit"].replace("°", "degrees"), row["meaning"]
        meaning = ", ".join(filter(None, parts))
        lines.append(f"{start}{value}  # {shorten(meaning, room, placeholder=' …')}")
    return "\n".join(lines)


def _literal(value: Any, lines: bool = False) -> str:
    """Format a default as Python source with double quotes; with `lines`, one element per line."""
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


TEMPLATE_FOLDER = Path(__file__).parent / "template"
TEMPLATE_NAME, TEMPLATE_CLASS, TEMPLATE_TITLE = "footprint", "Footprint", "Footprint of a pixel"
TEMPLATE_IMPORTS = ("FigureSet",)  # classes that its request must not shadow
CONTENTS_PART = '  - caption: "Beyond the thesis"'
NAME_PATTERN = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


def write_set(name: str, title: str = "") -> list[Path]:
    """Create a figure set, in the book if `name` is a name, elsewhere if it is a path.

    Returns
    -------
    list of Path
        The written files: the folder, the notebook, and in the book its table of contents.

    Raises
    ------
    RefusedError
        If the name is invalid or taken.
    """
    place = Path(name)
    inside = place.name == name
    if not NAME_PATTERN.fullmatch(place.name):
        allowed = "small letters, digits and hyphens, as in beam-ends"
        raise RefusedError(f"new-set: given {format_given(place.name)}, allowed: {allowed}")
    folder = notebooks = place
    if inside:
        folder = project_root() / "src/thesis_lib/figure_sets" / name.replace("-", "_")
        notebooks = project_root() / "notebooks"
    notebook = notebooks / f"{place.name}.ipynb"
    words = place.name.split("-")
    class_name = "".join(map(str.capitalize, words))
    taken = place.name in FIGURE_SETS or place.name in CHAPTER_SETS
    taken |= inside and folder.with_suffix(".py").exists()  # a module, as registry.py
    taken |= keyword.iskeyword(class_name) or class_name in TEMPLATE_IMPORTS
    if taken or folder.exists() or notebook.exists():
        raise RefusedError(f"new-set: {name} is taken, allowed: another name")
    quoted = json.dumps(title or " ".join(words).capitalize(), ensure_ascii=False)
    replaced = {
        TEMPLATE_TITLE: quoted[1:-1],  # for strings in Python and JSON
        TEMPLATE_CLASS: class_name,
        TEMPLATE_NAME: place.name,
    }
    any_of = re.compile("|".join(replaced))  # in one pass: a title may contain the template's words
    texts = {
        file.name: any_of.sub(lambda found: replaced[found[0]], file.read_text("utf-8"))
        for file in sorted(TEMPLATE_FOLDER.glob("*.*"))
    }
    text = texts.pop(f"{TEMPLATE_NAME}.ipynb")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with staging(folder.parent) as part:
        for file, source in texts.items():
            (part / file).write_text(source, encoding="utf-8")
        part.rename(folder)
    whole_text(notebook, text)
    if not inside:
        return [folder, notebook]
    contents = project_root() / "book" / "_toc.yml"  # the page goes to the end of its part
    before, heading, after = contents.read_text(encoding="utf-8").partition(CONTENTS_PART)
    end = after.find("\n  - caption:")
    after = f"{after[:end]}\n      - file: executed/{place.name}{after[end:]}"
    whole_text(contents, before + heading + after)
    return [folder, notebook, contents]
