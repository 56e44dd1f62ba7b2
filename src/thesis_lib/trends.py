"""What the thesis says of trends, tested in expectation.

A trend is a statement on expected errors: the mean of a setting's error over the random shifts of
the pixel grids. It is tested on resamples of the trials, the same in every setting; the share of
resamples in which it holds is its *confidence*. The share of single trials in which it holds tells
how often somebody with one run, such as the thesis, would see it.

What the words mean is set here, once for all trends:

falls (rises)
    The last expected error is below (above) the first, and more pairs of settings are in this order
    than in the other.
flat
    The largest is at most ``FLAT`` times the least.
alike
    The means (geometric, over the settings) are at most ``ALIKE`` times each other.
no trend
    It neither falls nor rises, or is flat.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from thesis_lib.setups import data_folder

Array = NDArray[np.float64]
Holds = NDArray[np.bool_]
FLAT = 2.0  # the thesis calls 7 to 3.5 % a significant fall, and 8-18 % none
ALIKE = 1.5  # it calls modes within 10-15 % alike
CONFIDENT = 0.95
RESAMPLES = 2000
LISTS = ("cases", "modes", "quantities", "source")
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
    """How surely a trend holds in expectation, and in which share of single runs it shows."""

    confidence: float
    single: float

    @property
    def verdict(self) -> str:
        """One word of the ledger: agrees, within scatter or differs."""
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
    if text.partition(" ")[0] not in TESTS:
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
    return Finding(*shares)


@lru_cache(maxsize=8)
def _weights(trials: int, seed: int) -> Array:
    """Weights of resampled means, shape (trials, resamples): with replacement, from one seed."""
    drawn = np.random.default_rng(seed).multinomial(trials, np.full(trials, 1 / trials), RESAMPLES)
    return np.asarray(drawn.T / trials)


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


def _all(parts: Iterable[Any]) -> Holds:
    compared = list(parts)
    if not compared:
        raise LookupError("nothing to compare")
    return np.asarray(np.logical_and.reduce(compared))


def _down(errors: Array) -> Holds:
    ordered = sum(np.sign(errors[i] - errors[j]) for i, j in combinations(range(len(errors)), 2))
    return np.asarray((errors[-1] < errors[0]) & (ordered > 0))


def _flat(errors: Array) -> Holds:
    return np.asarray(errors.max(axis=0) <= FLAT * errors.min(axis=0))


def _steps_down(errors: Array) -> Holds:
    return np.asarray((np.diff(errors, axis=0) < 0).all(axis=0))


def _trendless(errors: Array) -> Holds:
    return ~(_down(errors) | _down(errors[::-1])) | _flat(errors)


def _close(first: Array, second: Array) -> Holds:
    return np.asarray(np.maximum(first, second) <= ALIKE * np.minimum(first, second))


def _falls(evidence: Evidence, _: str) -> Holds:
    return _all(_down(errors) for errors in evidence.series)


def _rises(evidence: Evidence, _: str) -> Holds:
    return _all(_down(errors[::-1]) for errors in evidence.series)


def _falls_steadily(evidence: Evidence, _: str) -> Holds:
    return _all(_steps_down(errors) for errors in evidence.series)


def _falls_irregularly(evidence: Evidence, _: str) -> Holds:
    return _all((e[-1] < e[0]) & ~_steps_down(e) for e in evidence.series)


def _is_flat(evidence: Evidence, _: str) -> Holds:
    return _all(_flat(errors) for errors in evidence.series)


def _no_trend(evidence: Evidence, _: str) -> Holds:
    return _all(_trendless(errors) for errors in evidence.series)


def _mostly_no_trend(evidence: Evidence, _: str) -> Holds:
    return np.mean([_trendless(errors) for errors in evidence.series], axis=0) > 0.5


def _same_pattern(evidence: Evidence, _: str) -> Holds:
    return _falls(evidence, "") | _rises(evidence, "")


def _below(evidence: Evidence, argument: str) -> Holds:
    """``below 40``, ``below 10 last``: at most that, rounded as it is printed."""
    bound, _, which = argument.partition(" ")
    most = float(bound) + 0.5 * 10.0 ** -len(bound.partition(".")[2])
    parts = {"": slice(None), "first": slice(1), "last": slice(-1, None)}
    return _all((errors[parts[which]] <= most).all(axis=0) for errors in evidence.series)


def _above(evidence: Evidence, argument: str) -> Holds:
    """``above 5 first``: at least one of the series is above that in its first setting."""
    bound, _, _ = argument.partition(" ")
    return np.logical_or.reduce([errors[0] > float(bound) for errors in evidence.series])


def _peaks(evidence: Evidence, argument: str) -> Holds:
    """``peaks 1000``: largest where the varied parameter has this value."""
    (at,) = np.flatnonzero(evidence.values[evidence.cases[0]] == float(argument))
    return _all(np.argmax(errors, axis=0) == at for errors in evidence.series)


def _highest_last(evidence: Evidence, _: str) -> Holds:
    return _all(np.argmax(errors, axis=0) == len(errors) - 1 for errors in evidence.series)


def _modes_alike(evidence: Evidence, _: str) -> Holds:
    means = [evidence.of_modes(quantity) for quantity in evidence.trend.quantities]
    chosen = [[m[mode] for mode in evidence.trend.modes if mode in m] for m in means]
    return _all(_close(a, b) for modes in chosen for a, b in combinations(modes, 2))


def _worst_mode(evidence: Evidence, argument: str) -> Holds:
    """``worst_mode 3``: the mode's mean is above that of each other mode."""
    means = [evidence.of_modes(quantity) for quantity in evidence.trend.quantities]
    mode = int(argument)
    return _all(by[mode] > by[m] for by in means if mode in by for m in by if m != mode)


def _best_mode(evidence: Evidence, argument: str) -> Holds:
    means = [evidence.of_modes(quantity) for quantity in evidence.trend.quantities]
    mode = int(argument)
    lower = _all(by[mode] < by[m] for by in means if mode in by for m in by if m != mode)
    return lower & _falls(evidence, "")


def _planes_alike(evidence: Evidence, argument: str) -> Holds:
    """Both planes, or with ``planes_alike XZ 2 1`` a plane in two modes."""
    if argument:
        plane, mode, other = argument.split()
        by = evidence.of_modes(f"plane_error_{plane.lower()}")
        empty = "plane_error_yz" if plane == "XZ" else "plane_error_xz"
        nodal = [
            np.isnan(errors).all()
            for (quantity, _, m), errors in evidence.errors.items()
            if quantity == empty and m == int(mode)
        ]
        return _close(by[int(mode)], by[int(other)]) & all(nodal)
    mode = str(evidence.trend.modes[0])
    first, second = (evidence.of_modes(f"plane_error_{p}")[int(mode)] for p in ("xz", "yz"))
    return _close(first, second)


def _like_case(evidence: Evidence, argument: str) -> Holds:
    """``like_case 4a last``: means, or last errors, as another case's."""
    other, _, which = argument.partition(" ")
    return _all(
        _close(a[-1], b[-1]) if which == "last" else
        _close(np.exp(np.log(a).mean(axis=0)), np.exp(np.log(b).mean(axis=0)))
        for a, b, _ in evidence.pairs(other)
    )  # fmt: skip


def _below_case(evidence: Evidence, argument: str) -> Holds:
    """``below_case 4a first``: first errors, or those at the same values, below another case's."""
    other, which = argument.rsplit(" ", 1)
    if which == "first":
        return _all(a[0] < b[0] for a, b, _ in evidence.pairs(other))
    common = np.intersect1d(evidence.values[evidence.cases[0]], evidence.values[other])
    own, others = (
        np.searchsorted(evidence.values[case], common) for case in (evidence.cases[0], other)
    )
    return _all((a[own] < b[others]).all(axis=0) for a, b, _ in evidence.pairs(other))


def _gentler(evidence: Evidence, argument: str) -> Holds:
    """``gentler 4a``: falls by a smaller factor than another case does."""
    return _all(a[0] / a[-1] < b[0] / b[-1] for a, b, _ in evidence.pairs(argument))


def _best_case(evidence: Evidence, argument: str) -> Holds:
    """``best_case 2a``: of all cases, this one has the least mean."""
    holds = []
    for quantity in evidence.trend.quantities:
        for mode in evidence.trend.modes:
            mean = {
                case: np.log(evidence.errors[quantity, case, mode]).mean(axis=0)
                for case in evidence.cases
            }
            holds += [mean[argument] < mean[case] for case in mean if case != argument]
    return _all(holds)


def _unrelated(evidence: Evidence, argument: str) -> Holds:
    """``unrelated deflection_error``: a rank correlation over all settings of at most ½."""
    holds = []
    for quantity in evidence.trend.quantities:
        for mode in evidence.trend.modes:
            cases = [
                case for case in evidence.cases
                if np.isfinite(evidence.errors[quantity, case, mode]).all()
            ]  # fmt: skip
            if not cases:
                continue
            pair = (
                np.concatenate([evidence.errors[name, case, mode] for case in cases])
                for name in (quantity, argument)
            )
            a, b = (rankdata(errors, axis=0) - (len(errors) + 1) / 2 for errors in pair)
            norm = np.sqrt(np.sum(a**2, axis=0) * np.sum(b**2, axis=0))
            holds.append(np.abs(np.sum(a * b, axis=0)) <= 0.5 * norm)
    return _all(holds)


TESTS: dict[str, Callable[[Evidence, str], Holds]] = {
    "falls": _falls,
    "rises": _rises,
    "falls_steadily": _falls_steadily,
    "falls_irregularly": _falls_irregularly,
    "flat": _is_flat,
    "no_trend": _no_trend,
    "mostly_no_trend": _mostly_no_trend,
    "same_pattern": _same_pattern,
    "below": _below,
    "above": _above,
    "peaks": _peaks,
    "highest_last": _highest_last,
    "modes_alike": _modes_alike,
    "worst_mode": _worst_mode,
    "best_mode": _best_mode,
    "planes_alike": _planes_alike,
    "like_case": _like_case,
    "below_case": _below_case,
    "gentler": _gentler,
    "best_case": _best_case,
    "unrelated": _unrelated,
}
