"""What the thesis says of trends, tested in expectation.

A trend is a statement on expected errors: the mean of a setting's error over the random shifts of
the pixel grids. It is tested on resamples of the trials, the same in every setting; the share of
resamples in which it holds is its *confidence*. The share of single trials in which it holds tells
how often somebody with one run, such as the thesis, would see it.

A trend that says that an error falls or rises has an *effect*, too: by what factor the expected
error changes from the first to the last setting, of all the errors that it names the one that
changes least in the stated direction. Within ``MATERIAL`` of 1 it is no material change, however
sure its sign.

What the words mean is set in ``trend_tests.py``, once for all trends.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from thesis_lib.claims import UNCHANGED
from thesis_lib.setups import data_folder
from thesis_lib.trend_tests import ARGUMENTS, MATERIAL, TESTS, Evidence

Array = NDArray[np.float64]
CONFIDENT = 0.95
RESAMPLES = 2000
LISTS = ("cases", "modes", "quantities", "source")
WEAKEST = {"falls": np.max, "falls_steadily": np.max, "rises": np.min}
NEEDED = ("id", "section", "modes", "quantities", "words", "source")


@dataclass(frozen=True)
class Trend:
    """One trend that the thesis states.

    Parameters
    ----------
    id, section, kind, parameter, words : str
        Where it stands and what it says, in a few words.
    chapter : int
        Chapter of the thesis.
    cases, quantities : tuple of str
        What it speaks of; no case means all of the source.
    modes : tuple of int
        Modes it speaks of.
    source : tuple of str
        Figure sets, or runs of the ledger's own, that it is judged by.
    test : str
        Name of one of ``TESTS``, and its argument.
    """

    id: str
    chapter: int
    section: str
    cases: tuple[str, ...]
    modes: tuple[int, ...]
    quantities: tuple[str, ...]
    kind: str
    parameter: str
    words: str
    source: tuple[str, ...]
    test: str


@dataclass(frozen=True)
class Series:
    """One error of the settings of a case, in the order of what is varied.

    Parameters
    ----------
    quantity, case : str
        Which error, of which case.
    mode : int
        Of which mode.
    values : ndarray, shape (settings,)
        The varied parameter, growing.
    errors : ndarray, shape (settings, trials)
        In %, of the random trials; NaN where there is no reference.
    """

    quantity: str
    case: str
    mode: int
    values: Array
    errors: Array


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


def read_trends() -> list[Trend]:
    """The stated trends, from ``data/thesis/trends.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    trends: list[Trend] = []
    expected = [field.name for field in fields(Trend)]
    with (data_folder() / "trends.csv").open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file, restkey="more")
        if rows.fieldnames != expected:
            given = ", ".join(rows.fieldnames or ())
            raise ValueError(f"trends.csv, line 1: given {given}, allowed: {', '.join(expected)}")
        for line, row in enumerate(rows, 2):
            known = [trend.id for trend in trends]
            for name, text in row.items():
                fits = isinstance(text, str) and bool(text or name not in NEEDED)
                if not fits or (name == "id" and text in known):
                    raise _refusal(line, name, text)
            values: dict[str, object] = dict(row)
            for name in LISTS:
                values[name] = tuple(filter(None, row[name].split(";")))
            for name, kind in (("chapter", int), ("modes", _numbers), ("test", _known)):
                try:
                    values[name] = kind(row[name])
                except (TypeError, ValueError):
                    raise _refusal(line, name, row[name]) from None
            trends.append(Trend(**values))  # type: ignore[arg-type]
    return trends


def _refusal(line: int, name: str, given: object) -> ValueError:
    return ValueError(f"trends.csv, line {line}: {name}: given {given!r}")


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(number) for number in text.split(";") if number)


def _known(text: str) -> str:
    name, _, argument = text.partition(" ")
    if name not in TESTS or not re.fullmatch(ARGUMENTS.get(name, ""), argument):
        raise ValueError(text)
    return text


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
    mean = {key: one.errors @ _weights(one.errors.shape[1], seed) for key, one in kept.items()}
    each = {  # paired, trial by trial; what is the same in all trials beside each of them
        key: np.broadcast_to(one.errors[:, :common], (len(one.errors), common))
        for key, one in kept.items()
    }
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
