"""Chapter 7 of the thesis, computed: how strongly each of its conclusions holds in the cubes.

A :class:`Factor` is one of the five things that the thesis varies. A :class:`Curve` is one error of
one case and mode over a factor. Its slope on logarithmic axes is the exponent p of

    error ∝ x^p,

fitted by least squares to the rms over the trials, and for comparison to the prediction that the
cube carries (for simulations the first-order law of rounding). An :class:`Effect` sums up the
curves of one group, and one figure shows all of them.
"""

import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import StrMethodFormatter
from pydantic import TypeAdapter

from thesis_lib import files
from thesis_lib.arrays import Array
from thesis_lib.book.pieces.opened import Cubes, MissingCubeError, Opened, write_placeholder
from thesis_lib.facts.claims import Trend
from thesis_lib.ledger import trends, verdicts
from thesis_lib.plotting import selection, style
from thesis_lib.studies import cubes

Source = tuple[str, str, tuple[str, ...]]
MEAN_ERRORS = ("mean_error",)
PLANE_ERRORS = ("plane_error_xz", "plane_error_yz")


@dataclass(frozen=True)
class Factor:
    """One of the five things that the thesis varies."""

    label: str  #: Its name with its unit
    symbol: str  #: Quantity x of the power law of the error
    better: int  #: 1 if larger values should reduce the error, else -1
    conclusion: str  #: Conclusion of the thesis, in a word or two
    advice: str  #: Advice for placing cameras
    parameter: str  #: Prefix of the ledger's names of a trend's parameter
    #: Title and ticks of its panel in the figure
    panel: str
    ticks: tuple[float, ...]
    #: Name of the group, figure set and cases (none means all) of each measurement
    sources: tuple[Source, ...]
    by_elevation: bool = False  #: The first camera's elevation φ is varied; x is cos φ


FACTORS = TypeAdapter(dict[str, Factor]).validate_python(
    tomllib.loads(Path(__file__).with_name("factors.toml").read_text(encoding="utf-8"))
)


@dataclass(frozen=True)
class Curve(verdicts.Series):
    """One error of one case and mode over one factor, at the settings that have a result."""

    group: str  #: Group of the measurement
    #: The cube's prediction and the claimed value in %; NaN where there is none, shape (settings,)
    predicted: Array
    claimed: Array
    elevation: float  #: Of the first camera in the first setting, in degrees

    @property
    def rms(self) -> Array:
        """Return the root mean square over the trials in %, shape (settings,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=1)))

    def judge_trend(self, better: int) -> trends.Finding:
        """Test by the ledger's test of trends whether the error falls in the expected direction."""
        test = "falls" if better > 0 else "rises"
        of = (self.case,), (self.mode,), (self.quantity,)
        found = trends.judge_trend(Trend("", 7, "7", *of, "", "", "", (), test), [self])
        assert found is not None  # the trend selects this series
        return found


def read_curves(opened: Cubes, factor: Factor) -> Iterator[Curve]:
    """Read all errors over one factor, without nodal planes."""
    for group, name, cases in factor.sources:
        cube = opened[name].drop_dims("point", errors="ignore")  # to select from, too
        quantities = PLANE_ERRORS if group.startswith("sound") else MEAN_ERRORS
        of = product(cases or selection.list_cases(cube), cube["mode"].values.tolist())
        for case, mode in of:
            part = selection.select_settings(cube, case, mode)
            elevations = part["camera_elevation"].isel(camera=0)
            values = (elevations if factor.by_elevation else part["value"]).values.astype(float)
            for quantity in quantities:
                drawn = cubes.cube_error(part, quantity).transpose("setting", "trial")[:, 1:]
                errors = drawn.values.astype(float)
                finite = np.flatnonzero(np.isfinite(errors).all(axis=1))
                if len(finite) < 2 or not errors.shape[1]:
                    continue
                order = finite[np.argsort(values[finite], kind="stable")]
                claimed = np.array(  # the middle of the claimed range, unless it is a bound
                    [
                        (claim.low + claim.high) / 2
                        if claim and claim.values and None not in claim.ends
                        else float("nan")
                        for claim in selection.claimed_errors(cube, case, mode, quantity)
                    ]
                )
                predicted = cubes.predicted_value(part, quantity).values.astype(float)
                yield Curve(
                    quantity, case, mode, values[order], errors[order],
                    group, predicted[order], claimed[order], float(elevations[0]),
                )  # fmt: skip


def fit_exponent(x: Array, y: Array) -> float:
    """Fit the slope of log y over log x by least squares.

    Examples
    --------
    >>> x = np.array([1.0, 2.0, 4.0])
    >>> round(fit_exponent(x, 3 / x**2), 12)
    -2.0
    """
    finite = np.isfinite(x) & np.isfinite(y)
    if finite.sum() < 2:
        return float("nan")
    return float(np.polyfit(np.log(x[finite]), np.log(y[finite]), 1)[0])


def end_ratio(values: Array, better: int) -> float:
    """Return the last value over the first, or the inverse if `better` is negative.

    Examples
    --------
    >>> end_ratio(np.array([40.0, 30.0, 20.0]), 1), end_ratio(np.array([10.0, 30.0]), -1)
    (0.5, 0.3333333333333333)
    """
    ratio = float(values[-1] / values[0])
    return ratio if better > 0 else 1 / ratio


@dataclass(frozen=True)
class Effect:
    """How strongly a conclusion holds in the curves of one group."""

    group: str  #: Group of the measurements
    ends: tuple[float, float]  #: Values at which the error should be largest and least
    #: Error at the best end over that at the worst, of each curve: here, and as claimed
    ratios: Array
    claimed: Array
    #: Fitted exponent of each curve: here, and of the prediction
    exponents: Array
    predicted: Array
    #: Numbers of curves that fall towards the expected end, or the other one, by more than the
    #: smallest effect in at least 95 % of the resamples; that change by less; not monotonic
    confident: int
    opposite: int
    unchanged: int
    not_monotonic: int
    single: float  #: Share of single runs in which the trend shows


def estimate_effects(opened: Cubes, factor: Factor) -> list[Effect]:
    """Estimate one :class:`Effect` for each group.

    If `opened` has a dictionary `derived`, the effect of each group is cached there.
    """
    remembered: dict[Factor, list[Effect]] = getattr(opened, "derived", {})
    found = []
    for group in dict.fromkeys(group for group, *_ in factor.sources):
        alone = replace(factor, sources=tuple(one for one in factor.sources if one[0] == group))
        if alone not in remembered:
            curves = [*read_curves(opened, alone)]
            remembered[alone] = [_estimate_effect(group, curves, alone)] if curves else []
        found += remembered[alone]
    return found


def _estimate_effect(group: str, curves: list[Curve], factor: Factor) -> Effect:
    findings = [curve.judge_trend(factor.better) for curve in curves]
    against = [curve.judge_trend(-factor.better) for curve in curves]
    low, high = (float(end(end(c.values) for c in curves)) for end in (min, max))
    claimed = np.array([end_ratio(c.claimed, factor.better) for c in curves])
    bases = [np.cos(np.radians(c.values)) if factor.by_elevation else c.values for c in curves]
    rms, predicted = [c.rms for c in curves], [c.predicted for c in curves]
    return Effect(
        group=group,
        ends=(low, high) if factor.better > 0 else (high, low),
        ratios=np.array([end_ratio(errors, factor.better) for errors in rms]),
        claimed=claimed[np.isfinite(claimed)],
        exponents=np.array([*map(fit_exponent, bases, rms)]),
        predicted=np.array([*map(fit_exponent, bases, predicted)]),
        confident=sum(f.verdict == "agrees" for f in findings),
        opposite=sum(f.verdict == "agrees" for f in against),
        unchanged=sum(f.verdict == verdicts.UNCHANGED for f in findings),
        not_monotonic=sum(
            bool(f.step_back) and (f.effect < 1) == (factor.better > 0) for f in findings
        ),
        single=float(np.mean([f.single for f in findings])),
    )


def sound_trends(opened: Cubes, *factors: str) -> tuple[int, int]:
    """Count the simulated curves of the sound's error that fall as expected, and all curves.

    The curves are those over `factors`, by default over all but the aperture.
    """
    found = [
        effect
        for name in factors or [name for name in FACTORS if name != "wider"]
        for effect in estimate_effects(opened, FACTORS[name])
        if effect.group == "sound"
    ]
    return sum(one.confident for one in found), sum(len(one.ratios) for one in found)


FIGURE_FILE = "conclusions.svg"
PANEL_GROUPS = dict(beam=style.BLUE, plate=style.ORANGE, sound=style.GREEN, experiment=style.RED)
CLAIM_MARK: dict[str, Any] = {"marker": "D", "markersize": 4, "markerfacecolor": "none"}


def draw_summary(opened: Cubes) -> Figure:
    """Draw five panels, one for each factor, all with the same axis of errors.

    A line is one case, the geometric mean over modes and planes of the rms over the trials; a
    diamond is one claimed value of the thesis.
    """
    thin: dict[str, Any] = {"linestyle": "", "markeredgewidth": 0.7, "alpha": 0.8, "zorder": 3}
    with style.in_style():
        drawing, panels = style.subplots(1, 5, figsize=(9.6, 3.6), sharey=True)
        for axes, factor in zip(panels, FACTORS.values(), strict=True):
            by: dict[tuple[str, str], list[Curve]] = {}
            for curve in read_curves(opened, factor):
                by.setdefault((curve.group, curve.case), []).append(curve)
                color = PANEL_GROUPS[curve.group.partition(",")[0]]
                axes.plot(curve.values, curve.claimed, color=color, **thin, **CLAIM_MARK)
            for (group, _), alike in by.items():
                mean = np.exp(np.mean([np.log(curve.rms) for curve in alike], axis=0))
                subject, _, rendered = group.partition(",")
                line = {"color": PANEL_GROUPS[subject], "linewidth": 1.2, "markersize": 4}
                axes.plot(alike[0].values, mean, ".--" if rendered else ".-", **line)
            axes.set_title(factor.panel)
            style.make_logarithmic(axes.xaxis, factor.ticks)
            if factor.better < 0:  # errors should fall to the right
                axes.invert_xaxis()
        panels[0].set(yscale="log", ylabel="rms error, %")
        panels[0].yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        grey = "#555555"
        handles = [
            *(Line2D([], [], color=color, label=name) for name, color in PANEL_GROUPS.items()),
            Line2D([], [], color=grey, linestyle="--", label="rendered recordings"),
            Line2D([], [], color=grey, linestyle="", label="thesis", **CLAIM_MARK),
        ]
        spacing: dict[str, Any] = {"ncols": 3, "columnspacing": 1.2, "handlelength": 1.8}
        drawing.legend(handles=handles, loc="outside lower center", **spacing)
    return drawing


def write_summary_figure(made: Iterable[Path], folder: Path) -> None:
    """Draw the figure from the cubes `made` into a folder; a placeholder if a cube is missing."""
    try:
        text = style.figure_svg(draw_summary(Opened(made)))
    except MissingCubeError as error:
        write_placeholder(folder / FIGURE_FILE, error.args[0])
    else:
        files.whole_text(folder / FIGURE_FILE, text)
