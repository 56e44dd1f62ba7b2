"""Whether a whole book is what it was when it was finished: told from its files, in no time.

The steps of a book know better what is stale, but to ask them all figure sets have to be loaded.
Here all that a book is made from and all that it has made is one digest, of contents, not of dates:
a copy of a fresh book is unchanged, and one edited byte anywhere is not.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from thesis_lib.files import digest_of, library_files, project_root, sha256, sweep, whole_text

WRITTEN = (
    "notebooks",
    "book",
    "data",
    "tests",
    "benchmarks",
    "_config.yml",
    "package.json",
    "package-lock.json",
)
SOURCES = (*WRITTEN, "build/assets")
MADE = frozenset({"executed", "results", "published"})  # folders in these that a book writes itself
RECORD = "build/made/whole-book.json"


def _state(root: Path, made: list[Path]) -> dict[str, str]:
    """Digests of what a book is made from, the executed notebooks included, and of the book."""
    return {
        "library": digest_of(library_files()),
        **{name: _digest(root / name) for name in SOURCES},
        **{path.relative_to(root).as_posix(): sha256(path) for path in made},
    }


def written() -> dict[str, str]:
    """Digests of what people write, to be taken before a book is begun."""
    root = project_root()
    own = {name: _digest(root / name, MADE) for name in WRITTEN}
    return {"library": digest_of(library_files()), **own}


def _digest(place: Path, but: frozenset[str] = frozenset()) -> str:
    """Of a file, or of those of a folder that belong to the project, without some folders."""
    if not place.is_dir():
        return sha256(place)
    inside = sorted(path for path in place.rglob("*") if path.is_file())
    ours = (p for p in inside if not but.union(["__pycache__"]) & {*p.parts} and p.name[0] != ".")
    lines = [f"{path.relative_to(place).as_posix()} {sha256(path)}\n" for path in ours]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def remember(made: list[Path], begun: dict[str, str]) -> None:
    """Keep the state of a book that has just been finished, unless it was edited meanwhile.

    Parameters
    ----------
    made : list of Path
        What a reader is given: the folder of the pages, the archive.
    begun : dict
        What :func:`written` was when the book was begun.
    """
    if written() != begun:
        return
    root = project_root()
    names = [path.relative_to(root).as_posix() for path in made]
    state = {"made": names, "state": _state(root, made)}
    whole_text(root / RECORD, json.dumps(state, indent=1) + "\n")


def is_unchanged() -> Path | None:
    """The page to open, if a book was finished and nothing has changed since; else None."""
    root = project_root()
    try:
        kept = json.loads((root / RECORD).read_text(encoding="utf-8"))
        made = [root / str(name) for name in kept["made"]]
        if not made or kept["state"] != _state(root, made):
            return None
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    build = root / "build"
    sweep(build, build / "made", build / "cache", root / "book" / "executed")
    sweep(root / "data" / "results")
    return made[0] / "index.html"
