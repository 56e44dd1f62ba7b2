"""The words of trends as tests: falls, rises, flat, alike, best, and the like.

A test gets the :class:`Evidence` and an argument, and says for each draw of the errors whether the
statement is true of it.

What the words mean, for all trends alike:

falls (rises)
    The last expected error is below (above) the first, and more pairs of settings are in this order
    than in the other.
flat
    The largest is at most ``FLAT`` times the least.
within, flat within
    Every expected error lies in the interval that is printed, its ends give or take ``MATERIAL``.
alike
    The means (geometric, over the settings) are at most ``ALIKE`` times each other.
no trend
    It neither falls nor rises, or is flat.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

if TYPE_CHECKING:
    from thesis_lib.facts.trends import Trend

Array = NDArray[np.float64]
Holds = NDArray[np.bool_]
FLAT = 2.0  # the thesis calls 7 to 3.5 % a significant fall, and 8-18 % none
MATERIAL = 0.10  # of an error, the least change that counts as one
ALIKE = 1.5  # it calls modes within 10-15 % alike


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


def _is_flat(evidence: Evidence, argument: str) -> Holds:
    """``flat``, ``flat 8 18``: flat, and within an interval if one is printed."""
    level = _all(_flat(errors) for errors in evidence.series)
    return level & _within(evidence, argument) if argument else level


def _within(evidence: Evidence, argument: str) -> Holds:
    """``within 8 18``: in this interval; ``within 1 4 1 3 1 3``: in one for each of its modes."""
    ends = np.array(argument.split(), float).reshape(-1, 2)
    modes = evidence.trend.modes
    bounds = dict(zip(modes, np.broadcast_to(ends, (len(modes), 2)), strict=True))
    found = []
    for mode, (low, high) in bounds.items():
        alone = replace(evidence, trend=replace(evidence.trend, modes=(mode,)))
        low, high = (1 - MATERIAL) * low, (1 + MATERIAL) * high
        found += [((low <= e) & (e <= high)).all(axis=0) for e in alone.series]
    return _all(found)


def _no_trend(evidence: Evidence, _: str) -> Holds:
    return _all(_trendless(errors) for errors in evidence.series)


def _mostly_no_trend(evidence: Evidence, _: str) -> Holds:
    return np.mean([_trendless(errors) for errors in evidence.series], axis=0) > 0.5


def _same_pattern(evidence: Evidence, _: str) -> Holds:
    return _falls(evidence, "") | _rises(evidence, "")


PARTS = {"": slice(None), "first": slice(1), "last": slice(-1, None)}


def _below(evidence: Evidence, argument: str) -> Holds:
    """``below 40``, ``below 10 last``: less than that."""
    bound, _, which = argument.partition(" ")
    return _all((errors[PARTS[which]] < float(bound)).all(axis=0) for errors in evidence.series)


def _at_most(evidence: Evidence, argument: str) -> Holds:
    """``at_most 40``, ``at_most 10 last``: at most that, rounded as it is printed."""
    bound, _, which = argument.partition(" ")
    most = float(bound) + 0.5 * 10.0 ** -len(bound.partition(".")[2])
    return _all((errors[PARTS[which]] <= most).all(axis=0) for errors in evidence.series)


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
    "within": _within,
    "no_trend": _no_trend,
    "mostly_no_trend": _mostly_no_trend,
    "same_pattern": _same_pattern,
    "below": _below,
    "at_most": _at_most,
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
