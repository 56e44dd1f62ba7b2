"""The cube of the ledger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import xarray as xr

from thesis_lib.facts import claims
from thesis_lib.figure_sets.claims.parameters import Claims
from thesis_lib.figure_sets.cube_file import built
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.figure_sets.run import cube_of
from thesis_lib.ledger.entries import Entry, Opener, entries
from thesis_lib.ledger.trends import Series
from thesis_lib.studies.request import Study


def judged(open_cube: Opener, own: Mapping[str, Sequence[Series]]) -> list[Entry]:
    """The ledger's entries, from the cubes of figure sets and the series of its own runs."""
    from thesis_lib.figure_sets.claims import own_runs

    commands = {name: source.commands for name, source in own_runs.own().items()}
    return entries(open_cube, own, STUDIES, commands)


def run(request: Claims, own: xr.Dataset, other: xr.Dataset) -> xr.Dataset:
    """The ledger's cube, from the book's cubes; one that is missing or outdated is made here."""
    from thesis_lib.figure_sets.claims import own_runs, power
    from thesis_lib.ledger import cube as ledger_cube
    from thesis_lib.ledger.reasons import explained

    opened: dict[str, xr.Dataset] = {}

    def open_cube(study: Study) -> xr.Dataset:
        if study.name not in opened:
            made = built(study)
            cube = cube_of(study) if isinstance(made, str) else made
            opened[study.name] = cube.reset_coords()  # each coordinate costs as much as judging
        return opened[study.name]

    found = explained(judged(open_cube, own_runs.read_own(own)), other)
    tested = power.power(lambda name: open_cube(STUDIES[name]()), claims.read_claims())
    return ledger_cube.as_cube(found, other.merge(tested))
