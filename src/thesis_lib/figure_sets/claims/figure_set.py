"""Parameters of the ledger: alternative interpretations, and trials of its own runs."""

from typing import Literal

from thesis_lib.facts.setups import ADOPTED_READING, READINGS
from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.studies.fields import Distinct, Seed, Shifts
from thesis_lib.studies.request import Study


class Claims(Study):
    """The ledger: every claim of the thesis compared with this book's results."""

    name = "claims"
    title = "The ledger: every claim of the thesis"
    subject = "claims"
    section = "all chapters"
    study = "claims"
    varied = "claim"
    varied_label = "claim"

    trials: Shifts = 200
    """random shifts of the pixel grids in the ledger's own runs"""
    seed: Seed = 0
    """seed of the ledger's own runs"""
    readings: Distinct[Literal[*READINGS]] = [  # type: ignore[valid-type]
        name for name in READINGS if name != ADOPTED_READING
    ]
    """interpretations of what the thesis leaves open, to compare with the adopted one"""


def reads() -> list[Study]:
    """Return the requests whose cubes are judged: all other figure sets with their defaults."""
    from thesis_lib.figure_sets.registry import STUDIES

    return [request() for name, request in STUDIES.items() if name != Claims.name]


FIGURE_SETS = [
    FigureSet(
        request=Claims,
        chapter="",
        module=f"{__package__}.compute",
        rooms=("figure_sets/parametric", "laboratory", "ledger", "measure"),
        reads=reads,
    )
]
