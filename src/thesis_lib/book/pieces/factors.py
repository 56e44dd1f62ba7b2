"""Chapter 7 of the thesis, computed: how strongly each of its conclusions holds in the cubes.

A :class:`Factor` is one of the five things that the thesis varies. A :class:`Curve` is one error of
one case and mode over a factor. Its slope on logarithmic axes is the exponent p of

    error ∝ x^p,

fitted by least squares to the rms over the trials, and for comparison to the prediction that the
cube carries (for simulations the first-order law of rounding). An :class:`Effect` sums up the
curves of one group, and one figure shows all of them.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from thesis_lib import files
from thesis_lib.arrays import Array
from thesis_lib.book.pieces.opened import Cubes
from thesis_lib.facts.claims import Claim, Trend
from thesis_lib.figure_sets import cube_file
from thesis_lib.ledger.trends import Finding, judge_trend
from thesis_lib.ledger.verdicts import UNCHANGED, Series
from thesis_lib.plotting import selection
from thesis_lib.plotting.style import CYCLE_COLORS, figure_svg, in_style, subplots
from thesis_lib.studies import cubes

Source = tuple[str, str, tuple[str, ...], tuple[str, ...]]
MEAN_ERRORS = ("mean_error",)
PLANE_ERRORS = ("plane_error_xz", "plane_error_yz")
SOUND_STUDIES = ("distance", "aperture", "resolution", "arrays")


@dataclass(frozen=True)
class Factor:
    """One of the five things that the thesis varies."""

    label: str  #: Its name with its unit
    symbol: str  #: The quantity that the error is taken to be a power of
    better: int  #: 1 if more of it should measure better, else -1
    #: Name of the group, figure set, cases (none means all) and errors of each measurement
    sources: tuple[Source, ...]
    #: The quantity that the error is taken to be a power of, from the values
    exponent_of: Callable[[Array], Array] = field(default=lambda values: values)


def _angle_cosine(degrees: Array) -> Array:
    return np.cos(np.radians(degrees))


def _list_simulated(study: str, *cases: str) -> tuple[Source, ...]:
    return tuple(
        (subject, f"{subject}-{study}", cases, PLANE_ERRORS if subject == "sound" else MEAN_ERRORS)
        for subject in ("beam", "plate", "sound")
    )


def _list_rendered(case: str) -> tuple[Source, ...]:
    return (
        ("plate, rendered", "lab-plate", (case,), MEAN_ERRORS),
        ("sound, rendered", "lab-plate", (case,), PLANE_ERRORS),
    )


FACTORS: dict[str, Factor] = {
    "closer": Factor(
        "distance, mm", "d", -1,
        (*_list_simulated("distance"), ("beam, rendered", "lab-layout", ("distance",), MEAN_ERRORS),
         *_list_rendered("distance")),
    ),
    "wider": Factor(
        "aperture, °", "α", 1,
        (*_list_simulated("aperture", "2a", "2c"),
         ("beam, rendered", "lab-layout", ("aperture",), MEAN_ERRORS),
         *_list_rendered("aperture")),
    ),
    "lower": Factor(
        "elevation, °", "cos φ", -1,
        (*_list_simulated("aperture", "2b", "2d"),
         ("beam, rendered", "lab-elevation", ("three-rows",), MEAN_ERRORS),
         *_list_rendered("elevation")),
        _angle_cosine,
    ),
    "finer": Factor(
        "width of the sensor, px", "W", 1,
        (*_list_simulated("resolution"),
         ("experiment", "experiment-resolution", ("matched",), MEAN_ERRORS),
         *_list_rendered("resolution")),
    ),
    "more": Factor(
        "number of cameras", "N", 1,
        (*_list_simulated("arrays"),
         ("experiment", "experiment-cameras", ("matched",), MEAN_ERRORS),
         *_list_rendered("cameras")),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Curve:
    """One error of one case and mode over one factor."""

    #: Whose error, of which case, and its name in the tables
    group: str
    case: str
    quantity: str
    mode: int  #: Of which mode
    values: Array  #: What is varied, growing, shape (settings,)
    errors: Array  #: In %, of the random trials, shape (settings, trials)
    #: The cube's prediction and the claimed value in %; NaN where there is none, shape (settings,)
    predicted: Array
    claimed: Array
    elevation: float  #: Of the first camera in the first setting, in degrees
    lost: int  #: Settings without any result, which are left out

    @property
    def rms(self) -> Array:
        """Return the root mean square over the trials in %, shape (settings,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=1)))

    def judge_trend(self, better: int) -> Finding:
        """Test whether the error falls where it should, as the ledger tests trends."""
        test = "falls" if better > 0 else "rises"
        quantity, case, mode = self.quantity, self.case, self.mode
        trend = Trend("", 7, "7", (case,), (mode,), (quantity,), "", "", "", (), test)
        found = judge_trend(trend, [Series(quantity, case, mode, self.values, self.errors)])
        assert found is not None  # the trend is about this very series
        return found


def read_curves(opened: Cubes, factor: Factor) -> Iterator[Curve]:
    """Read all errors over one factor; cubes that are missing are left out."""
    for group, name, cases, quantities in factor.sources:
        if (whole := opened.get(name)) is None:
            continue
        cube = whole.drop_dims("point", errors="ignore")  # to select from, too
        for case in cases or tuple(dict.fromkeys(cube["case"].values.tolist())):
            for mode in cube["mode"].values.tolist():
                part = selection.select_settings(cube, case, mode)
                for quantity in quantities:
                    of = selection.claimed_errors(cube, case, mode, quantity)
                    claimed = np.array([_read_claimed_value(claim) for claim in of])
                    curve = _read_curve(part, group, case, quantity, claimed, factor)
                    if curve:
                        yield curve


def _read_curve(
    part: xr.Dataset, group: str, case: str, quantity: str, claimed: Array, factor: Factor
) -> Curve | None:
    """Read one curve, or None on a plane that has no reference."""
    elevations = part["camera_elevation"].isel(camera=0)
    values = (elevations if factor is FACTORS["lower"] else part["value"]).values.astype(float)
    errors = (
        cubes.cube_error(part, quantity).transpose("setting", "trial").values[:, 1:].astype(float)
    )
    predicted = cubes.predicted_value(part, quantity).values.astype(float)
    finite = np.flatnonzero(np.isfinite(errors).all(axis=1))
    order = finite[np.argsort(values[finite], kind="stable")]
    if len(order) < 2 or not errors.shape[1]:
        return None
    return Curve(
        group,
        case,
        quantity,
        int(part["mode"]),
        values[order],
        errors[order],
        predicted[order],
        claimed[order],
        float(elevations[0]),
        len(values) - len(order),
    )


def _read_claimed_value(claim: Claim | None) -> float:
    """Return the middle of what is claimed; NaN of a bound, or if nothing is."""
    if claim is None or not claim.values or None in claim.ends:
        return float("nan")
    return (claim.low + claim.high) / 2


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
    """Return the last value over the first, in the direction that should measure better.

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

    group: str  #: Whose error
    ends: tuple[float, float]  #: The factor's value where it should measure worst and best
    #: Error at the best end over that at the worst, of each curve: here, and as claimed
    ratios: Array
    claimed: Array
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


def estimate_effects(opened: Cubes, factor: Factor) -> list[Effect]:
    """Estimate one :class:`Effect` for each group that the cubes have.

    Cubes that remember what is derived of them (`derived`) are asked once for each factor.
    """
    for _, name, *_ in factor.sources:
        opened.get(name)  # counts as used, also where the answer is remembered
    remembered: dict[Factor, list[Effect]] = getattr(opened, "derived", {})
    if factor not in remembered:
        by: dict[str, list[Curve]] = {}
        for curve in read_curves(opened, factor):
            by.setdefault(curve.group, []).append(curve)
        remembered[factor] = [_estimate_effect(group, by[group], factor) for group in by]
    return remembered[factor]


def _estimate_effect(group: str, curves: list[Curve], factor: Factor) -> Effect:
    findings = [curve.judge_trend(factor.better) for curve in curves]
    against = [curve.judge_trend(-factor.better) for curve in curves]
    powers = [factor.exponent_of(curve.values) for curve in curves]
    low, high = (float(end(end(c.values) for c in curves)) for end in (min, max))
    claimed = np.array([end_ratio(c.claimed, factor.better) for c in curves])
    return Effect(
        group=group,
        ends=(low, high) if factor.better > 0 else (high, low),
        ratios=np.array([end_ratio(c.rms, factor.better) for c in curves]),
        claimed=claimed[np.isfinite(claimed)],
        exponents=np.array([fit_exponent(x, c.rms) for x, c in zip(powers, curves, strict=True)]),
        predicted=np.array(
            [fit_exponent(x, c.predicted) for x, c in zip(powers, curves, strict=True)]
        ),
        confident=sum(f.verdict == "agrees" for f in findings),
        opposite=sum(f.verdict == "agrees" for f in against),
        unchanged=sum(f.verdict == UNCHANGED for f in findings),
        not_monotonic=sum(
            bool(f.step_back) and (f.effect < 1) == (factor.better > 0) for f in findings
        ),
        single=float(np.mean([f.single for f in findings])),
        lost=max(c.lost for c in curves),
    )


def shape_and_sound(opened: Cubes) -> Iterator[tuple[str, list[tuple[Array, Array]]]]:
    """Yield by sound study the errors of the deflection and of the field, each (settings, trials).

    One pair for each mode and plane that has a reference pressure; all cases together.
    """
    for study in SOUND_STUDIES:
        if (cube := opened.get(f"sound-{study}")) is None:
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


def sound_trends(opened: Cubes, *factors: str) -> tuple[int, int]:
    """Count the simulated curves of the sound's error that fall as the shape's do, and all curves.

    Over some factors; if none is named, over all but the aperture.
    """
    found = [
        effect
        for name in factors or [name for name in FACTORS if name != "wider"]
        for effect in estimate_effects(opened, FACTORS[name])
        if effect.group == "sound"
    ]
    return sum(one.confident for one in found), sum(len(one.ratios) for one in found)


FIGURE_FILE = "conclusions.svg"
PANEL_GROUPS = dict(
    zip(("beam", "plate", "sound", "experiment"), [*CYCLE_COLORS[:3], CYCLE_COLORS[4]], strict=True)
)
CLAIM_MARK: dict[str, Any] = {"marker": "D", "markersize": 4, "markerfacecolor": "none"}
PANEL_TITLES = {
    "closer": "(a) distance, mm",
    "wider": "(b) aperture, °",
    "lower": "(c) elevation, °",
    "finer": "(d) width, px",
    "more": "(e) cameras",
}
PANEL_TICKS = {
    "closer": (500, 750, 1000, 1500),
    "wider": (20, 50, 150),
    "lower": (5, 10, 20, 60),
    "finer": (320, 640, 1920),
    "more": (2, 4, 6, 12),
}


def draw_summary(opened: Cubes) -> Figure:
    """Return five panels, one for each factor, all with the same axis of errors.

    A line is one case, the geometric mean over modes and planes of the rms over the trials; a
    diamond is one figure that the thesis states.
    """
    with in_style():
        drawing, panels = subplots(1, 5, figsize=(9.6, 3.6), sharey=True, layout="constrained")
        for axes, (name, factor) in zip(panels, FACTORS.items(), strict=True):
            _draw_factor(axes, list(read_curves(opened, factor)))
            _format_error_axis(axes, name, factor)
        panels[0].set(yscale="log", ylabel="rms error, %")
        panels[0].yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        spacing: dict[str, Any] = {"ncols": 3, "columnspacing": 1.2, "handlelength": 1.8}
        drawing.legend(handles=_draw_legend(), loc="outside lower center", **spacing)
    return drawing


def _draw_factor(axes: Axes, found: Sequence[Curve]) -> None:
    by: dict[tuple[str, str], list[Curve]] = {}
    for curve in found:
        by.setdefault((curve.group, curve.case), []).append(curve)
        thin: dict[str, Any] = {"linestyle": "", "markeredgewidth": 0.7, "alpha": 0.8, "zorder": 3}
        color = _choose_color(curve.group)
        axes.plot(curve.values, curve.claimed, color=color, **thin, **CLAIM_MARK)
    for (group, _), alike in by.items():
        mean = np.exp(np.mean([np.log(curve.rms) for curve in alike], axis=0))
        style = ".--" if "rendered" in group else ".-"
        color = _choose_color(group)
        axes.plot(alike[0].values, mean, style, color=color, linewidth=1.2, markersize=4)


def _format_error_axis(axes: Axes, name: str, factor: Factor) -> None:
    axes.set(xscale="log", title=PANEL_TITLES[name])
    axes.xaxis.set_major_locator(FixedLocator(PANEL_TICKS[name]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    if factor.better < 0:  # to the right is what should measure better
        axes.invert_xaxis()


def _choose_color(group: str) -> str:
    return PANEL_GROUPS[group.partition(",")[0]]


def _draw_legend() -> list[Line2D]:
    lines = [Line2D([], [], color=color, label=name) for name, color in PANEL_GROUPS.items()]
    grey = "#555555"
    rendered = Line2D([], [], color=grey, linestyle="--", label="rendered recordings")
    stated = Line2D([], [], color=grey, linestyle="", label="thesis", **CLAIM_MARK)
    return [*lines, rendered, stated]


def write_summary_figure(made: Iterable[Path], folder: Path) -> None:
    """Draw the figure of the cubes `made` into a folder; those that it lacks are left out."""
    names = {name for factor in FACTORS.values() for _, name, _, _ in factor.sources}
    opened = {path.stem: cube_file.read_cube(path) for path in made if path.stem in names}
    files.whole_text(folder / FIGURE_FILE, figure_svg(draw_summary(opened)))
