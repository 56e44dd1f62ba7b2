"""The standard figure framework of the parametric studies, drawn from a cube.

Four panels as in the thesis: (a) the setups, (b) reference and measured shape, (c) error of each
marker, (d) mean error of each setting. Added here: the 5–95 % band of the trials, the prediction
by the law of rounding, and what the thesis states. One colour stands for one setting throughout.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from thesis_lib import setups
from thesis_lib.cameras import hemisphere_directions, hemisphere_rotations
from thesis_lib.claims import Claim, read_claims
from thesis_lib.parameters import STUDIES

Array = NDArray[np.float64]

# Okabe and Ito's palette: told apart with any colour vision, mid-tone on white and on black.
COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9")
REFERENCE = "#8a8a8a"
HIGHLIGHT = "#B22222"
STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "svg.hashsalt": "thesis",  # the same picture gives the same bytes
}


def color(index: int) -> str:
    """Colour of the `index`-th setting of a case; they repeat after six."""
    return COLORS[index % len(COLORS)]


def select(cube: xr.Dataset, case: str, mode: int) -> xr.Dataset:
    """The settings of one case and one mode."""
    rows = np.flatnonzero(cube["case"].values == case)
    return cube.isel(setting=rows).sel(mode=mode)


def has(cube: xr.Dataset, case: str, mode: int) -> bool:
    """Whether a cube holds a case and a mode."""
    return case in cube["case"].values and mode in cube["mode"].values


def best_and_worst(part: xr.Dataset) -> list[int]:
    """Indices of the settings with the least and the largest mean error in the literal run."""
    mean = part["mean_error"].isel(trial=0).values
    order = np.argsort(mean, kind="stable")
    return [int(order[0])] if len(order) == 1 else [int(order[0]), int(order[-1])]


def stated(case: str, mode: int, values: Iterable[float]) -> list[Claim | None]:
    """What the thesis states of the mean error at each value of the varied parameter, if it does.

    A claim about all settings counts for each of them.
    """
    claims = {
        claim.value: claim
        for claim in read_claims()
        if (claim.case, claim.mode, claim.quantity) == (case, mode, "mean_error")
    }
    return [claims.get(value, claims.get(None)) for value in values]


def band(part: xr.Dataset, quantity: str = "mean_error") -> Array:
    """Quantiles 5, 50 and 95 % over the trials, shape (3, setting); of trial 0 if alone."""
    values = part[quantity].transpose("setting", "trial").values
    drawn = values[:, 1:] if values.shape[1] > 1 else values
    quantiles: Array = np.quantile(drawn, [0.05, 0.5, 0.95], axis=1)
    return quantiles


def figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """The four-panel figure of one case and mode.

    Parameters
    ----------
    cube : xarray.Dataset
        Cube of a camera study.
    case : str
        Case or layout that the cube holds.
    mode : int
        Mode that the cube holds.
    """
    part = select(cube, case, mode)
    study = STUDIES[cube.attrs["figure_set"]]
    chosen = best_and_worst(part)
    labels = list(part["label"].values)
    with plt.rc_context(STYLE):
        drawing, axes = plt.subplots(2, 2, figsize=(7.6, 5.4), layout="constrained")
        _setup_panel(axes[0, 0], part, study.varied)
        axes[0, 0].set_title(f"(a) setups: {study.varied_label} varied")

        x = part["x"].values * 1000
        reference = part["reference_deflection"].values * 1000
        axes[0, 1].plot(x, reference, color=REFERENCE, linewidth=3, label="reference")
        for index in chosen:
            measured = part["measured_deflection"].values[index, 0] * 1000
            name = "best" if index == chosen[0] else "worst"
            axes[0, 1].plot(x, measured, ".-", color=color(index), linewidth=1,
                            label=f"{labels[index]} ({name})")  # fmt: skip
            error = part["point_error"].values[index]
            axes[1, 0].plot(x, error, ".-", color=color(index), linewidth=1, label=labels[index])
        axes[0, 1].set(title="(b) deflection shape", xlabel="x in mm", ylabel="w in mm")
        axes[1, 0].set(title="(c) error of each marker", xlabel="x in mm",
                       ylabel="% of the largest deflection", ylim=(0, None))  # fmt: skip
        axes[0, 1].legend()
        axes[1, 0].legend()
        _bar_panel(axes[1, 1], part, stated(case, mode, part["value"].values))
    plt.close(drawing)
    return drawing


def as_svg(cube: xr.Dataset, case: str, mode: int) -> str:
    """The figure of one case and mode as SVG; the same cube gives the same text."""
    text = io.StringIO()
    with plt.rc_context(STYLE):
        figure(cube, case, mode).savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()


def _bar_panel(axes: Axes, part: xr.Dataset, claims: list[Claim | None]) -> None:
    low, median, high = band(part)
    literal = part["mean_error"].values[:, 0]
    position = np.arange(len(literal))
    colors = [color(index) for index in range(len(position))]
    axes.bar(position, literal, 0.62, color=colors, alpha=0.75, label="literal run")
    axes.vlines(position, low, high, color="#222222", linewidth=1.2, label="5–95 % of trials")
    axes.plot(position, median, "o", color="#222222", markersize=4, label="median")
    axes.plot(position, part["predicted_error"].values, "_", color="#222222", markersize=18,
              label="law of rounding")  # fmt: skip
    given = [(i, claim) for i, claim in enumerate(claims) if claim]
    for number, (i, claim) in enumerate(given):
        axes.plot([i + 0.38] * 2, [claim.low, claim.high], color=HIGHLIGHT, linewidth=1.2)
        middle, name = (claim.low + claim.high) / 2, None if number else "thesis"
        axes.plot(i + 0.38, middle, "D", markerfacecolor="white", color=HIGHLIGHT, markersize=5,
                  label=name)  # fmt: skip
    names = [text.replace(" cameras", "") for text in part["label"].values]
    partial = part["in_view"].values < 1
    names = [f"{name}*" if cut else name for name, cut in zip(names, partial, strict=True)]
    turn = 30 if len(position) > 4 and len(names[0]) > 4 else 0
    axes.set_xticks(position, names, fontsize=8, rotation=turn)
    unit = "number of cameras" if part["label"].values[0].endswith("cameras") else None
    axes.set_xlabel(
        "; ".join(filter(None, [unit, "* markers leave the sensor" if partial.any() else None]))
    )
    axes.set(title="(d) mean (rms) error", ylabel="% of the largest deflection")
    axes.set_ylim(0, 1.3 * max(high.max(), literal.max(), *(c.high for _, c in given), 0.1))
    axes.grid(visible=False, axis="x")
    axes.legend(ncols=2, loc="upper center", columnspacing=1, handlelength=1.4)


def _setup_panel(axes: Axes, part: xr.Dataset, varied: str) -> None:
    """Cameras on their hemispheres, seen from a corner, with the varied parameter marked."""
    cameras = [_positions(part.isel(setting=index)) for index in range(part.sizes["setting"])]
    radius = max(np.linalg.norm(c, axis=1).max() for c in cameras)
    turn = np.linspace(0, 2 * np.pi, 181)
    circle = np.stack([np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    arcs = np.linspace(0, np.pi, 91)
    overhead = np.stack([np.cos(arcs), 0 * arcs, np.sin(arcs)], axis=1)
    across = overhead[:, [1, 0, 2]]
    for curve in (circle, overhead, across):
        _draw(axes, radius * curve, color="#d0d0d0", linewidth=0.7)
    x = part["x"].values
    half = (x.max() + x.min()) / 2
    width = 2 * part["y"].values.mean()
    corners = np.array([[-half, -width / 2, 0], [half, -width / 2, 0],
                        [half, width / 2, 0], [-half, width / 2, 0]])  # fmt: skip
    axes.fill(*_view(corners).T, color="#9a9a9a", zorder=3)
    seen: set[tuple[float, ...]] = set()
    for index, places in enumerate(cameras):
        for place in places:
            key = tuple(np.round(place, 6))
            if key in seen:
                continue
            seen.add(key)
            _draw(axes, np.array([place, 0 * place]), color=color(index), linewidth=0.6, alpha=0.6)
            axes.plot(*_view(place), "o", color=color(index), markersize=5, zorder=4)
    _mark_varied(axes, cameras, varied, part)
    for end, name in (([1.12 * half, 0, 0], "X"), ([0, 0.45 * radius, 0], "Y"),
                      ([0, 0, 0.45 * radius], "Z")):  # fmt: skip
        arrow = _view([[0, 0, 0], end])
        axes.plot(*arrow.T, color="#777777", linewidth=0.7, zorder=4)
        _write(axes, np.array(end) * 1.08, name, color="#777777", fontsize=8)
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.axis("off")


def _mark_varied(axes: Axes, cameras: list[Array], varied: str, part: xr.Dataset) -> None:
    style = {"color": HIGHLIGHT, "linewidth": 1.6, "zorder": 5}
    labels = [str(text) for text in part["label"].values]
    if varied == "distance_mm":
        far = max((c[0] for c in cameras), key=lambda c: float(np.linalg.norm(c)))
        _draw(axes, np.array([0 * far, far]), **style)
        _write(axes, 0.55 * far + [0, 0, 0.06 * np.linalg.norm(far)], "d", color=HIGHLIGHT)
    elif varied == "aperture_deg":
        first, second = max(cameras, key=lambda c: float(np.linalg.norm(c[0] - c[1])))[:2]
        radius = float(np.linalg.norm(first))
        middle = first + second + [0, 0, 1e-9]
        angle = np.arccos(np.clip(first @ second / radius**2, -1, 1)) / 2
        middle /= np.linalg.norm(middle)
        aside = first / radius - np.cos(angle) * middle
        aside /= np.linalg.norm(aside)
        turn = np.linspace(-angle, angle, 41)[:, None]
        arc = 0.45 * radius * (np.cos(turn) * middle + np.sin(turn) * aside)
        _draw(axes, arc, **style)
        _write(axes, 1.12 * arc[20], "α", color=HIGHLIGHT)
    else:
        text = f"{labels[0]} … {labels[-1]}" if len(labels) > 1 else labels[0]
        axes.text(0.0, 0.0, text, color=HIGHLIGHT, transform=axes.transAxes, fontsize=8)


def _positions(setting: xr.Dataset) -> Array:
    """Camera centres of one setting in m, shape (cameras, 3)."""
    azimuth, elevation = (np.radians(setting[f"camera_{a}"]) for a in ("azimuth", "elevation"))
    places = hemisphere_directions(azimuth, elevation) * setting["camera_distance"].values[:, None]
    kept: Array = places[np.isfinite(places[:, 0])]
    return kept


def _view(points: ArrayLike) -> Array:
    """Orthographic view from azimuth 155°, elevation 28°: horizontal and vertical coordinate."""
    theta, phi = np.radians([155.0, 28.0])
    right, down, _ = hemisphere_rotations(theta, phi)
    return np.asarray(points, float) @ np.stack([right, -down]).T


def _draw(axes: Axes, points: Array, **style: Any) -> None:
    axes.plot(*_view(points).T, **style)


def _write(axes: Axes, place: Array, text: str, **style: Any) -> None:
    u, v = _view(place)
    axes.text(u, v, text, ha="center", va="center", **style)


def viewer_data(cube: xr.Dataset) -> dict[str, Any]:
    """What the interactive viewer draws: the cube's literal run and its statistics, as JSON."""
    study = STUDIES[cube.attrs["figure_set"]]
    length, width = setups.beam().extent
    cases = list(dict.fromkeys(cube["case"].values.tolist()))
    modes = cube["mode"].values.tolist()
    unit = {"distance_mm": "mm", "aperture_deg": "°", "width_px": "px"}.get(study.varied, "")
    structure, _, figure_set = study.name.partition("-")
    return {
        "structure": {
            "kind": "beam", "length_mm": round(1000 * length, 3), "width_mm": round(1000 * width, 3)
        },
        "parameter": {"name": study.varied, "label": study.varied_label, "unit": unit},
        "x_mm": np.round(cube["x"].values * 1000, 3).tolist(),
        "modes": [
            {
                "mode": mode,
                "frequency_hz": round(float(cube["frequency"].sel(mode=mode)), 3),
                "reference_mm": _rounded(cube["reference_deflection"].sel(mode=mode) * 1000),
            }
            for mode in modes
        ],
        "colors": list(COLORS),
        "cases": [
            {
                "name": case,
                "title": setups.case_title(structure, figure_set, case) or "own layout",
                "figures": {
                    str(mode): setups.figure_number(structure, figure_set, case, mode)
                    for mode in modes
                },
                "settings": _viewer_settings(cube, case, modes),
            }
            for case in cases
        ],
    }  # fmt: skip


def _viewer_settings(cube: xr.Dataset, case: str, modes: list[int]) -> list[dict[str, Any]]:
    parts = {mode: select(cube, case, mode) for mode in modes}
    bands = {mode: band(part) for mode, part in parts.items()}
    first = parts[modes[0]]
    claims = {mode: stated(case, mode, first["value"].values) for mode in modes}
    settings = []
    for index in range(first.sizes["setting"]):
        one = first.isel(setting=index)
        count = int(one["n_cameras"])
        table = np.stack([one[f"camera_{a}"] for a in ("distance", "azimuth", "elevation")], 1)
        results = []
        for mode in modes:
            result = parts[mode].isel(setting=index)
            claim = claims[mode][index]
            low, median, high = bands[mode][:, index]
            results.append(
                {
                    "measured_mm": _rounded(result["measured_deflection"].isel(trial=0) * 1000),
                    "point_error": _rounded(result["point_error"]),
                    "mean": _rounded(result["mean_error"].isel(trial=0)),
                    "median": _rounded(median),
                    "low": _rounded(low),
                    "high": _rounded(high),
                    "predicted": _rounded(result["predicted_error"]),
                    "stated": [claim.low, claim.high] if claim else None,
                }
            )
        settings.append(
            {
                "label": str(one["label"].values),
                "value": float(one["value"]),
                "cameras": np.round(table[:count] * [1000, 1, 1], 6).tolist(),
                "resolution": [int(one["width_px"]), int(one["height_px"])],
                "in_view": float(one["in_view"]),
                "modes": results,
            }
        )
    return settings


def _rounded(values: Any) -> Any:
    """Numbers with four decimals for JSON; what is not finite becomes null."""
    array = np.round(np.asarray(values, float), 4)
    if array.ndim == 0:
        return float(array) if np.isfinite(array) else None
    return [float(v) if np.isfinite(v) else None for v in array]
