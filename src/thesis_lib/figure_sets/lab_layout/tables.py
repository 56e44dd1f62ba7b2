"""Tables of ``lab-elevation`` and ``lab-layout``, from their cubes, as Markdown."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.arrays import IntArray
from thesis_lib.figure_sets.lab_layout.optima import (
    cases,
    complete,
    expected,
    one_sided,
    optimum,
    part_of,
    ratios,
    trial_optima,
)
from thesis_lib.studies.cubes import trials_are
from thesis_lib.web.markdown import columns, table

Table = Callable[[xr.Dataset], str]


def errors(cube: xr.Dataset) -> str:
    """Errors of every setting, of sets of cameras only of those with all of them."""
    rows = []
    for case in cases(cube):
        for one in _filmed(part_of(cube, case)):
            drawn = one["mean_error"].values[1:]
            trials = "—"
            if len(drawn) and np.isfinite(drawn).all():
                low, high = np.quantile(drawn, [0.05, 0.95])
                rms = float(np.sqrt(np.mean(drawn**2)))
                trials = f"{_percent(rms)} ({_percent(low)}–{_percent(high)})"
            rows.append(
                {
                    "case": case,
                    "setting": str(one["label"].item()),
                    "rendered, %": _percent(float(one["mean_error"][0])),
                    f"{trials_are(cube)}, rms (5–95 %), %": trials,
                    "law, %": _percent(float(one["predicted_error"])),
                    "no result": f"{float(one['missing'][0]):.0%}",
                }
            )
    return columns(rows) + (
        "\nMean (rms) errors in % of the largest deflection, over the markers that have a result; "
        "a dash where none has. *Law*: to first order, with centres as exact everywhere as in the "
        "case's best recording. *No result*: share of the markers.\n"
    )


def _filmed(part: xr.Dataset) -> list[xr.Dataset]:
    """The settings of a case that are recordings of their own; of sets the one of all cameras."""
    count = part.sizes["setting"]
    sets = part["case"].values[0] == "subsets"
    return [part.isel(setting=number) for number in range(count - 1 if sets else 0, count)]


# Elevation.


def optima(cube: xr.Dataset) -> str:
    """The elevation of the least error, case by case, and where tracking fails."""
    rows = []
    for case in cases(cube):
        part = complete(part_of(cube, case))
        best, drawn = optimum(part["value"].values, expected(part)), trial_optima(part)
        if best is None:
            rows.append({"case": case})
            continue
        width, height = int(part["width_px"][0]), int(part["height_px"][0])
        spread = "—"
        if len(drawn):
            low, high = np.quantile(drawn, [0.05, 0.95])
            spread = f"{low:.0f}–{high:.0f}°"
        tall = np.interp(
            np.sin(np.radians(best.at)),
            np.sin(np.radians(part["value"].values)),
            part["image_height"].values,
        )
        rows.append(
            {
                "case": case,
                "frames": f"{width}×{height}",
                "least at": f"{best.at:.0f}°",
                f"5–95 % of the {trials_are(cube)}": spread,
                "within a tenth of it": f"{best.low:.0f}–{best.high:.0f}°",
                "least error, %": _percent(best.error),
                "height there, px": f"{tall:.1f}",
            }
        )
    return columns(rows) + (
        "\nOn a curve through the settings in which every marker has a result; *height* is that of "
        f"a marker's image. {failures(cube)}\n"
    )


def failures(cube: xr.Dataset) -> str:
    """In which settings markers are lost or taken for others, in words."""
    found: dict[str, list[str]] = {
        "In the first frame too few markers are found to go on": [],
        "Part of the markers' images are lost": [],
        "Markers are taken for others": [],
    }
    whole, some, others = found.values()
    for number in range(cube.sizes["setting"]):
        one = cube.isel(setting=number)
        name = f"{one['case'].item()}, {one['label'].item()}"
        lost, wrong = float(one["lost"]), float(one["wrong"])
        if lost == 1:
            whole.append(name)
        elif lost >= 0.0005:
            some.append(f"{name} ({lost:.1%})")
        if wrong >= 0.0005:
            others.append(f"{name} ({wrong:.1%} of those found)")
    said = [f"{text} in: {'; '.join(names)}." for text, names in found.items() if names]
    return " ".join(said) or "No marker is lost or taken for another."


def localisation(cube: xr.Dataset) -> str:
    """How well the centres are found in every setting that renders something of its own."""
    rows = []
    for case in cases(cube):
        for one in _filmed(part_of(cube, case)):
            rows.append(
                {
                    "case": case,
                    "setting": str(one["label"].item()),
                    "height, px": f"{float(one['image_height']):.1f}",
                    "scatter u · v, px": _pair(one["centre_scatter"]),
                    "law of edges, px": _pair(one["edge_scatter"]),
                    "bias u · v, px": _pair(one["centre_bias"]),
                    "lost": f"{float(one['lost']):.1%}",
                    "wrong": _share(float(one["wrong"])),
                    "by scatter, %": _percent(float(one["noise_error"])),
                    "by bias, %": _percent(float(one["bias_error"])),
                }
            )
    return columns(rows) + (
        "\nHeight of a marker's image; scatter and bias of the centres within 1 px of the truth, "
        "while the others are *wrong*: other markers. The *law of edges* is the least scatter that "
        "images of this size can have. By scatter and by bias alone: mean error in % of the "
        "largest deflection.\n"
    )


def _pair(values: xr.DataArray) -> str:
    u, v = values.values
    return "—" if np.isnan(u) else f"{u:.4f} · {v:.4f}"


def _percent(value: float) -> str:
    return "—" if np.isnan(value) else f"{value:#.3g}"


def _share(value: float) -> str:
    return "—" if np.isnan(value) else f"{value:.1%}"


# Layout.


def slopes(cube: xr.Dataset) -> str:
    """How error, law and scatter grow with the distance: exponents of fitted powers."""
    part = part_of(cube, "distance")
    error = expected(part)
    known = np.isfinite(error)
    if np.count_nonzero(known) < 2:
        return "Fewer than two distances have an error.\n"
    x = np.log(part["value"].values[known])
    scatter = part["centre_scatter"].values
    first, *_, last = part["label"].values[known]
    return columns(
        {
            "": name,
            f"at {first}": f"{values[known][0]:.4f}",
            f"at {last}": f"{values[known][-1]:.4f}",
            "power of the distance": f"{np.polyfit(x, np.log(values[known]), 1)[0]:.2f}",
        }
        for name, values in (
            (f"error, rms over the {trials_are(cube)}, %", error),
            ("law, one noise for all, %", part["predicted_error"].values),
            ("scatter of the centres along u, px", scatter[:, 0]),
            ("scatter of the centres along v, px", scatter[:, 1]),
        )
    )


def numbers(cube: xr.Dataset) -> str:
    """Sets of cameras by their number: the best, the worst, and what the law says of them."""
    part = part_of(cube, "subsets")
    error, labels = expected(part), part["label"].values
    count, law = part["n_cameras"].values, part["predicted_error"].values
    best_pair = np.nanmin(error[count == 2], initial=np.inf)

    def worse_than_it(own: IntArray, n: int) -> str:
        return f"{np.count_nonzero(error[own] > best_pair)} of the {len(own)} of {n}"

    rows, beaten = [], []
    for n in np.unique(count):
        own = np.flatnonzero((count == n) & np.isfinite(error))
        if not len(own):
            continue
        order = own[np.argsort(error[own], kind="stable")]
        best, foreseen, worst = (
            f"{labels[one]}: {_percent(error[one])}"
            for one in (order[0], own[np.argmin(law[own])], order[-1])
        )
        median = _percent(float(np.median(error[own])))
        rows.append([str(n), str(len(own)), best, foreseen, median, worst])
        if np.any(error[own] > best_pair) and n > 2:
            beaten.append(worse_than_it(own, n))
    header = ["cameras", "sets", "best", "best by the law", "median", "worst"]
    quotient = ratios(part)[np.isfinite(error)]
    text = f"\nRms over the {trials_are(cube)} of the rms error, in % of the largest deflection."
    if beaten:
        text += f" The best pair is better than these sets: {', '.join(beaten)} cameras."
    side = one_sided(part) & np.isfinite(error)
    counts = [(np.flatnonzero(side & (count == n)), n) for n in np.unique(count) if n > 2]
    worse = [worse_than_it(own, n) for own, n in counts if len(own)]
    if worse:
        text += f" Of sets that look from one side alone it is better than {', '.join(worse)}."
    if len(quotient):
        rendered = (part["mean_error"].isel(trial=0) / part["predicted_error"]).values
        rendered = rendered[np.isfinite(rendered)]
        text += (
            f" Over all {len(quotient)} sets the error divided by the law's prediction lies "
            f"between {quotient.min():.2f} and {quotient.max():.2f}, with a median of "
            f"{np.median(quotient):.2f}. That of one recording alone lies between "
            f"{rendered.min():.2f} and {rendered.max():.2f}."
        )
    return table(header, rows) + text + "\n"


def shares(cube: xr.Dataset) -> str:
    """What each camera adds to the sets without it: their error with it over that without."""
    part = part_of(cube, "subsets")
    names_of = [frozenset(label.split("–")) for label in part["label"].values]
    error = dict(zip(names_of, expected(part).tolist(), strict=True))
    every, whole = max(error, key=len), part.isel(setting=part.sizes["setting"] - 1)
    rows = []
    for number, name in enumerate(sorted(every)):
        factor = [
            error[names | {name}] / without for names, without in error.items() if name not in names
        ]
        if factor:
            rows.append(
                {
                    "camera": name,
                    "azimuth": f"{float(whole['camera_azimuth'][number]):g}°".replace("-", "−"),
                    "elevation": f"{float(whole['camera_elevation'][number]):g}°",
                    "sets without it": f"{len(factor)}",
                    "mean": f"×{np.exp(np.mean(np.log(factor))):.2f}",
                    "at best": f"×{min(factor):.2f}",
                    "at worst": f"×{max(factor):.2f}",
                }
            )
    return columns(rows) + (
        "\nThe error of a set with the camera over that of the set without it: geometric mean and "
        "extremes.\n"
    )


# What pages and notebooks include.


def of_case(case: str, make: Table) -> Table:
    """A table of one case, or that the case was not asked for."""

    def made(cube: xr.Dataset) -> str:
        return make(cube) if case in cases(cube) else f"The case {case} was not asked for.\n"

    return made


TABLES: dict[str, Table] = {
    "errors": errors,
    "optima": optima,
    "localisation": localisation,
    "slopes": of_case("distance", slopes),
    "numbers": of_case("subsets", numbers),
    "shares": of_case("subsets", shares),
}


def shown(cube: xr.Dataset, name: str) -> Markdown:
    """One of the tables, for a notebook."""
    return Markdown(TABLES[name](cube))


def layout_results(cube: xr.Dataset) -> str:
    """What the book's page says of ``lab-layout``."""
    return "\n".join(TABLES[name](cube) for name in ("slopes", "numbers", "shares"))


RESULTS: dict[str, Table] = {"lab-elevation": optima, "lab-layout": layout_results}
