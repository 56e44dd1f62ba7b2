"""How a stated trend is judged."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.facts.trends import Trend
from thesis_lib.ledger.evidence import Drawn, Evidence
from thesis_lib.ledger.trend_tests import MATERIAL, TESTS
from thesis_lib.ledger.verdicts import UNCHANGED

CONFIDENT = 0.95
RESAMPLES = 2000
WEAKEST = {"falls": np.max, "falls_steadily": np.max, "rises": np.min}


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

    The effect is NaN for trends that are no rise or fall.
    """

    confidence: float
    single: float
    effect: float = field(default=float("nan"), compare=False)

    @property
    def verdict(self) -> str:
        """One word of the ledger: agrees, within scatter, differs or no material change."""
        if abs(self.effect - 1) <= MATERIAL:
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
        evidence = Evidence(trend, errors, values)
        if not evidence.series:
            return None
        try:
            shares.append(float(np.mean(TESTS[name](evidence, argument))))
        except LookupError:  # what it is compared with is missing
            return None
    spoken_of = Evidence(trend, mean, values).series
    return Finding(shares[0], shares[1], _effect(name, spoken_of))


def _effect(test: str, series: Iterable[Array]) -> float:
    """Expected error at the last setting over that at the first, where it changes least."""
    if test not in WEAKEST:
        return float("nan")
    first, last = (np.array([np.mean(errors[at]) for errors in series]) for at in (0, -1))
    if not first.all():
        return float("nan")
    return float(WEAKEST[test](last / first))


@lru_cache(maxsize=8)
def _weights(trials: int, seed: int) -> Array:
    """Weights of resampled means, shape (trials, resamples): with replacement, from one seed."""
    drawn = np.random.default_rng(seed).multinomial(trials, np.full(trials, 1 / trials), RESAMPLES)
    return np.asarray(drawn.T / trials)
