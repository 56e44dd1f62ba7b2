"""The errors that a trend is tested on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from thesis_lib.arrays import Array

if TYPE_CHECKING:
    from thesis_lib.facts.trends import Trend


T = TypeVar("T")
Key = tuple[str, str, int]  # quantity, case, mode


class Drawn(Mapping[Key, Array]):
    """Draws of errors, made of those series alone that are asked for."""

    def __init__(self, series: Mapping[Key, T], draw: Callable[[T], Array]) -> None:
        self._made = {key: partial(draw, one) for key, one in series.items()}

    def __getitem__(self, key: Key) -> Array:
        return self._made[key]()

    def __iter__(self) -> Iterator[Key]:
        return iter(self._made)

    def __len__(self) -> int:
        return len(self._made)


@dataclass(frozen=True)
class Evidence:
    """What a trend is tested on: errors of shape (settings, draws) by quantity, case and mode."""

    trend: Trend
    errors: Mapping[Key, Array]
    values: Mapping[str, Array]
    one_run: bool = False  #: Whether each draw is a single run, not an expectation

    @property
    def cases(self) -> tuple[str, ...]:
        """Cases that the trend speaks of."""
        return self.trend.cases or tuple(self.values)

    @property
    def named(self) -> list[tuple[Key, Array]]:
        """Errors of all that the trend speaks of and that has a reference, and what they are of."""
        spoken_of = [
            ((quantity, case, mode), self.errors[quantity, case, mode])
            for quantity, case, mode in self.errors
            if case in self.cases and mode in self.trend.modes and quantity in self.trend.quantities
        ]
        return [(key, errors) for key, errors in spoken_of if np.isfinite(errors).all()]

    @property
    def series(self) -> list[Array]:
        """Errors of all that the trend speaks of and that has a reference."""
        return [errors for _, errors in self.named]

    def of_modes(self, quantity: str) -> dict[int, Array]:
        """Geometric mean over all settings of the cases, by mode: shape (draws,)."""
        by: dict[int, list[Array]] = {}
        for name, case, mode in self.errors:
            if name == quantity and case in self.cases:
                errors = self.errors[name, case, mode]
                if np.isfinite(errors).all():
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
