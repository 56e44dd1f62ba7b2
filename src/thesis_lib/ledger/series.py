"""Errors of cubes as series, on which trends are judged."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts.claims import Trend, read_trends
from thesis_lib.ledger.verdicts import point_errors
from thesis_lib.studies import cubes

RESAMPLE_COUNT = 2000
SECOND_LARGEST = "second_point_error"  # the largest of the markers' but one


@dataclass(frozen=True)
class Series:
    """One error of the settings of a case, in the order of what is varied."""

    #: Which error, of which case
    quantity: str
    case: str
    mode: int  #: Of which mode
    values: Array  #: The varied parameter, growing, shape (settings,)
    #: In %, of the random trials; NaN where there is no reference, shape (settings, trials)
    errors: Array
    _means: dict[int, Array] = field(default_factory=dict, compare=False, repr=False)

    def means(self, seed: int) -> Array:
        """Return the means over resampled trials, shape (settings, resamples), computed once."""
        if seed not in self._means:
            self._means[seed] = self.errors @ _weights(self.errors.shape[1], seed)
        return self._means[seed]


@lru_cache(maxsize=8)
def _weights(trials: int, seed: int) -> Array:
    """Draw weights of resampled means, (trials, resamples), with replacement."""
    drawn = np.random.default_rng(seed).multinomial(
        trials, np.full(trials, 1 / trials), RESAMPLE_COUNT
    )
    return np.asarray(drawn.T / trials)


@cache
def _sets_with(quantity: str) -> frozenset[str]:
    """Return the figure sets of which some trend states a quantity."""
    stated = (trend for trend in read_trends() if quantity in trend.quantities)
    return frozenset(name for trend in stated for name in trend.source)


def series_of(cube: xr.Dataset, name: Callable[[str], str] = str) -> list[Series]:
    """Return the errors of a cube's random trials, case by case; `name` renames cases."""
    kinds = dict(cubes.cube_errors(cube))
    if "deflection_error" in cube:
        kinds["deflection_error"] = cube["deflection_error"]
    if cube.attrs["figure_set"] in _sets_with(SECOND_LARGEST):
        kinds[SECOND_LARGEST] = point_errors(cube).isel(point=-2, drop=True)
    if {"lost", "wrong"} <= set(cube):  # of the laboratory, once for all trials
        failures = 100 * (cube["lost"] + cube["wrong"].fillna(0))
        kinds["tracking_failures"] = failures.expand_dims(mode=cube["mode"], trial=[0, 1])
    found = []
    for case in dict.fromkeys(cube["case"].values.tolist()):
        rows = np.flatnonzero(cube["case"].values == case)
        rows = rows[np.argsort(cube["value"].values[rows], kind="stable")]
        values = cube["value"].values[rows].astype(float)
        for quantity, errors in kinds.items():
            chosen = errors.isel(setting=rows, trial=slice(1, None))
            table = chosen.transpose("mode", "setting", "trial").values.astype(float)
            found += [
                Series(quantity, name(case), int(mode), values, part)
                for mode, part in zip(cube["mode"].values, table, strict=True)
            ]
    if "tracking_missing" in cube:
        failures = 100 * (cube["tracking_missing"] + cube["tracking_wrong"].fillna(0))
        widths = cube["tracked_width"].values.astype(float)
        found.append(
            Series(
                "tracking_failures", "tracking", 1, widths, failures.values[:, None].astype(float)
            )
        )
    return found


Key = tuple[str, str, int]  # quantity, case, mode


@dataclass(frozen=True)
class Evidence:
    """What a trend is tested on: series by quantity, case and mode, and draws of their errors."""

    trend: Trend
    known: Mapping[Key, Series]
    draw: Callable[[Series], Array]  #: Returns errors of shape (settings, draws)
    one_run: bool = False  #: Whether each draw is a single run, not an expectation

    def errors(self, quantity: str, case: str, mode: int) -> Array:
        """Return the draws of one error, of shape (settings, draws); KeyError if it is missing."""
        return self.draw(self.known[quantity, case, mode])

    @property
    def values(self) -> dict[str, Array]:
        """Return the varied parameter by case."""
        return {case: one.values for (_, case, _), one in self.known.items()}

    @property
    def cases(self) -> tuple[str, ...]:
        """Return the cases that the trend speaks of."""
        return self.trend.cases or tuple(self.values)

    @property
    def named(self) -> list[tuple[Key, Array]]:
        """Errors of all that the trend speaks of and that has a reference, and what they are of."""
        spoken_of = [
            ((quantity, case, mode), self.errors(quantity, case, mode))
            for quantity, case, mode in self.known
            if case in self.cases and mode in self.trend.modes and quantity in self.trend.quantities
        ]
        return [(key, errors) for key, errors in spoken_of if np.isfinite(errors).all()]

    @property
    def series(self) -> list[Array]:
        """Return the errors of all that the trend speaks of and that has a reference."""
        return [errors for _, errors in self.named]

    def of_modes(self, quantity: str) -> dict[int, Array]:
        """Return the geometric mean over all settings of the cases, by mode: shape (draws,)."""
        by: dict[int, list[Array]] = {}
        for name, case, mode in self.known:
            if name == quantity and case in self.cases:
                errors = self.errors(name, case, mode)
                if np.isfinite(errors).all():
                    by.setdefault(mode, []).append(np.log(errors))
        return {mode: np.exp(np.concatenate(logs).mean(axis=0)) for mode, logs in by.items()}

    def pairs(self, other: str) -> Iterator[tuple[Array, Array, str]]:
        """Yield the errors of the trend's own case and of another, for each quantity and mode."""
        for quantity in self.trend.quantities:
            for mode in self.trend.modes:
                own = self.errors(quantity, self.cases[0], mode)
                second = self.errors(quantity, other, mode)
                if np.isfinite(own).all() and np.isfinite(second).all():
                    yield own, second, quantity
