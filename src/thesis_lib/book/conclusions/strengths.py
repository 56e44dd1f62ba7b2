"""Chapter 7 of the thesis, computed: how strongly each of its conclusions holds in the cubes.

A :class:`Curve` is one error of one case and mode over one of the five things that the thesis
varies. Its slope on logarithmic axes is the exponent p of

    error ∝ x^p,

fitted by least squares to the rms over the trials, and for comparison to the prediction that the
cube carries (for simulations the first-order law of rounding).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.book.conclusions.knobs import KNOBS, Knob
from thesis_lib.facts.claims import Claim, Trend
from thesis_lib.ledger.series import Series
from thesis_lib.ledger.trends import Finding, judge
from thesis_lib.ledger.verdicts import UNCHANGED
from thesis_lib.plotting import selection
from thesis_lib.plotting.selection import select
from thesis_lib.studies import cubes

Cubes = Mapping[str, xr.Dataset]


@dataclass(frozen=True)
class Curve:
    """One error of one case and mode over one knob."""

    #: Whose error, of which case, and its name in the tables
    group: str
    case: str
    quantity: str
    mode: int  #: Of which mode
    values: Array  #: What is varied, growing, shape (settings,)
    errors: Array  #: In %, of the random trials, shape (settings, trials)
    #: The cube's prediction and the thesis's figure in %; NaN where there is none, shape
    #: (settings,)
    predicted: Array
    stated: Array
    elevation: float  #: Of the first camera in the first setting, in degrees
    lost: int  #: Settings without any result, which are left out

    @property
    def rms(self) -> Array:
        """Root mean square over the trials in %, shape (settings,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=1)))

    def finding(self, better: int) -> Finding:
        """Whether the error falls where it should, by the ledger's test of trends."""
        test = "falls" if better > 0 else "rises"
        quantity, case, mode = self.quantity, self.case, self.mode
        trend = Trend("", 7, "7", (case,), (mode,), (quantity,), "", "", "", (), test)
        found = judge(trend, [Series(quantity, case, mode, self.values, self.errors)])
        assert found is not None  # it speaks of this very series
        return found


def curves(opened: Cubes, knob: Knob) -> Iterator[Curve]:
    """All errors over one knob; cubes that are missing are left out."""
    for group, name, cases, quantities in knob.sources:
        try:
            cube = opened[name].drop_dims("point", errors="ignore")  # to select from, too
        except KeyError:
            continue
        for case in cases or tuple(dict.fromkeys(cube["case"].values.tolist())):
            for mode in cube["mode"].values.tolist():
                part = select(cube, case, mode)
                for quantity in quantities:
                    stated = [_figure(c) for c in selection.stated(cube, case, mode, quantity)]
                    curve = _curve(part, group, case, quantity, np.array(stated), knob)
                    if curve:
                        yield curve


def _curve(
    part: xr.Dataset, group: str, case: str, quantity: str, stated: Array, knob: Knob
) -> Curve | None:
    """One curve, or None on a plane that has no reference."""
    elevations = part["camera_elevation"].isel(camera=0)
    values = (elevations if knob is KNOBS["lower"] else part["value"]).values.astype(float)
    errors = cubes.error(part, quantity).transpose("setting", "trial").values[:, 1:].astype(float)
    predicted = cubes.predicted(part, quantity).values.astype(float)
    kept = np.flatnonzero(np.isfinite(errors).all(axis=1))
    kept = kept[np.argsort(values[kept], kind="stable")]
    if len(kept) < 2 or not errors.shape[1]:
        return None
    return Curve(
        group,
        case,
        quantity,
        int(part["mode"]),
        values[kept],
        errors[kept],
        predicted[kept],
        stated[kept],
        float(elevations[0]),
        len(values) - len(kept),
    )


def _figure(claim: Claim | None) -> float:
    """The middle of what is stated; NaN of a bound, or if nothing is."""
    if claim is None or not claim.values or None in claim.ends:
        return float("nan")
    return (claim.low + claim.high) / 2


def exponent(x: Array, y: Array) -> float:
    """Slope of log y over log x, by least squares.

    Examples
    --------
    >>> x = np.array([1.0, 2.0, 4.0])
    >>> round(exponent(x, 3 / x**2), 12)
    -2.0
    """
    kept = np.isfinite(x) & np.isfinite(y)
    if kept.sum() < 2:
        return float("nan")
    return float(np.polyfit(np.log(x[kept]), np.log(y[kept]), 1)[0])


def step(values: Array, better: int) -> float:
    """The last value over the first, in the direction in which a knob is turned to measure better.

    Examples
    --------
    >>> step(np.array([40.0, 30.0, 20.0]), 1), step(np.array([10.0, 30.0]), -1)
    (0.5, 0.3333333333333333)
    """
    ratio = float(values[-1] / values[0])
    return ratio if better > 0 else 1 / ratio


@dataclass(frozen=True)
class Strength:
    """How strongly a conclusion holds in the curves of one group."""

    group: str  #: Whose error
    ends: tuple[float, float]  #: The knob's value where it should measure worst and best
    #: Error at the best end over that at the worst, of each curve: here, and as stated
    factors: Array
    stated: Array
    #: Fitted exponent of each curve: here, and of the prediction
    exponents: Array
    predicted: Array
    #: Curves that change towards the good end, or towards the other, by more than the smallest
    #: effect in at least 95 % of the resamples; that change by less; that are not monotonic
    confident: int
    opposite: int
    unchanged: int
    not_monotonic: int
    single: float  #: Share of single runs in which the trend shows
    lost: int  #: Settings without a result


def strengths(opened: Cubes, knob: Knob) -> list[Strength]:
    """Return one :class:`Strength` for each group that the cubes have.

    Cubes that remember what is derived of them (`derived`) are asked once for each knob.
    """
    for _, name, *_ in knob.sources:
        opened.get(name)  # counts as used, also where the answer is remembered
    remembered: dict[Knob, list[Strength]] = getattr(opened, "derived", {})
    if knob not in remembered:
        remembered[knob] = _strengths(opened, knob)
    return remembered[knob]


def _strengths(opened: Cubes, knob: Knob) -> list[Strength]:
    by: dict[str, list[Curve]] = {}
    for curve in curves(opened, knob):
        by.setdefault(curve.group, []).append(curve)
    return [_strength(group, found, knob) for group, found in by.items()]


def _strength(group: str, found: list[Curve], knob: Knob) -> Strength:
    findings = [curve.finding(knob.better) for curve in found]
    against = [curve.finding(-knob.better) for curve in found]
    powers = [knob.exponent_of(curve.values) for curve in found]
    low, high = (float(end(end(c.values) for c in found)) for end in (min, max))
    stated = np.array([step(c.stated, knob.better) for c in found])
    return Strength(
        group=group,
        ends=(low, high) if knob.better > 0 else (high, low),
        factors=np.array([step(c.rms, knob.better) for c in found]),
        stated=stated[np.isfinite(stated)],
        exponents=np.array([exponent(x, c.rms) for x, c in zip(powers, found, strict=True)]),
        predicted=np.array([exponent(x, c.predicted) for x, c in zip(powers, found, strict=True)]),
        confident=sum(f.verdict == "agrees" for f in findings),
        opposite=sum(f.verdict == "agrees" for f in against),
        unchanged=sum(f.verdict == UNCHANGED for f in findings),
        not_monotonic=sum(
            bool(f.step_back) and (f.effect < 1) == (knob.better > 0) for f in findings
        ),
        single=float(np.mean([f.single for f in findings])),
        lost=max(c.lost for c in found),
    )


def shape_and_sound(opened: Cubes) -> Iterator[tuple[str, list[tuple[Array, Array]]]]:
    """By sound study: errors of the deflection and of the field, each of shape (settings, trials).

    One pair for each mode and plane that has a reference pressure; all cases together.
    """
    for study in ("distance", "aperture", "resolution", "arrays"):
        try:
            cube = opened[f"sound-{study}"]
        except KeyError:
            continue
        shape = cube["deflection_error"].transpose("mode", "setting", "trial").values[..., 1:]
        field = cube["plane_error"].transpose("plane", "mode", "setting", "trial").values[..., 1:]
        yield (
            study,
            [
                (shape[m], of_plane[m])
                for of_plane in field
                for m in range(len(shape))
                if np.isfinite(of_plane[m]).all()
            ],
        )


def spread(values: Iterable[float], digits: int = 2) -> str:
    """Median and range in words; a dash if there are none.

    Examples
    --------
    >>> spread([0.5, 0.4, 0.9]), spread([2.0]), spread([150.26])
    ('0.50 (0.40–0.90)', '2.00', '150')
    """
    kept = np.array([value for value in values if np.isfinite(value)])
    if not kept.size:
        return "—"
    middle, low, high = (
        signed(v, digits if abs(v) < 100 else 0) for v in (np.median(kept), kept.min(), kept.max())
    )
    to = " to " if "−" in low else "–"
    return middle if low == high else f"{middle} ({low}{to}{high})"


def signed(value: float, digits: int = 2) -> str:
    """A number with a true minus sign.

    Examples
    --------
    >>> signed(-0.5), signed(0.5), signed(-0.001)
    ('−0.50', '0.50', '0.00')
    """
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")
