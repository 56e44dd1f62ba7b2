"""All figure sets by name, found in the folders beside this file; chapters; requests by name."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.studies.fields import suggest_name
from thesis_lib.studies.request import ParameterError, Study, validate_values
from thesis_lib.text import listed, one_line

TITLES = {
    **{f"ch{number}": f"Chapter {number}" for number in (2, 3, 4, 5)},
    "lab": "Beyond chapter 5",
    "ch6": "Chapter 6",
    "beyond": "Beyond the thesis",
    "shapes": "Shapes without symmetry",
}
"""What the names of chapters stand for, in their order."""


def find_sets() -> dict[str, FigureSet]:
    """Return the figure sets of all folders by name, in the order of the chapters."""
    folders = sorted(path.parent.name for path in Path(__file__).parent.glob("*/figure_set.py"))
    every = [
        one
        for folder in folders
        for one in import_module(f"{__package__}.{folder}.figure_set").FIGURE_SETS
    ]
    order = [*TITLES, ""]
    return {one.request.name: one for one in sorted(every, key=lambda s: order.index(s.chapter))}


FIGURE_SETS = find_sets()
STUDIES: dict[str, type[Study]] = {name: one.request for name, one in FIGURE_SETS.items()}
CHAPTER_SETS = {
    chapter: [name for name, one in FIGURE_SETS.items() if one.chapter == chapter]
    for chapter in TITLES
}


def model_of(name: str) -> type[Study]:
    """Return the parameters of a figure set; an unknown name is refused."""
    if name not in STUDIES:
        folders = {file.parent.name for file in Path().glob("*/figure_set.py")}
        here = f"for the folder here: thesis run ./{name}; " if name in folders else ""
        raise ParameterError(
            f"{one_line(name)}: no such figure set{suggest_name(name, [*STUDIES, *CHAPTER_SETS])}; "
            f"{here}{listed([*STUDIES, *CHAPTER_SETS], 'thesis list')}"
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
