"""A new figure set: a copy of the template next to this file, under a name of its own."""

from __future__ import annotations

import re
from pathlib import Path

from thesis_lib.figure_sets.registry import CHAPTER_SETS, FIGURE_SETS
from thesis_lib.files import project_root, staging, whole_text

TEMPLATE_FOLDER = Path(__file__).parent / "template"
TEMPLATE_NAME, TEMPLATE_CLASS, TEMPLATE_TITLE = "footprint", "Footprint", "Footprint of a pixel"
CONTENTS_PART = '  - caption: "Beyond the thesis"'
NAME_PATTERN = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


class NewSetError(ValueError):
    """A figure set that cannot be begun; the message is one line."""


def write_set(name: str, title: str = "") -> list[Path]:
    """Begin a figure set, in the book if `name` is a name, elsewhere if it is a path.

    Returns
    -------
    list of Path
        What was written: the folder, the notebook, and in the book its table of contents.

    Raises
    ------
    NewSetError
        If the name is not one, or something of that name is there.
    """
    place = Path(name)
    inside = place.name == name
    if not NAME_PATTERN.fullmatch(place.name):
        raise NewSetError(
            f"new-set: given {place.name}, allowed: small letters, digits and hyphens, "
            "as in beam-ends"
        )
    folder = place
    if inside:
        folder = project_root() / "src/thesis_lib/figure_sets" / name.replace("-", "_")
    notebook = (project_root() / "notebooks" if inside else folder) / f"{place.name}.ipynb"
    taken = place.name in FIGURE_SETS or place.name in CHAPTER_SETS
    if taken or folder.exists() or notebook.exists():
        raise NewSetError(f"new-set: {name} is there already, allowed: a new name")
    words = place.name.split("-")
    replaced = {
        TEMPLATE_TITLE: title or " ".join(words).capitalize(),
        TEMPLATE_CLASS: "".join(map(str.capitalize, words)),
        TEMPLATE_NAME: place.name,
    }
    texts = {file.name: file.read_text("utf-8") for file in sorted(TEMPLATE_FOLDER.glob("*.*"))}
    for old, new in replaced.items():
        texts = {file: text.replace(old, new) for file, text in texts.items()}
    text = texts.pop(f"{TEMPLATE_NAME}.ipynb")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with staging(folder.parent) as part:
        for file, source in texts.items():
            (part / file).write_text(source, encoding="utf-8")
        part.rename(folder)
    whole_text(notebook, text)
    return [folder, notebook, *([_add_to_contents(place.name)] if inside else [])]


def _add_to_contents(name: str) -> Path:
    """Add a set's page to the end of the part *Beyond the thesis* of the table of contents."""
    contents = project_root() / "book" / "_toc.yml"
    before, part, after = contents.read_text(encoding="utf-8").partition(CONTENTS_PART)
    end = after.find("\n  - caption:")
    after = f"{after[:end]}\n      - file: executed/{name}{after[end:]}"
    whole_text(contents, before + part + after)
    return contents
