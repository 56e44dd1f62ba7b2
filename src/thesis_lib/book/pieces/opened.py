"""Cubes that a page is made of, opened once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import xarray as xr


class Opened(dict[str, xr.Dataset]):
    """Cubes by name, which remember the missing ones that a piece would have used."""

    def __init__(self, cubes_: Mapping[str, xr.Dataset], without: Iterable[str]) -> None:
        super().__init__(cubes_)
        self.without = frozenset(without)
        self.wanted: set[str] = set()

    def __missing__(self, name: str) -> xr.Dataset:
        self.wanted.add(name)
        raise KeyError(name)
