"""Cubes that a page is made of, opened once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import xarray as xr

from thesis_lib.figure_sets.registry import STUDIES


def of_subject(opened: Mapping[str, xr.Dataset], subject: str) -> list[xr.Dataset]:
    """The cubes of a subject, such as ``beam``."""
    return [cube for name, cube in opened.items() if STUDIES[name].subject == subject]


class Opened(dict[str, xr.Dataset]):
    """Cubes by name, which remember the missing ones that a piece would have used."""

    def __init__(self, cubes_: Mapping[str, xr.Dataset], without: Iterable[str]) -> None:
        super().__init__(cubes_)
        self.without = frozenset(without)
        self.wanted: set[str] = set()

    def __missing__(self, name: str) -> xr.Dataset:
        self.wanted.add(name)
        raise KeyError(name)
