"""How a stated trend is judged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.facts.trends import Trend
from thesis_lib.ledger.evidence import Drawn, Evidence, Key
from thesis_lib.ledger.trend_tests import TESTS, is_less
from thesis_lib.ledger.verdicts import UNCHANGED

CONFIDENT = 0.95
RESAMPLES = 2000
DIRECTIONS = {"falls": -1, "falls_steadily": -1, "rises": 1}  # tests of an end against the other


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
        """Means over resampled trials, shape (settings, resamples), computed once."""
        if seed not in self._means:
            self._means[seed] = self.errors @ _weights(self.errors.shape[1], seed)
        return self._means[seed]


@dataclass(frozen=True)
class Finding:
    """How surely a trend holds in expectation, in which share of single runs, and how strongly.

    Effects are NaN, and no step goes back, for trends that are no rise or fall.
    """

    confidence: float
    single: float
    #: Expected error at the last setting over that at the first, of the errors that are named:
    #: where it changes least in the stated direction, and where it changes most
    effect: float = field(default=float("nan"), compare=False)
    largest_effect: float = field(default=float("nan"), compare=False)
    #: The largest step against the trend, if it is a material one: said beside the verdict, as
    #: the trend is not monotonic
    step_back: str = field(default="", compare=False)

    @property
    def verdict(self) -> str:
        """One word of the ledger: agrees, within scatter, differs or no material change."""
        if _are_unchanged(np.array([self.effect, self.largest_effect])):
            return UNCHANGED
        if self.confidence >= CONFIDENT:
            return "agrees"
        chance = 1 - CONFIDENT
        return "within scatter" if max(self.confidence, self.single) > chance else "differs"


def judge(trend: Trend, series: Iterable[Series], seed: int = 0) -> Finding | None:
    """Test a trend on what was computed.

    Parameters
    ----------
    trend : Trend
        What is stated.
    series : iterable of Series
        Errors of all the cases, modes and quantities of its source.
    seed : int
        Of the resampling.

    Returns
    -------
    Finding or None
        None if nothing of what it speaks of, or compares with, is among the series.
    """
    kept = {(s.quantity, s.case, s.mode): s for s in series if s.errors.shape[1]}
    if not kept:
        return None
    values = {s.case: s.values for s in kept.values()}
    common = min((n for s in kept.values() if (n := s.errors.shape[1]) > 1), default=1)
    mean = Drawn(kept, lambda one: one.means(seed))
    # Paired, trial by trial; what is the same in all trials stands beside each of them.
    each = Drawn(
        kept, lambda one: np.broadcast_to(one.errors[:, :common], (len(one.errors), common))
    )
    name, _, argument = trend.test.partition(" ")
    shares = []
    for errors in (mean, each):
        evidence = Evidence(trend, errors, values, one_run=errors is each)
        if not evidence.series:
            return None
        try:
            shares.append(float(np.mean(TESTS[name](evidence, argument))))
        except LookupError:  # what it is compared with is missing
            return None
    if name not in DIRECTIONS:
        return Finding(shares[0], shares[1])
    expected = {key: draws.mean(axis=1) for key, draws in Evidence(trend, mean, values).named}
    least, most = _effects(expected.values(), DIRECTIONS[name])
    return Finding(
        shares[0], shares[1], least, most, _step_back(expected, values, DIRECTIONS[name])
    )


def _are_unchanged(effects: Array) -> bool:
    """Return whether no error is materially below the other, of some factors between two."""
    one = np.ones_like(effects)
    known = np.isfinite(effects).all()
    return bool(known and not (is_less(effects, one) | is_less(one, effects)).any())


def _effects(expected: Iterable[Array], direction: int) -> tuple[float, float]:
    """Return the last error over the first, where it changes least in a direction, and most."""
    ends = np.array([[errors[0], errors[-1]] for errors in expected])
    if not ends[:, 0].all():
        return float("nan"), float("nan")
    ratios = ends[:, 1] / ends[:, 0]
    least, most = (ratios.min(), ratios.max())[::direction]
    return float(least), float(most)


def _step_back(expected: Mapping[Key, Array], values: Mapping[str, Array], direction: int) -> str:
    """Describe the largest step between neighbours against a trend; empty if none is material."""
    steps = [
        (less / more, key, at)
        for key, errors in expected.items()
        for at in range(len(errors) - 1)
        for less, more in [errors[[at, at + 1]][::-direction]]
        if is_less(less, more)
    ]
    if not steps:
        return ""
    _, (quantity, case, mode), at = min(steps)
    errors, settings = expected[quantity, case, mode], values[case]
    of = f", mode {mode} of {case}" if len(expected) > 1 else ""
    return " but ".join(f"{errors[i]:.3g} at {settings[i]:g}" for i in (at, at + 1)) + of


@lru_cache(maxsize=8)
def _weights(trials: int, seed: int) -> Array:
    """Weights of resampled means, shape (trials, resamples): with replacement, from one seed."""
    drawn = np.random.default_rng(seed).multinomial(trials, np.full(trials, 1 / trials), RESAMPLES)
    return np.asarray(drawn.T / trials)
