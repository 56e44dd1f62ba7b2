"""What results rest on: the code they reach by imports, facts, the lock; and their digests.

An edit makes stale what rests on it and nothing else. Comments, docstrings and blank lines do not
count, parameters count by their values.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from thesis_lib import templates
from thesis_lib.facts.setups import data_folder
from thesis_lib.figure_sets.figure_set import Product
from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.files import code, shipped
from thesis_lib.studies import reach
from thesis_lib.studies.request import Study


def library(product: Product, asked: Study) -> str:
    """Digest of the code and facts that a product rests on, and of the lock."""
    files = code_of(product.module, type(asked).__module__)
    return digest([*files, *facts_of(files), _lock()])


def key(product: Product, asked: Study) -> str:
    """Digest of all that determines a product for a request, of what it needs, too."""
    needed = [key(*each) for each in product.needs(asked).values()]
    needed += [key(FIGURE_SETS[one.name], one) for one in product.reads()]
    text = json.dumps([asked.name, asked.digest, library(product, asked), *needed])
    return hashlib.sha256(text.encode()).hexdigest()


def made_by(*modules: str) -> str:
    """Digest of the code, facts and assets that modules rest on, and of the lock."""
    files = code_of(*modules)
    return digest([*files, *facts_of(files), *assets_of(files), _lock()])


def code_of(*modules: str) -> list[Path]:
    """The files that modules reach by imports, themselves included."""
    return together(map(reach.file_of, modules))


def together(files: Iterable[Path]) -> list[Path]:
    """All files that some files rest on, themselves included, in a fixed order."""
    return sorted(reach.reached(*files))


def facts_of(files: Iterable[Path]) -> list[Path]:
    """The files of the thesis's facts that some modules name."""
    words = _words(files)
    return sorted(one for one in data_folder().iterdir() if one.name in words)


def assets_of(files: Iterable[Path]) -> list[Path]:
    """Return the styles and scripts that some modules name, with all that these scripts import.

    Templates that stand next to these modules belong to them.
    """
    files = list(files)
    words, every = _words(files), sorted((reach.library() / "web" / "assets").iterdir())
    found = [one for one in every if {one.name, one.stem} & words]
    for one in found:
        needed = {Path(name).name for name in re.findall(r'"(\./\w+\.js)"', one.read_text("utf-8"))}
        found += [other for other in every if other.name in needed and other not in found]
    folders = {file.parent / templates.FOLDER for file in files}
    return sorted([*found, *(one for folder in folders for one in folder.glob("*.*"))])


def digest(files: Iterable[Path]) -> str:
    """Digest of what of some files can change a result, with their names."""
    total = hashlib.sha256()
    for file in files:
        total.update(f"{file.parent.name}/{file.name}\n".encode() + code(file))
    return total.hexdigest()


def _words(files: Iterable[Path]) -> set[str]:
    """What stands between quotation marks in some modules, if it could name a file."""
    return {word for file in files for word in _quoted(code(file))}


@cache
def _quoted(text: bytes) -> frozenset[str]:
    return frozenset(re.findall(r'"([\w.-]+)"', text.decode()))


def _lock() -> Path:
    """The versions that the book computes with."""
    return shipped() / "requirements" / "book.txt"
