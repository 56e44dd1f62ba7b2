"""Judge claimed trends by expected errors.

A trend is a statement on expected errors: the mean of a setting's error over the random shifts of
the pixel grids. It is tested on resamples of the trials, the same in every setting; the share of
resamples in which it holds is its *confidence*. The share of single trials in which it holds shows
how often one run, such as the thesis's, would show it.

A falling or rising trend has *effects*, too: the factors by which expected errors change from the
first to the last setting, for the error that changes least in the claimed direction and for the
one that changes most. If no expected error changes by more than the smallest material effect,
``MIN_MATERIAL_FALL``, the verdict is *no material change*, however certain the sign. If an expected
error moves the other way by more than that between two neighbouring settings, the trend is not
monotonic, which is noted next to the verdict.

A test takes the :class:`~thesis_lib.ledger.verdicts.Evidence` and an argument, and returns for each
draw of the errors whether the statement holds.

The ledger's page and the functions below define the terms, for all trends alike. All use the same
smallest material effect, so no errors both fall and rise, and none of these are flat.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations, product
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.arrays import Array, Mask
from thesis_lib.facts.claims import Trend, half_digit
from thesis_lib.ledger.verdicts import UNCHANGED, Evidence, Key, Series

MIN_CONFIDENCE = 0.95
# Tests that compare the last setting with the first
TREND_DIRECTIONS = {"falls": -1, "falls_steadily": -1, "rises": 1}


@dataclass(frozen=True)
class Finding:
    """Confidence that a trend holds in expectation, its share of single runs, and its effects.

    For trends that are no rise or fall, effects are NaN and `step_back` is empty.
    """

    confidence: float
    single: float
    #: Expected error at the last setting over that at the first: of the trend's errors, the one
    #: that changes least in the claimed direction, and the one that changes most
    effect: float = field(default=float("nan"), compare=False)
    largest_effect: float = field(default=float("nan"), compare=False)
    #: The largest material step against the trend, which is then not monotonic; empty if none.
    #: It is noted next to the verdict
    step_back: str = field(default="", compare=False)

    @property
    def verdict(self) -> str:
        """Return the verdict: agrees, within scatter, differs or no material change."""
        effects = np.array([self.effect, self.largest_effect])
        changed = is_less(effects, 1.0) | is_less(1.0, effects)
        if np.isfinite(effects).all() and not changed.any():
            return UNCHANGED
        if self.confidence >= MIN_CONFIDENCE:
            return "agrees"
        chance = 1 - MIN_CONFIDENCE
        return "within scatter" if max(self.confidence, self.single) > chance else "differs"


def judge_trend(trend: Trend, series: Iterable[Series]) -> Finding | None:
    """Test a trend on the errors of all the cases, modes and quantities of its source.

    Return None if the errors to which it refers, or with which it compares, are not in the series.
    """
    kept = {(s.quantity, s.case, s.mode): s for s in series if s.errors.shape[1]}
    if not kept:
        return None
    common = min((n for s in kept.values() if (n := s.errors.shape[1]) > 1), default=1)
    mean = Evidence(trend, kept, lambda one: one.means)

    def pair(one: Series) -> Array:  # repeats errors that are equal in all trials
        return np.broadcast_to(one.errors[:, :common], (len(one.errors), common))

    each = Evidence(trend, kept, pair, one_run=True)
    name, _, argument = trend.test.partition(" ")
    if not (mean.series and each.series):
        return None
    try:
        confidence, single = (
            float(np.mean(TREND_TESTS[name](evidence, argument))) for evidence in (mean, each)
        )
    except LookupError:  # the errors to compare with are missing
        return None
    if name not in TREND_DIRECTIONS:
        return Finding(confidence, single)
    expected = {key: draws.mean(axis=1) for key, draws in mean.named}
    direction = TREND_DIRECTIONS[name]
    ends = np.array([[errors[0], errors[-1]] for errors in expected.values()])
    if ends[:, 0].all():
        ratios = ends[:, 1] / ends[:, 0]
        least, most = (float(ratios.min()), float(ratios.max()))[::direction]
    else:
        least = most = float("nan")
    return Finding(confidence, single, least, most, _step_back(expected, mean.values, direction))


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


MIN_MATERIAL_FALL = 0.10  # smallest fall that counts, as a share of the larger error
ONE_RUN_FLAT = 2.0  # in one run the thesis calls 7 to 3.5 % a significant fall, and 8-18 % none
MAX_ALIKE_RATIO = 1.5  # the thesis calls modes with errors of 10-15 % alike


Test = Callable[[Evidence, str], Mask]


def _all(parts: Iterable[Any]) -> Mask:
    compared = list(parts)
    if not compared:
        raise LookupError("nothing to compare")
    return np.asarray(np.logical_and.reduce(compared))


def is_less(errors: Array | float, others: Array | float) -> Mask:
    """Return where errors are below others by more than the smallest material effect."""
    return np.asarray(errors < (1 - MIN_MATERIAL_FALL) * others)


def _down(errors: Array) -> Mask:
    """Return whether the last error is below the first, and most pairs are in this order."""
    ordered = sum(np.sign(errors[i] - errors[j]) for i, j in combinations(range(len(errors)), 2))
    return is_less(errors[-1], errors[0]) & (ordered > 0)


def _up(errors: Array) -> Mask:
    return _down(errors[::-1])


def _flat(errors: Array, one_run: bool) -> Mask:
    """Return whether least and largest are materially equal; in one run by the thesis's usage."""
    least, largest = errors.min(axis=0), errors.max(axis=0)
    return largest <= ONE_RUN_FLAT * least if one_run else ~is_less(least, largest)


def _trendless(errors: Array, one_run: bool) -> Mask:
    return ~(_down(errors) | _up(errors)) | _flat(errors, one_run)


def _close(first: Array, second: Array) -> Mask:
    """Return whether two (geometric) means are alike."""
    return np.asarray(np.maximum(first, second) <= MAX_ALIKE_RATIO * np.minimum(first, second))


def _each(test: Callable[[Array], Mask]) -> Test:
    """Return the trend test that all errors of the trend pass `test`."""
    return lambda evidence, _: _all(map(test, evidence.series))


def _is_flat(evidence: Evidence, argument: str) -> Mask:
    """Test ``flat``, ``flat 8 18``: flat, and within an interval if one is printed.

    For a single run, a printed interval alone defines what the thesis calls flat.
    """
    inside = _within(evidence, argument) if argument else True
    if argument and evidence.one_run:
        return np.asarray(inside)
    return inside & _all(_flat(errors, evidence.one_run) for errors in evidence.series)


def _within(evidence: Evidence, argument: str) -> Mask:
    """Test ``within 8 18``: in this interval; ``within 1 4 1 3 1 3``: in one for each mode."""
    ends = np.array(argument.split(), float).reshape(-1, 2)
    modes = evidence.trend.modes
    found = []
    for mode, (low, high) in zip(modes, np.broadcast_to(ends, (len(modes), 2)), strict=True):
        low, high = (1 - MIN_MATERIAL_FALL) * low, (1 + MIN_MATERIAL_FALL) * high
        own = [errors for key, errors in evidence.named if key[2] == mode]
        found += [((low <= errors) & (errors <= high)).all(axis=0) for errors in own]
    return _all(found)


def _mostly_no_trend(evidence: Evidence, _: str) -> Mask:
    found = [_trendless(errors, evidence.one_run) for errors in evidence.series]
    return np.mean(found, axis=0) > 0.5


def _same_trends(evidence: Evidence, _: str) -> Mask:
    """Test ``same_trends``: of cases ``2a at 500``, ``2a at 750`` none falls where another rises.

    The factors of their change from the first setting to the last must be alike, too.
    """
    groups: dict[tuple[str, str, int], list[Array]] = {}
    for (quantity, case, mode), errors in evidence.named:
        groups.setdefault((quantity, case.partition(" at ")[0], mode), []).append(errors)
    return _all(
        _close(a[-1] / a[0], b[-1] / b[0]) & ~((_down(a) & _up(b)) | (_up(a) & _down(b)))
        for group in groups.values()
        for a, b in combinations(group, 2)
    )


TREND_PARTS = {"": slice(None), "last": slice(-1, None)}


def _bounded(compare: Callable[[Array, float], Mask], is_rounded: bool = False) -> Test:
    """Return the test of ``below 40`` or ``at_most 10 last``: below, or at most as printed."""

    def test(evidence: Evidence, argument: str) -> Mask:
        bound, _, which = argument.partition(" ")
        most, part = float(bound) + is_rounded * half_digit(bound), TREND_PARTS[which]
        return _all(compare(errors[part], most).all(axis=0) for errors in evidence.series)

    return test


def _above(evidence: Evidence, argument: str) -> Mask:
    """Test ``above 5 first``: at least one of the series is above 5 in its first setting."""
    bound = float(argument.removesuffix(" first"))
    return np.logical_or.reduce([errors[0] > bound for errors in evidence.series])


def _peaks(evidence: Evidence, argument: str) -> Mask:
    """Test ``peaks 1000``: largest where the varied parameter has this value."""
    (at,) = np.flatnonzero(evidence.values[evidence.cases[0]] == float(argument))
    return _all(np.argmax(errors, axis=0) == at for errors in evidence.series)


def _modes_alike(evidence: Evidence, _: str) -> Mask:
    means = [evidence.mode_means(quantity) for quantity in evidence.trend.quantities]
    chosen = [[m[mode] for mode in evidence.trend.modes if mode in m] for m in means]
    return _all(_close(a, b) for modes in chosen for a, b in combinations(modes, 2))


def _worst_mode(evidence: Evidence, argument: str, sign: int = 1) -> Mask:
    """Test ``worst_mode 3``: its mean is above that of each other mode; below with sign −1."""
    means = [evidence.mode_means(quantity) for quantity in evidence.trend.quantities]
    mode = int(argument)
    return _all(
        sign * by[mode] > sign * by[m] for by in means if mode in by for m in by if m != mode
    )


def _planes_alike(evidence: Evidence, argument: str) -> Mask:
    """Test ``planes_alike``: both planes; ``planes_alike XZ 2 1``: one, in two modes."""
    if argument:
        plane, mode, other = argument.split()
        by = evidence.mode_means(f"plane_error_{plane.lower()}")
        empty = "plane_error_yz" if plane == "XZ" else "plane_error_xz"
        nodal = [
            np.isnan(evidence.errors(*key)).all()
            for key in evidence.known
            if key[0] == empty and key[2] == int(mode)
        ]
        return _close(by[int(mode)], by[int(other)]) & all(nodal)
    mode = str(evidence.trend.modes[0])
    first, second = (evidence.mode_means(f"plane_error_{p}")[int(mode)] for p in ("xz", "yz"))
    return _close(first, second)


def _like_case(evidence: Evidence, argument: str) -> Mask:
    """Test ``like_case 4a last``: means, or last errors, are like another case's."""
    other, _, which = argument.partition(" ")
    compared = [
        [one[-1] if which == "last" else np.exp(np.log(one).mean(axis=0)) for one in pair]
        for pair in evidence.pairs(other)
    ]
    return _all(_close(*pair) for pair in compared)


def _below_case(evidence: Evidence, argument: str) -> Mask:
    """Test ``below_case 4a first``: first errors, or those at equal values, are below a case's."""
    other, which = argument.rsplit(" ", 1)
    if which == "first":
        return _all(a[0] < b[0] for a, b in evidence.pairs(other))
    common = np.intersect1d(evidence.values[evidence.cases[0]], evidence.values[other])
    own, others = (
        np.searchsorted(evidence.values[case], common) for case in (evidence.cases[0], other)
    )
    return _all((a[own] < b[others]).all(axis=0) for a, b in evidence.pairs(other))


def _best_case(evidence: Evidence, argument: str) -> Mask:
    """Test ``best_case 2a``: of all cases, this one has the least mean."""
    holds = []
    for quantity, mode in product(evidence.trend.quantities, evidence.trend.modes):
        errors = {case: evidence.errors(quantity, case, mode) for case in evidence.cases}
        mean = {case: np.log(one).mean(axis=0) for case, one in errors.items()}
        holds += [mean[argument] < mean[case] for case in mean if case != argument]
    return _all(holds)


def correlate_ranks(one: Array, other: Array) -> tuple[Array, Array]:
    """Return the scalar products of two arrays' centred ranks, and of their norms, by column.

    The ratio is Spearman's coefficient; both are zero where all values of a column are equal.
    """
    a, b = (pd.DataFrame(errors).rank().values - (len(errors) + 1) / 2 for errors in (one, other))
    return np.sum(a * b, axis=0), np.sqrt(np.sum(a**2, axis=0) * np.sum(b**2, axis=0))


def _test_unrelated(evidence: Evidence, argument: str) -> Mask:
    """Test ``unrelated deflection_error``: a rank correlation over all settings of at most ½."""
    holds = []
    for quantity, mode in product(evidence.trend.quantities, evidence.trend.modes):
        both = [
            [evidence.errors(name, case, mode) for name in (quantity, argument)]
            for case in evidence.cases
        ]
        known = [pair for pair in both if np.isfinite(pair[0]).all()]
        if not known:
            continue
        common, norm = correlate_ranks(*map(np.concatenate, zip(*known, strict=True)))
        holds.append(np.abs(common) <= 0.5 * norm)
    return _all(holds)


TREND_TESTS: dict[str, Test] = {
    "falls": _each(_down),
    "rises": _each(_up),
    "falls_steadily": _each(
        lambda errors: is_less(errors[-1], errors[0]) & (np.diff(errors, axis=0) < 0).all(axis=0)
    ),
    "falls_irregularly": _each(
        lambda errors: is_less(errors[-1], errors[0]) & is_less(errors[:-1], errors[1:]).any(axis=0)
    ),
    "flat": _is_flat,
    "within": _within,
    "no_trend": lambda evidence, _: _all(
        _trendless(errors, evidence.one_run) for errors in evidence.series
    ),
    "mostly_no_trend": _mostly_no_trend,
    "same_pattern": lambda evidence, _: _each(_down)(evidence, "") | _each(_up)(evidence, ""),
    "same_trends": _same_trends,
    "below": _bounded(np.less),
    "at_most": _bounded(np.less_equal, is_rounded=True),
    "above": _above,
    "peaks": _peaks,
    "highest_last": _each(lambda errors: np.argmax(errors, axis=0) == len(errors) - 1),
    "modes_alike": _modes_alike,
    "worst_mode": _worst_mode,
    # ``best_mode 1``: its mean is below that of each other mode, and all errors fall
    "best_mode": lambda evidence, mode: (
        _worst_mode(evidence, mode, -1) & _each(_down)(evidence, "")
    ),
    "planes_alike": _planes_alike,
    "like_case": _like_case,
    "below_case": _below_case,
    # ``gentler 4a``: falls by a smaller factor than another case does
    "gentler": lambda evidence, other: _all(
        a[0] / a[-1] < b[0] / b[-1] for a, b in evidence.pairs(other)
    ),
    "best_case": _best_case,
    "unrelated": _test_unrelated,
}
