"""The ledger: every claim of the thesis."""

from thesis_lib.figure_sets.claims.parameters import Claims
from thesis_lib.figure_sets.figure_set import FigureSet, Inputs, Product
from thesis_lib.studies.request import Study

LEDGER_ROOMS = ("figure_sets/parametric", "laboratory", "ledger", "measure")
OWN_RUNS = Product(module=f"{__package__}.own_runs", rooms=LEDGER_ROOMS, kept=True)
OTHER_READINGS = Product(module=f"{__package__}.readings", rooms=LEDGER_ROOMS, kept=True)


def needs(asked: Claims) -> Inputs:
    """Return the ledger's own runs and interpretations; it opens cubes of figure sets itself."""
    return {"own": (OWN_RUNS, asked.own_runs), "other": (OTHER_READINGS, asked.other_readings)}


def reads() -> list[Study]:
    """Return the requests whose cubes it judges: all other figure sets, as in the thesis."""
    from thesis_lib.figure_sets.registry import STUDIES

    return [request() for name, request in STUDIES.items() if name != Claims.name]


FIGURE_SETS = [
    FigureSet(
        request=Claims,
        chapter="",
        module=f"{__package__}.compute",
        rooms=LEDGER_ROOMS,
        needs=needs,
        reads=reads,
    )
]
