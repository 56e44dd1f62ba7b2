"""Cubes that a page is made of, opened once, when they are first asked for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.registry import STUDIES

Cubes = Mapping[str, xr.Dataset]


def of_subject(opened: Cubes, subject: str) -> list[xr.Dataset]:
    """Return the cubes of a subject, such as ``beam``."""
    return [opened[name] for name in opened if STUDIES[name].subject == subject]


def of_chapter(opened: Cubes, subject: str) -> list[xr.Dataset]:
    """Return the cubes of a subject, all of which the chapter needs."""
    if isinstance(opened, Opened):
        opened.wanted |= {name for name in opened.without if STUDIES[name].subject == subject}
    return of_subject(opened, subject)


class Opened(Mapping[str, xr.Dataset]):
    """Cubes by name, which remember what a piece used, and what it would have used."""

    def __init__(self, made: Iterable[Path], without: Iterable[str]) -> None:
        self._files = {path.stem: path for path in made}
        self._read: dict[str, xr.Dataset] = {}
        self.derived: dict[Any, Any] = {}  #: What was computed of them, by what was asked
        self.without = frozenset(without)
        self.forget()

    def forget(self) -> None:
        """Begin another piece."""
        self.used, self.wanted = set[str](), set[str]()

    def __getitem__(self, name: str) -> xr.Dataset:
        if name not in self._files:
            self.wanted.add(name)
            raise KeyError(name)
        self.used.add(name)
        if name not in self._read:
            self._read[name] = cube_file.read_cube(self._files[name])
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return name in self._files

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)
