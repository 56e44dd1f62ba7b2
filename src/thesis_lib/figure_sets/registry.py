"""Registry of figure sets, requests and chapters, filled from the folders next to this file.

A user's own figure sets are in a folder anywhere with the same modules (see
``figure_sets.figure_set``) and a notebook ``NAME.ipynb`` for each figure set. Kernels find the
folder by the environment variable :data:`SETS_VARIABLE`.
"""

import hashlib
import os
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.studies.fields import format_given, suggest_name
from thesis_lib.studies.request import ParameterError, Study, validate_values
from thesis_lib.text import format_list, one_line

TITLES = {
    **{f"ch{number}": f"Chapter {number}" for number in (2, 3, 4, 5)},
    "lab": "Beyond chapter 5",
    "ch6": "Chapter 6",
    "beyond": "Beyond the thesis",
    "shapes": "Shapes without symmetry",
}
"""Titles of the chapters by name, in their order."""


_FOLDERS = sorted(path.parent.name for path in Path(__file__).parent.glob("*/figure_set.py"))
_EVERY: list[FigureSet] = [
    one
    for folder in _FOLDERS
    for one in import_module(f"{__package__}.{folder}.figure_set").FIGURE_SETS
]
FIGURE_SETS = {
    one.request.name: one for one in sorted(_EVERY, key=lambda s: [*TITLES, ""].index(s.chapter))
}
"""Figure sets of all folders by name, in the order of the chapters."""
STUDIES: dict[str, type[Study]] = {name: one.request for name, one in FIGURE_SETS.items()}
CHAPTER_SETS = {
    chapter: [name for name, one in FIGURE_SETS.items() if one.chapter == chapter]
    for chapter in TITLES
}


def model_of(name: str) -> type[Study]:
    """Return the parameter model of a figure set; an unknown name raises `ParameterError`."""
    if name not in STUDIES:
        folders = {file.parent.name for file in Path().glob("*/figure_set.py")}
        here = f"for the folder here: thesis run ./{name}; " if name in folders else ""
        known = [*STUDIES, *CHAPTER_SETS]
        raise ParameterError(
            f"{one_line(name) or format_given(name)}: no such figure set"
            f"{suggest_name(name, known)}; {here}{format_list(known, 'thesis list')}"
        )
    return STUDIES[name]


def validate_request(name: str, values: Mapping[str, Any]) -> Study:
    """Return the parameters of a figure set from plain values.

    Raises
    ------
    ParameterError
        In one line: the set and field, what was given, what is allowed and in which unit.
    """
    return validate_values(model_of(name), values)


SETS_VARIABLE = "THESIS_FIGURE_SETS"


def load_sets(folder: Path) -> list[str]:
    """Register the figure sets of a folder, in this process and in kernels that it starts.

    Raises
    ------
    ParameterError
        In one line: the file, and what is wrong with it.
    """
    folder = folder.resolve()
    if there := [name for name, study in STUDIES.items() if study.folder == str(folder)]:
        return there
    file = folder / "figure_set.py"
    if not file.is_file():
        raise ParameterError(f"{file} is missing; wanted: a module with a list FIGURE_SETS")
    package = ModuleType(f"figure_set_{hashlib.sha256(str(folder).encode()).hexdigest()[:10]}")
    package.__path__ = [str(folder)]
    sys.modules[package.__name__] = package
    try:
        every = import_module(f"{package.__name__}.figure_set").FIGURE_SETS
        found = {one.request.name: one for one in every}
        for one in found.values():
            validate_values(one.request, {})
    except Exception as error:  # a user's module may raise anything
        why = f"{type(error).__name__}: {one_line(str(error))}"
        raise ParameterError(f"{file} cannot be used: {why}") from None
    for name in found:
        if name in FIGURE_SETS or name in CHAPTER_SETS:
            raise ParameterError(f"{file}: the name {one_line(name)} is taken; wanted: another")
        if not (notebook := folder / f"{name}.ipynb").is_file():
            raise ParameterError(f"{notebook} is missing; wanted: the notebook of {name}")
    for name, one in found.items():
        FIGURE_SETS[name], STUDIES[name], one.request.folder = one, one.request, str(folder)
    os.environ[SETS_VARIABLE] = f"{os.environ.get(SETS_VARIABLE, '')}{os.pathsep}{folder}"
    return list(found)


def is_known(name: str, here: bool = False) -> bool:
    """Return whether a figure set exists in the library or in a folder of :data:`SETS_VARIABLE`.

    `here` adds the working directory, for a notebook, whose code is executed anyway. No command
    executes code only because it is in the working directory.
    """
    if name not in FIGURE_SETS:
        named = [one for one in os.environ.get(SETS_VARIABLE, "").split(os.pathsep) if one]
        own = [os.curdir] if here and Path("figure_set.py").is_file() else []
        for folder in [*named, *own]:
            load_sets(Path(folder))
    return name in FIGURE_SETS
