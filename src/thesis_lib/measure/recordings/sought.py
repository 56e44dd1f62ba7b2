"""Which modes a manifest asks for."""

from __future__ import annotations

import numpy as np
from pydantic import model_validator

from thesis_lib.studies.refusals import Refusing
from thesis_lib.studies.vocabulary import Positive, field


class Sought(Refusing):
    """Which modes or tones are looked for, where there are several."""

    from_hz: Positive = field(2.0, "lowest frequency")
    to_hz: Positive | None = field(
        None,
        "highest frequency; null is half of the lowest frame rate, above which cameras must differ "
        "in rate or start",
        "null, or a number above from_hz",
    )
    count: int | None = field(
        None,
        "how many; null takes all that stand out of the noise",
        "null, or 1 to 20",
        ge=1,
        le=20,
    )
    near_hz: tuple[Positive, ...] | None = field(
        None,
        "frequencies near which they are; replaces count",
        "null, or a list of 1 to 20 between from_hz and to_hz",
        min_length=1,
        max_length=20,
    )

    @model_validator(mode="after")
    def _check(self) -> Sought:
        if self.to_hz is not None and self.to_hz <= self.from_hz:
            self.refuse("to_hz")
        high = self.to_hz or np.inf
        if self.near_hz and not all(self.from_hz <= f <= high for f in self.near_hz):
            self.refuse("near_hz")
        return self
