"""Judge claimed values by one interval rule, and extract errors of cubes as series for trends.

The rule holds for every claim and was fixed before the results were seen; the ledger's page states
it. Upper and lower bounds are one-sided; a strict one, "less than", allows no rounding. A claim
about all settings holds if it holds for each. Where the text excludes one marker, the
second-largest error is used.

Trends are judged by :mod:`thesis_lib.ledger.trends`, on the series.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from itertools import product

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, IntArray
from thesis_lib.facts.claims import Claim, Trend, read_trends
from thesis_lib.studies import cubes

# Percentage points by which the band is widened for the verdict "within scatter"
WIDENING_POINTS, WIDENING_POINTS_BELOW_10 = 1.0, 0.5
UNCHANGED = "no material change"  # for trends only
VERDICTS = ("agrees", "within scatter", "differs", UNCHANGED, "undefined")


@dataclass(frozen=True)
class Check:
    """Result of a claim in %, at the one of its settings that is farthest from the claim."""

    claim: Claim  #: The claim
    #: The nominal run, and median and 5–95 % band of the trials
    literal: float
    median: float
    low: float
    high: float
    inside: bool  #: Whether the band meets the claim in all of its settings
    exact: bool  #: Whether the nominal run meets it in all of them, to the printed digits

    @property
    def verdict(self) -> str:
        """Return one of ``VERDICTS``."""
        return "agrees" if self.exact else "within scatter" if self.inside else "differs"

    @property
    def ratio(self) -> float:
        """Return the median over the nearest value that the claim allows: 1 inside its interval."""
        least, most = self.claim.ends
        nearest = self.median if least is None else max(self.median, least)
        return self.median / (nearest if most is None else min(nearest, most))


def _settings(cube: xr.Dataset, claim: Claim) -> IntArray:
    """Return the indices of the settings to which a claim refers."""
    columns = (cube.variables[n].values.tolist() for n in ("case", "value", "pair_order"))
    return np.flatnonzero([claim.applies_to(*one) for one in zip(*columns, strict=True)])


def claim_errors(cube: xr.Dataset, claim: Claim) -> xr.DataArray:
    """Return the error to which a claim refers, over its settings and all trials, in %."""
    modes = cube.variables["mode"].values.tolist()
    here = {"setting": _settings(cube, claim), "mode": modes.index(claim.mode)}
    if not claim.excepted:
        return cubes.cube_error(cube, claim.quantity).isel(here)
    return _point_errors(cube.isel(here)).isel(point=-1 - claim.excepted)


def _point_errors(cube: xr.Dataset) -> xr.DataArray:
    """Return the errors of the markers in %, sorted, over settings, modes and trials."""
    reference = cube["reference_deflection"]
    error = abs(cube["measured_deflection"].astype(float) - reference)
    error = error / abs(reference).max("point") * 100
    ordered = np.sort(error.values, axis=error.get_axis_num("point"))
    return error.copy(data=ordered).drop_vars(["x", "y"], errors="ignore")


def claim_from_errors(claim: Claim, values: Array) -> Claim:
    """Return the claim that the thesis would print for these errors (in %) of the settings.

    An interval is from the least to the largest, an upper bound is rounded up, a lower one down;
    one value is the middle. All have the digits of the real claim.
    """
    low, high = np.min(values), np.max(values)
    digit = 2 * np.array(claim.rounding)
    if claim.relation == "about":
        low = high = (low + high) / 2
    if claim.relation == "less_than":
        high = high + digit[1] / 2  # so that it is above after rounding
    up = np.ceil if claim.relation in ("max", "less_than") else np.rint
    down = np.floor if claim.relation == "min" else np.rint
    ends = digit[0] * down(low / digit[0]), digit[1] * up(high / digit[1])
    return replace(claim, low=float(ends[0]), high=float(ends[1]))


def meets_claim(claim: Claim, low: float, high: float) -> bool:
    """Return whether a band in % meets the claim by the rule of this module."""
    margin = WIDENING_POINTS_BELOW_10 if claim.high < 10 else WIDENING_POINTS
    return bool(_gap(claim, low, high) <= margin)


def _exact(claim: Claim, literal: float) -> bool:
    """Return whether a nominal run equals the claim to the printed digits."""
    least, most = claim.ends
    if claim.relation == "less_than":
        return literal < claim.high
    above = least is None or literal >= least - claim.rounding[0]
    return above and (most is None or literal <= most + claim.rounding[1])


def _gap(claim: Claim, low: float, high: float) -> float:
    """Return the distance of a band in % from the claimed interval, negative inside it."""
    least, most = claim.ends
    return max(-np.inf if most is None else low - most, -np.inf if least is None else least - high)


def check_claims(cube: xr.Dataset, claims: Iterable[Claim]) -> list[Check]:
    """Compare claims with a cube; those that cannot be judged are left out."""
    plain = cube.reset_coords()  # each coordinate of errors costs as much as judging them
    return [found for claim in claims if isinstance(found := judge_claim(plain, claim), Check)]


def judge_claim(cube: xr.Dataset, claim: Claim) -> Check | str:
    """Compare one claim with a cube, or return the reason in a few words if that is impossible."""
    if claim.mode not in cube.variables["mode"].values:
        return f"mode {claim.mode} was not run"
    found = set(cube.variables["value"].values[_settings(cube, claim)].tolist())
    missing = [f"{value:g}" for value in claim.values if value not in found]
    if missing or not found:
        return f"case {claim.case} was not run" + (f" at {', '.join(missing)}" if missing else "")
    if cube.sizes["trial"] < 2:
        return "the cube has no random trials"
    values = claim_errors(cube, claim).transpose("setting", "trial").values
    first, drawn = values[:, 0], values[:, 1:]
    band = np.quantile(drawn, cubes.BAND_QUANTILES[::2], axis=1)
    if not (np.isfinite(first).all() and np.isfinite(band).all()):
        return "the reference is zero: a nodal plane"
    worst = int(np.argmax([_gap(claim, low, high) for low, high in band.T]))
    low, high = band[:, worst].tolist()
    exact = all(_exact(claim, value) for value in first.tolist())
    median, inside = float(np.median(drawn[worst])), meets_claim(claim, low, high)
    return Check(claim, float(first[worst]), median, low, high, inside, exact)


RESAMPLE_COUNT = 2000
SECOND_LARGEST = "second_point_error"  # the second-largest error of the markers


@dataclass(frozen=True)
class Series:
    """One error of the settings of a case, in the order of the varied parameter."""

    #: Kind of error, and case
    quantity: str
    case: str
    mode: int  #: Mode
    values: Array  #: The varied parameter, growing, shape (settings,)
    #: In %, of the random trials; NaN where there is no reference, shape (settings, trials)
    errors: Array

    @cached_property
    def means(self) -> Array:
        """Return the means over resampled trials, shape (settings, resamples), computed once."""
        return self.errors @ _weights(self.errors.shape[1])


@lru_cache(maxsize=8)
def _weights(trials: int) -> Array:
    """Draw weights of resampled means, (trials, resamples), with replacement."""
    even = np.full(trials, 1 / trials)
    return np.asarray(np.random.default_rng(0).multinomial(trials, even, RESAMPLE_COUNT).T / trials)


@cache
def _sets_with(quantity: str) -> frozenset[str]:
    """Return the sources of all trends that refer to a quantity."""
    stated = (trend for trend in read_trends() if quantity in trend.quantities)
    return frozenset(name for trend in stated for name in trend.source)


def series_of(cube: xr.Dataset) -> list[Series]:
    """Return the errors of a cube's random trials, case by case."""
    kinds = dict(cubes.cube_errors(cube))
    if "deflection_error" in cube:
        kinds["deflection_error"] = cube["deflection_error"]
    if cube.attrs["figure_set"] in _sets_with(SECOND_LARGEST):
        kinds[SECOND_LARGEST] = _point_errors(cube).isel(point=-2, drop=True)
    if {"lost", "wrong"} <= set(cube):  # of the laboratory, equal in all trials
        failures = _tracking_failures(cube["lost"], cube["wrong"])
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
                Series(quantity, case, int(mode), values, part)
                for mode, part in zip(cube["mode"].values, table, strict=True)
            ]
    if "tracking_missing" in cube:
        failures = _tracking_failures(cube["tracking_missing"], cube["tracking_wrong"])
        widths = cube["tracked_width"].values.astype(float)
        rates = failures.values[:, None].astype(float)
        found.append(Series("tracking_failures", "tracking", 1, widths, rates))
    return found


def _tracking_failures(missing: xr.DataArray, wrong: xr.DataArray) -> xr.DataArray:
    """Return the markers not tracked, in %: those missing, and those found that are wrong."""
    return 100 * (missing + (1 - missing) * wrong.fillna(0))


Key = tuple[str, str, int]  # quantity, case, mode


@dataclass(frozen=True)
class Evidence:
    """Data to test a trend: series by quantity, case and mode, and draws of their errors."""

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
        """Return the cases to which the trend refers."""
        return self.trend.cases or tuple(self.values)

    @property
    def named(self) -> list[tuple[Key, Array]]:
        """Return keys and errors of the series to which the trend refers and that have no NaN."""
        return [
            ((quantity, case, mode), errors)
            for quantity, case, mode in self.known
            if case in self.cases and mode in self.trend.modes and quantity in self.trend.quantities
            if np.isfinite(errors := self.errors(quantity, case, mode)).all()
        ]

    @property
    def series(self) -> list[Array]:
        """Return the errors of the series to which the trend refers and that have no NaN."""
        return [errors for _, errors in self.named]

    def mode_means(self, quantity: str) -> dict[int, Array]:
        """Return the geometric mean over all settings of the cases, by mode: shape (draws,)."""
        by: dict[int, list[Array]] = {}
        for name, case, mode in self.known:
            if name == quantity and case in self.cases:
                errors = self.errors(name, case, mode)
                if np.isfinite(errors).all():
                    by.setdefault(mode, []).append(np.log(errors))
        return {mode: np.exp(np.concatenate(logs).mean(axis=0)) for mode, logs in by.items()}

    def pairs(self, other: str) -> Iterator[tuple[Array, Array]]:
        """Yield the errors of the trend's own case and of another, for each quantity and mode."""
        for quantity, mode in product(self.trend.quantities, self.trend.modes):
            own, second = (self.errors(quantity, case, mode) for case in (self.cases[0], other))
            if np.isfinite(own).all() and np.isfinite(second).all():
                yield own, second
