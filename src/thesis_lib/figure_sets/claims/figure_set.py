"""The ledger: every claim of the thesis."""

from thesis_lib.figure_sets.claims.parameters import Claims
from thesis_lib.figure_sets.figure_set import FigureSet, Inputs, Product

OWN_RUNS = Product(module=f"{__package__}.own_runs", kept=True)
OTHER_READINGS = Product(module=f"{__package__}.readings", kept=True)


def needs(asked: Claims) -> Inputs:
    """The ledger's own runs; the cubes of the figure sets it opens one by one."""
    return {
        "own": (OWN_RUNS, asked.own_runs),
        "other": (OTHER_READINGS, asked.other_readings),
    }


FIGURE_SETS = [
    FigureSet(request=Claims, chapter="", module=f"{__package__}.compute", needs=needs, judges=True)
]
