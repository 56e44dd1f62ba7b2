"""The cube of the ledger."""

from __future__ import annotations

import xarray as xr

from thesis_lib.facts import claims
from thesis_lib.figure_sets.claims.parameters import Claims
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.figure_sets.run import computed
from thesis_lib.studies.attributes import with_provenance
from thesis_lib.studies.cache import cached
from thesis_lib.studies.request import Study


def ledger_of(request: Claims) -> xr.Dataset:
    """The ledger's cube, from the book's cubes; one that is missing or outdated is made here."""
    from thesis_lib.figure_sets.claims import own_runs as ledger_runs
    from thesis_lib.figure_sets.claims import power, readings
    from thesis_lib.ledger import cube as ledger_cube
    from thesis_lib.ledger import entries as ledger

    opened: dict[str, xr.Dataset] = {}

    def open_cube(study: Study) -> xr.Dataset:
        if study.name not in opened:
            made = ledger.built(study)
            if isinstance(made, str):
                made = with_provenance(computed(study), study, 0.0)
            opened[study.name] = made
        return opened[study.name]

    own = cached(request.own_runs, ledger_runs.run)
    other = cached(request.other_readings, readings.run)
    found = ledger.entries(open_cube, ledger_runs.read_own(own))
    tested = power.power(lambda name: open_cube(STUDIES[name]()), claims.read_claims())
    return ledger_cube.as_cube(found, other.merge(tested))
