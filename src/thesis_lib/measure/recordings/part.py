"""What all parts of a manifest share."""

from __future__ import annotations

from thesis_lib.studies.refusals import permitted, refuse
from thesis_lib.studies.vocabulary import Fields

Place = tuple[float, float]


class Part(Fields):
    """What all parts of a manifest share."""

    def refuse(self, name: str, why: str = "") -> None:
        """Refuse the value of a field, by what it allows if no other reason is given."""
        refuse(name, getattr(self, name), why or permitted(type(self), name))
