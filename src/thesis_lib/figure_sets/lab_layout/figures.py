"""Optima, figures and tables of the cubes of ``lab-elevation`` and ``lab-layout``."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Rectangle

from thesis_lib.arrays import Array, ArrayLike
from thesis_lib.facts import setups
from thesis_lib.plotting import panels as figures, selection, style
from thesis_lib.studies import cubes, fields

MAX_NEAR_OPTIMUM = 1.1  # ratio to the least error up to which errors count as near it
MIN_LOST = 0.0005  # share of lost or wrong markers from which a setting is listed
CURVE_POINTS = 400  # points at which a curve is evaluated
PALE_GREY = "#c8c8c8"
LAW_CURVE = {"predicted_error": ("law, equal centre uncertainty", "_", style.BLACK_COLOR)}
PART_CURVES = {
    "noise_error": ("scatter alone", "-", style.SKY),
    "bias_error": ("bias alone", "-", style.ORANGE),
}
_LINE_STYLE: Any = {"markersize": 4, "linewidth": 1}
CENTRE_CURVES: list[tuple[str, str, str, Any]] = [  # variable, label, line, style
    ("centre_scatter", "scatter", "o-", _LINE_STYLE),
    ("centre_bias", "bias", "s:", _LINE_STYLE),
    ("edge_scatter", "law of edges", "_", {"markersize": 9}),
]
VARIED_NAMES = {
    "elevation_deg": "elevation φ",
    "distance_mm": "distance d",
    "aperture_deg": "aperture α",
}


def average_errors(part: xr.Dataset) -> Array:
    """Return the rms error over the trials, or of trial 0 if there are none, (settings,), %."""
    error = part["mean_error"].transpose("setting", "trial")
    alone = error.sizes["trial"] == 1
    return (error.isel(trial=0) if alone else selection.trial_rms(error)).values


@dataclass(frozen=True)
class Optimum:
    """The minimum of an error, on a curve through the settings."""

    #: Elevation in degrees and error in % at the minimum
    at: float
    error: float
    #: Elevations between which the error is at most :data:`MAX_NEAR_OPTIMUM` times the least, °
    low: float
    high: float


def find_optimum(values: ArrayLike, errors: ArrayLike) -> Optimum | None:
    """Find the minimum of a curve through errors (n,) at values (n,), without those that are NaN.

    The curve is an Akima spline of the logarithms of both, between the outermost settings that have
    an error; None if there are fewer than three.

    Examples
    --------
    >>> best = find_optimum([5, 10, 20, 40], [2, 1, 1, 2])
    >>> round(best.at, 1), round(best.error, 2)
    (14.1, 0.92)
    """
    x, y = np.asarray(values, float), np.asarray(errors, float)
    order = np.argsort(x)
    order = order[np.isfinite(y[order])]
    if len(order) < 3:
        return None
    x, y = np.log(x[order]), np.log(y[order])
    fine = np.linspace(x[0], x[-1], CURVE_POINTS)
    curve = scipy.interpolate.Akima1DInterpolator(x, y)(fine)
    least = int(np.argmin(curve))
    far = np.flatnonzero(curve > curve[least] + np.log(MAX_NEAR_OPTIMUM))
    first = int(np.max(far[far < least], initial=-1)) + 1
    last = int(np.min(far[far > least], initial=CURVE_POINTS)) - 1
    at, low, high = (float(np.exp(fine[index])) for index in (least, first, last))
    return Optimum(at, float(np.exp(curve[least])), low, high)


def select_complete(part: xr.Dataset) -> xr.Dataset:
    """Select the settings in which every marker is measured, whose errors are comparable."""
    return part.isel(setting=np.flatnonzero(part["missing"].values[:, 0] == 0))


def select_known(part: xr.Dataset) -> xr.Dataset:
    """Select the settings that have an error."""
    return part.isel(setting=np.flatnonzero(np.isfinite(average_errors(part))))


def select_viewable(cube: xr.Dataset) -> xr.Dataset:
    """Select the settings for a viewer: of camera sets, the best and worst of each number."""
    kept: list[int] = []
    for case, part in selection.split_cases(cube).items():
        rows = np.flatnonzero(cube["case"].values == case)
        if case == "subsets":
            error = np.nan_to_num(average_errors(part), nan=np.inf)
            count = part["n_cameras"].values
            groups = [np.flatnonzero(count == n) for n in np.unique(count)]
            ends = [own[[np.argmin(error[own]), np.argmax(error[own])]] for own in groups]
            rows = rows[list(dict.fromkeys(np.concatenate(ends).tolist()))]
        kept += rows.tolist()
    return cube.isel(setting=kept)


# Figures.


def figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the figure of a case."""
    part = selection.select_settings(cube, case, mode)
    if case == "subsets":
        drawing = Figure(figsize=(7.6, 6.6), layout="constrained")
        parts = drawing.subfigures(2, 2, squeeze=False, height_ratios=[1.0, 1.05])
        if (known := select_known(part)).sizes["setting"]:
            _draw_plans(parts[0, 0], known)
            _compare_with_law(parts[0, 1].subplots(), parts[1, 0].subplots(), known)
            _by_number(parts[1, 1].subplots(), known)
        return drawing
    part = part.sortby("value")
    values, varied = part["value"].values, str(part["parameter"].values[0])
    drawing, axes = style.subplots(2, 2, figsize=(7.6, 6.0))
    figures.setup_panel(axes[0, 0], cube, part)
    axes[0, 0].set_title(f"(a) setups: {VARIED_NAMES[varied]} varied")
    _draw_errors(axes[0, 1], part)
    for name, label, look, how in CENTRE_CURVES:
        for axis, tone in (("u", style.RED), ("v", style.GREEN)):
            one = part[name].sel(axis=axis)
            axes[1, 0].plot(values, one, look, color=tone, label=f"{label}, {axis}", **how)
    axes[1, 0].set_yscale("log")
    axes[1, 0].set(title="(c) scatter and bias of the centres", ylabel="px")
    _add_key(axes[1, 0], room=0.35, ncols=3, handlelength=1.8)
    swept = varied == "elevation_deg"
    (_draw_lost if swept else _draw_along)(axes[1, 1], part)
    for panel in axes.flat[1 : 4 if swept else 3]:
        style.make_logarithmic(panel.xaxis, values)
        panel.set_xlabel(f"{VARIED_NAMES[varied]} in {fields.unit_of_field(varied)}")
        panel.set_xlim(values.min() / 1.15, values.max() * 1.15)
    return drawing


def _draw_errors(axes: Axes, part: xr.Dataset) -> None:
    values, error = part["value"].values, part["mean_error"].transpose("setting", "trial").values
    style.draw_curves(axes, values, part, LAW_CURVE, markersize=10)
    style.draw_curves(axes, values, part, PART_CURVES, linewidth=1)
    if error.shape[1] > 1:
        low, high = np.quantile(error[:, 1:], [0.05, 0.95], axis=1)
        label = f"5–95 % of {cubes.trials_are(part)}"
        axes.vlines(values, low, high, color=style.BLUE, linewidth=1.4, label=label)
        look: Any = {"color": style.BLUE, "markersize": 4}
        axes.plot(values, average_errors(part), "o", label="rms over these", **look)
    look = {"markerfacecolor": "none", "color": style.HIGHLIGHT_COLOR, "markersize": 4}
    axes.plot(values, error[:, 0], "D", label="rendered run", **look)
    whole, swept = select_complete(part), part["parameter"].values[0] == "elevation_deg"
    best = find_optimum(whole["value"].values, average_errors(whole)) if swept else None
    if best is not None:
        axes.axvspan(best.low, best.high, color=style.BLUE, alpha=0.08, linewidth=0)
        axes.axvline(best.at, color=style.BLUE, linewidth=0.8, linestyle=":")
        where: Any = {"fontsize": 8, "transform": axes.get_xaxis_transform()}
        axes.text(best.at, 0.55, f" least at {best.at:.0f}°", color=style.BLUE, **where)
    axes.set_yscale("log")
    axes.set(title="(b) mean (rms) error", ylabel="% of the largest deflection")
    _add_key(axes, room=0.45, ncols=2, handlelength=1.4)


def _add_key(axes: Axes, room: float, **how: Any) -> None:
    """Add plain ticks and a legend, with some room for it above the curves."""
    style.add_legend(axes, room, "upper center", columnspacing=1, fontsize=7, **how)
    plain_ticks(axes.yaxis)


def _draw_lost(axes: Axes, part: xr.Dataset) -> None:
    values, grey = part["value"].values, "#555555"
    look: Any = {"color": style.BLACK_COLOR, "markersize": 4}
    axes.plot(values, 100 * part["lost"], "o-", label="lost, of all", **look)
    look = {"markerfacecolor": "none", "color": style.HIGHLIGHT_COLOR, **_LINE_STYLE}
    axes.plot(values, 100 * part["wrong"], "D-", label="wrong, of those found", **look)
    for value, height in zip(values, part["image_height"].values, strict=True):
        axes.text(value, 112, f"{height:.1f}", ha="center", fontsize=7, color=grey)
    where: Any = {"ha": "center", "fontsize": 7, "color": grey, "transform": axes.transAxes}
    axes.text(0.5, 0.93, "height of a marker's image in px", **where)
    axes.set(title="(d) markers that are lost", ylabel="%", ylim=(-4, 134))
    axes.set_yticks([0, 25, 50, 75, 100])
    axes.legend(loc="center right")


def _draw_along(axes: Axes, part: xr.Dataset) -> None:
    known = select_known(part)
    error = average_errors(known)
    ends = ("best", np.argmin, style.BEST_COLOR), ("worst", np.argmax, style.WORST_COLOR)
    for word, choose, ink in ends[: len(error)]:
        one = known.isel(setting=int(choose(error)))
        label = f"{one['label'].item()} ({word})"
        axes.plot(one["x"] * 1000, one["point_error"], ".-", label=label, color=ink, lw=1)
    if error.size:
        axes.legend()
    axes.set(title="(d) error of each marker", xlabel="x in mm", ylim=(0, None))
    axes.set_ylabel("% of the largest deflection")


def plain_ticks(axis: Axis) -> None:
    """Put ticks of a logarithmic axis at 1, 2 and 5 times powers of ten, or only at the powers."""
    low, high = axis.get_view_interval()
    style.make_logarithmic(axis, style.TICK_STEPS[:: 1 if high / low < 100 else 3])


def _draw_plans(place: SubFigure, part: xr.Dataset) -> None:
    """Draw plans of the best and the worst sets of two, three and four cameras."""
    error, count = average_errors(part), part["n_cameras"].values
    shown = np.unique(count)[:3]
    panels = place.subplots(2, len(shown), squeeze=False)
    every = 1000 * figures.camera_centres(part.isel(setting=int(np.argmax(count))))[:, :2]
    reach = 1.25 * np.abs(every).max()
    length, width = (1000 * side for side in setups.thesis_beam().extent)
    for column, n in enumerate(shown):
        own = np.flatnonzero(count == n)
        order = own[np.argsort(error[own], kind="stable")]
        ends = zip(panels[:, column], order[[0, -1]], ("best", "worst"), strict=True)
        ground: Any = {"color": style.REFERENCE_COLOR, "linewidth": 0}
        for axes, index, word in ends:
            one = part.isel(setting=int(index))
            axes.add_patch(Rectangle((-length / 2, -width / 2), length, width, **ground))
            axes.plot(*every.T, ".", color="#cccccc", markersize=3)
            names = str(one["label"].item()).split("–")
            for name, (x, y) in zip(names, 1000 * figures.camera_centres(one)[:, :2], strict=True):
                axes.plot([0, x], [0, y], color=style.BLUE, linewidth=0.6, alpha=0.6)
                axes.plot(x, y, "o", color=style.BLUE, markersize=4)
                axes.annotate(name, (1.17 * x, 1.17 * y), ha="center", va="center", fontsize=7)
            axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
            axes.set_title(f"{word} {n}: {error[index]:.3g} %", fontsize=8, loc="center")
            axes.axis("off")
    place.suptitle("(a) best and worst sets in plan", fontsize=9, x=0.02, ha="left")


def _compare_with_law(axes: Axes, ratio: Axes, part: xr.Dataset) -> None:
    law, error = part["predicted_error"].values, average_errors(part)
    literal, count = part["mean_error"].values[:, 0], part["n_cameras"].values
    axes.plot(law, literal, ".", color=PALE_GREY, markersize=3, label="rendered run")
    numbers = np.unique(count)
    for n, tone in zip(numbers, style.ordered_colors(len(numbers)), strict=True):
        axes.plot(law[count == n], error[count == n], ".", color=tone, markersize=4, label=f"{n}")
    ends = [min(law.min(), error.min()), max(law.max(), error.max())]
    axes.plot(ends, ends, color=style.BLACK_COLOR, linewidth=0.8)
    axes.set(xscale="log", yscale="log", ylabel="error, %")
    axes.set_xlabel("law, % of the largest deflection")
    axes.set_title(f"(b) rms over {cubes.trials_are(part)} against the law")
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    axes.legend(ncols=2, fontsize=7, columnspacing=1, handletextpad=0.2)
    both = np.concatenate([error / law, literal / law])
    bins = np.linspace(min(np.nanmin(both), 0.98), max(np.nanmax(both), 1.02), 31).tolist()
    ratio.hist(literal / law, bins, color=PALE_GREY, label="rendered run")
    label = f"rms over {cubes.trials_are(part)}"
    ratio.hist(error / law, bins, histtype="step", color=style.BLUE, label=label)
    ratio.legend()
    ratio.axvline(1, color=style.BLACK_COLOR, linewidth=0.8)
    ratio.set(title="(c) error over the law", xlabel="ratio", ylabel="sets")


def _by_number(axes: Axes, part: xr.Dataset) -> None:
    error, count = average_errors(part), part["n_cameras"].values
    n = np.unique(count)
    axes.set_title("(d) error by the number of cameras")
    axes.plot(count, error, ".", color=PALE_GREY, markersize=4)
    groups = [error[count == k] for k in n]
    curves = ("best", np.min, "v-", 0.6), ("mean", np.mean, "o-", 1.0), ("worst", np.max, "^-", 0.6)
    for name, function, look, alpha in curves:
        how: Any = {**_LINE_STYLE, "color": style.BLUE, "alpha": alpha}
        axes.plot(n, [function(own) for own in groups], look, label=name, **how)
    root = groups[0].min() * np.sqrt(n[0] / n)
    axes.plot(n, root, "--", color=style.BLACK_COLOR, linewidth=1, label="best pair, as 1/√n")
    axes.set(yscale="log", xlabel="cameras", ylabel="% of the largest deflection")
    plain_ticks(axes.yaxis)
    axes.set_xticks(n)
    axes.legend()


def tabulate_settings(cube: xr.Dataset) -> dict[str, Any]:
    """Return the settings with a recording of their own, with rms and band of their trials.

    Among sets of cameras that is the set of all cameras.
    """
    settings = []
    for case, part in selection.split_cases(cube).items():
        for one in list(cubes.iterate_slices(part, "setting"))[-1 if case == "subsets" else 0 :]:
            drawn, trials = one["mean_error"].values[1:], None
            if len(drawn) and np.isfinite(drawn).all():
                trials = np.sqrt(np.mean(drawn**2)), *np.quantile(drawn, [0.05, 0.95])
            settings.append((one, trials))
    return {"settings": settings}


def tabulate_optima(cube: xr.Dataset) -> dict[str, Any]:
    """Return the optimum of every case, and the settings in which tracking fails."""
    optima = []
    for case, every_setting in selection.split_cases(cube).items():
        part = select_complete(every_setting).sortby("value")
        values, errors = part["value"].values, part["mean_error"].transpose("trial", "setting")
        best = find_optimum(values, average_errors(part))
        drawn = [find_optimum(values, own) for own in errors.values[1:]]
        places = [own.at for own in drawn if own is not None]  # of each trial by itself
        height, spread = 0.0, np.quantile(places, [0.05, 0.95]) if places else None
        if best is not None:
            slopes = np.sin(np.radians(values))
            height = np.interp(np.sin(np.radians(best.at)), slopes, part["image_height"].values)
        optima.append((case, part, best, spread, height))
    every = list(cubes.iterate_slices(cube, "setting"))
    return {
        "optima": optima,
        "unfound": [one for one in every if one["lost"] == 1],
        "lost": [one for one in every if MIN_LOST <= one["lost"] < 1],
        "wrong": [one for one in every if one["wrong"] >= MIN_LOST],
    }


def fit_powers(cube: xr.Dataset) -> dict[str, Any]:
    """Fit powers of the distance to error, law and scatter."""
    if (part := selection.split_cases(cube).get("distance")) is None:
        return {"powers": None}
    part = select_known(part)
    if part.sizes["setting"] < 2:
        return {"powers": []}
    x, labels = np.log(part["value"].values), part["label"].values
    values = {
        f"error, rms over the {cubes.trials_are(cube)}, %": average_errors(part),
        "law, one noise for all, %": part["predicted_error"].values,
        "scatter of the centres along u, px": part["centre_scatter"].values[:, 0],
        "scatter of the centres along v, px": part["centre_scatter"].values[:, 1],
    }
    powers = [(name, own, np.polyfit(x, np.log(own), 1)[0]) for name, own in values.items()]
    return {"powers": powers, "first": labels[0], "last": labels[-1]}


def compare_numbers(cube: xr.Dataset) -> dict[str, Any]:
    """Find the best and worst sets by their number of cameras, and compare with the best pair."""
    if (every := selection.split_cases(cube).get("subsets")) is None:
        return {"numbers": None}
    part = select_known(every)
    count, law = part["n_cameras"].values, part["predicted_error"].values
    error = average_errors(part)
    best_pair = np.min(error[count == 2], initial=np.inf)

    def name_optimum(one: Any) -> tuple[str, float]:
        return part["label"].values[one], error[one]

    def worse_than_pair(chosen: Any = slice(None)) -> list[dict[str, int]]:
        """Count sets that are worse than the best pair, by their number of cameras above two."""
        sets = [(n, error[chosen][count[chosen] == n]) for n in np.unique(count[chosen]) if n > 2]
        return [
            {"worse": int(np.sum(own > best_pair)), "count": len(own), "cameras": n}
            for n, own in sets
        ]

    numbers = []
    for n in np.unique(count):
        own = np.flatnonzero(count == n)
        order = own[np.argsort(error[own], kind="stable")]
        ends = name_optimum(order[0]), name_optimum(own[np.argmin(law[own])]), np.median(error[own])
        numbers.append((n, len(own), *ends, name_optimum(order[-1])))
    # Whether all cameras of a set look from one side of the beam's axis
    across = np.cos(np.radians(part["camera_azimuth"].transpose("setting", "camera").values))
    left, right = (~np.any(side * across < 1e-9, axis=1) for side in (1, -1))
    ratio, rendered = error / law, part["mean_error"].isel(trial=0).values / law
    return {
        "numbers": numbers,
        "beaten": [sets for sets in worse_than_pair() if sets["worse"]],
        "from_one_side": worse_than_pair(left | right),
        "ratio": ratio,
        "median_ratio": np.median(ratio) if ratio.size else np.nan,
        "rendered": rendered[np.isfinite(rendered)],
    }


def compare_cameras(cube: xr.Dataset) -> dict[str, Any]:
    """Divide the error of each set with a camera by that of the set without it."""
    if (part := selection.split_cases(cube).get("subsets")) is None:
        return {"shares": None}
    names_of = [frozenset(label.split("–")) for label in part["label"].values]
    error = dict(zip(names_of, average_errors(part).tolist(), strict=True))
    every, whole = max(error, key=len), part.isel(setting=-1)
    shares = []
    for number, name in enumerate(sorted(every)):
        factors = [
            error[names | {name}] / without for names, without in error.items() if name not in names
        ]
        place = whole["camera_azimuth"][number], whole["camera_elevation"][number]
        if factors:
            shares.append((name, *place, factors, np.exp(np.mean(np.log(factors)))))
    return {"shares": shares}


TEXTS: dict[str, Callable[[xr.Dataset], dict[str, Any]]] = {
    "errors": tabulate_settings,
    "localisation": tabulate_settings,
    "optima": tabulate_optima,
    "slopes": fit_powers,
    "numbers": compare_numbers,
    "shares": compare_cameras,
    "results": lambda cube: fit_powers(cube) | compare_numbers(cube) | compare_cameras(cube),
}
