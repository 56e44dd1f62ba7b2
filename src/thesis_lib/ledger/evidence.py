"""The errors that a trend is tested on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.arrays import Array

if TYPE_CHECKING:
    from thesis_lib.facts.trends import Trend


@dataclass(frozen=True)
class Evidence:
    """What a trend is tested on: errors of shape (settings, draws) by quantity, case and mode."""

    trend: Trend
    errors: Mapping[tuple[str, str, int], Array]
    values: Mapping[str, Array]

    @property
    def cases(self) -> tuple[str, ...]:
        """Cases that the trend speaks of."""
        return self.trend.cases or tuple(self.values)

    @property
    def series(self) -> list[Array]:
        """Errors of all that the trend speaks of and that has a reference."""
        return [
            errors
            for (quantity, case, mode), errors in self.errors.items()
            if case in self.cases
            and mode in self.trend.modes
            and quantity in self.trend.quantities
            and np.isfinite(errors).all()
        ]

    def of_modes(self, quantity: str) -> dict[int, Array]:
        """Geometric mean over all settings of the cases, by mode: shape (draws,)."""
        by: dict[int, list[Array]] = {}
        for (name, case, mode), errors in self.errors.items():
            if name == quantity and case in self.cases and np.isfinite(errors).all():
                by.setdefault(mode, []).append(np.log(errors))
        return {mode: np.exp(np.concatenate(logs).mean(axis=0)) for mode, logs in by.items()}

    def pairs(self, other: str) -> Iterator[tuple[Array, Array, str]]:
        """Errors of the trend's own case and of another, for each quantity and mode."""
        for quantity in self.trend.quantities:
            for mode in self.trend.modes:
                own = self.errors[quantity, self.cases[0], mode]
                second = self.errors[quantity, other, mode]
                if np.isfinite(own).all() and np.isfinite(second).all():
                    yield own, second, quantity
