"""What may be asked of the search: topics to change, draws, and theses to invent."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from thesis_lib.figure_sets.misses.changes import CHANGES, TOPICS, Change
from thesis_lib.studies.refusals import refuse
from thesis_lib.studies.request import Study
from thesis_lib.studies.vocabulary import Shifts, field


class Misses(Study):
    """What chapter 3 may have computed, one change at a time and two together."""

    name = "misses"
    title = "What explains the misses of chapter 3"
    subject = "claims"
    section = "section 3.3"
    study = "misses"
    varied = "change"
    varied_label = "change"

    topics: list[str] = field(
        lambda: list(TOPICS),
        "what may have been different in the thesis",
        f"a list of different ones of {', '.join(TOPICS)}; one at least",
        min_length=1,
    )
    trials: Shifts = field(40, "random shifts of the pixel grids, for each change")
    theses: Annotated[int, Field(ge=2, le=1000)] = field(
        100, "theses that are invented from what this book takes, to see what chance does"
    )
    together: Annotated[int, Field(ge=1, le=2)] = field(
        2, "how many changes at most are made together"
    )

    @model_validator(mode="after")
    def _check_topics(self) -> Misses:
        if unknown := [name for name in self.topics if name not in TOPICS]:
            refuse("topics", unknown[0], f"allowed: {', '.join(TOPICS)}")
        return self

    @property
    def changes(self) -> list[Change]:
        """The changes to make, in the order of the page."""
        return [change for change in CHANGES if change.topic in self.topics]
