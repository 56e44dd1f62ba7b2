"""The book of one chapter, to be read before the rest is done: a project laid out for it.

Its pages are those of the table of contents that its figure sets stand under. What these point at
elsewhere in the book stays as words (:mod:`thesis_lib.book.elsewhere`).
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml

from thesis_lib.figure_sets.registry import CHAPTERS, TITLES

_SHARED = ("conventions", "references")  # what every chapter is read with
_HOME = """# {title}

This is one chapter of the book *{book}*, made by `thesis book {chapter}`. Words that are links in
the book, to its other chapters, are underlined with dots here. `thesis book` makes all of it, and
takes what was run for this.

```{{tableofcontents}}
```
"""


def pages(root: Path, chapter: str) -> list[Path]:
    """The pages of a chapter's book in a project, without those of its figure sets."""
    files = [root / "book" / f"{name}.md" for one in _contents(root, chapter) for name in _in(one)]
    return [file for file in files if file.parent.name != "executed"]


def _contents(root: Path, chapter: str) -> list[Any]:
    """What the table of contents has of a chapter, and of what all are read with."""
    contents = yaml.safe_load((root / "book" / "_toc.yml").read_text(encoding="utf-8"))
    ours = {*_SHARED, *(f"executed/{name}" for name in CHAPTERS[chapter])}
    every = [entry for part in contents["parts"] for entry in part["chapters"]]
    found = [entry for entry in every if ours.intersection(_in(entry))]
    return sorted(found, key=lambda entry: entry["file"] in _SHARED)


def _in(entry: Any) -> Iterator[str]:
    yield entry["file"]
    for inside in entry.get("sections", []):
        yield from _in(inside)


def lay_out(root: Path, chapter: str, pieces: Path, executed: Iterable[Path], work: Path) -> None:
    """Fill an empty folder `work` with the project of a chapter's book.

    `pieces` is the folder of what its pages include, `executed` are its notebooks.
    """
    book, entries = work / "book", _contents(root, chapter)
    shutil.copytree(root / "book" / "assets", book / "assets")
    shutil.copytree(root / "build" / "assets", work / "build" / "assets")
    for name in ("package.json", "package-lock.json", "book/references.bib"):
        shutil.copy(root / name, work / name)
    (book / "executed").mkdir()
    for file in [*pieces.glob("*.*"), *executed]:
        shutil.copy(file, book / "executed")
    for page in pages(root, chapter):
        shutil.copy(page, book)
    config = yaml.safe_load((root / "_config.yml").read_text(encoding="utf-8"))
    home = _HOME.format(title=TITLES[chapter], book=config["title"], chapter=chapter)
    (book / "index.md").write_text(home, encoding="utf-8")
    config["title"] += f": {TITLES[chapter]} alone"
    config["sphinx"]["config"]["extensions"].append("thesis_lib.book.elsewhere")
    contents = {"format": "jb-book", "root": "index", "chapters": entries}
    for place, said in ((work / "_config.yml", config), (book / "_toc.yml", contents)):
        place.write_text(yaml.safe_dump(said, allow_unicode=True), encoding="utf-8")
