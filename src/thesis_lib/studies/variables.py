"""Variables of cubes, declared in lines.

Each is ``name(dimensions) [unit] what it is``::

    rate(camera) [Hz] frames per second
    tracks(camera, frame, axis) [px] centres of the markers, where they
        were found
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from textwrap import dedent
from typing import Any

import numpy as np

_LINE = re.compile(r"(?P<name>\w+)\((?P<dims>[\w, ]*)\) \[(?P<units>[^]]+)\] (?P<words>.+)")


@dataclass(frozen=True)
class Variable:
    """What the values of a variable are."""

    dims: tuple[str, ...]  #: Its dimensions
    #: Unit, "1" if it has none, and words
    units: str
    long_name: str

    @property
    def attributes(self) -> dict[str, str]:
        """As they stand in a file."""
        return {"units": self.units, "long_name": self.long_name}

    def of(self, values: Any, over: Iterable[str] = ()) -> tuple[tuple[str, ...], Any, Any]:
        """Values with their dimensions, after those that they have beside, and attributes."""
        return (*over, *self.dims), np.asarray(values), self.attributes


def declared(lines: str) -> dict[str, Variable]:
    """The variables that some lines declare; what is indented further goes on with a line.

    Examples
    --------
    >>> declared("rate(camera) [Hz] frames per second")
    {'rate': Variable(dims=('camera',), units='Hz', long_name='frames per second')}

    Raises
    ------
    ValueError
        Naming a line that declares nothing, or a name again.
    """
    found: dict[str, Variable] = {}
    for line in re.sub(r"\n\s+", " ", dedent(lines).strip()).splitlines():
        said = _LINE.fullmatch(line)
        if said is None or said["name"] in found:
            raise ValueError(f"given {line!r}, allowed: name(dimensions) [unit] words, once each")
        dims = tuple(filter(None, said["dims"].split(", ")))
        found[said["name"]] = Variable(dims, said["units"], said["words"])
    return found


def labelled(
    values: Mapping[str, Any], table: Mapping[str, Variable], over: Iterable[str] = ()
) -> dict[str, tuple[tuple[str, ...], Any, Any]]:
    """Values as variables of a dataset, in the order in which they come."""
    return {name: table[name].of(each, over) for name, each in values.items()}
