"""Figures of ``lab-modes``, and further values for its tables."""

import json
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.plotting import panels as figures, selection, style
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.vibration.motion import detuning_loss

STYLE = style.MATH_STYLE  # of figures
MIN_DISAGREEMENT = 3.0  # misfit relative to noise, above which cameras disagree


def modes_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the setup, bending along the axis, the quadrature motion of the edge rows, and bars."""
    part = selection.select_settings(cube, case, mode)
    drawing, axes = style.subplots(2, 2, figsize=(7.6, 5.6))
    figures.setup_panel(axes[0, 0], cube, part)
    x, y = part["x"].values * 1000, part["y"].values
    rows = [np.flatnonzero(y == value) for value in np.unique(y)]
    axis, bending = rows[len(rows) // 2], axes[0, 1]
    true = 1000 * part["reference_deflection"].values[axis]
    bending.plot(x[axis], true, color=style.REFERENCE_COLOR, linewidth=3, label="true")
    ranked = selection.rank_settings(part)[: part.sizes["setting"]]
    for one, word, ink in ranked:
        measured = 1000 * one["measured_deflection"][0, axis]
        label = f"{one['label'].item()}, {word}"
        bending.plot(x[axis], measured, ".-", color=ink, linewidth=1, label=label)
    bending.set(title="(b) at the maximum of bending", xlabel="x in mm", ylabel="w in mm")
    bending.legend()
    torsion, grey = axes[1, 0], "#777777"
    true = part["reference_quadrature"].values * 1e6
    torsion.set(title="(c) a quarter of a period before", xlabel="x in mm", ylabel="w in µm")
    for row, mark, name in ((rows[0], "v", "first row"), (rows[-1], "^", "last row")):
        torsion.plot(x[row], true[row], color=style.REFERENCE_COLOR, linewidth=2)
        for one, _, ink in ranked:
            measured = one["quadrature_deflection"][row] * 1e6
            torsion.plot(x[row], measured, mark, color=ink, markersize=3.5)
        torsion.plot([], [], mark, color=grey, markersize=4, label=name)
    torsion.plot([], [], color=style.REFERENCE_COLOR, linewidth=2, label="true")
    if all(one["quadrature_deflection"].isnull().all() for one, *_ in ranked):
        place: Any = {"ha": "center", "va": "center", "transform": torsion.transAxes}
        torsion.text(0.5, 0.5, "one instant shows\none instant alone", color=grey, **place)
    style.add_legend(torsion, room=0.2, ncols=3, columnspacing=1, handlelength=1.2)
    figures.bar_panel(axes[1, 1], part, [selection.error_bars(cube, case, mode)])
    axes[1, 1].set(title="(d) mean (rms) error", ylabel="% of the largest deflection")
    return drawing


def aliases(cube: xr.Dataset, mode: int) -> Figure | None:
    """Draw the aliases of a mode, the misfit of the cameras at each, and the error by detuning."""
    if mode not in cube["mode"]:
        return None
    part = cube.sel(mode=mode)
    n = part.sizes["frame_rate"]
    drawing = Figure(figsize=(7.6, 1.2 + 1.15 * max(n, 3)), layout="constrained")
    left, right = drawing.subfigures(1, 2, squeeze=False)[0]
    panels = np.atleast_1d(left.subplots(n, 1))
    for r, (axes, one) in enumerate(zip(panels, iterate_slices(part, "frame_rate"), strict=True)):
        rate, true = float(one["frame_rate"]), float(one["frequency"])
        shown, ink = float(one["alias_frequency"]), style.cycle_color(r)
        axes.plot(one["spectrum_frequency"], one["spectrum"], color=ink, linewidth=1.2)
        aliased = abs(true - shown) > 1e-6
        ink = style.HIGHLIGHT_COLOR if aliased else style.BLACK_COLOR
        axes.axvline(shown, color=ink, linewidth=0.8, linestyle="--")
        text = f"{shown:.1f} Hz" + (f", an alias of {true:.1f} Hz" if aliased else "")
        side, offset = ("right", -3) if shown > 0.6 * rate / 2 else ("left", 3)
        place: Any = {"textcoords": "offset points", "va": "bottom", "ha": side}
        axes.annotate(text, (shown, 1.0), (offset, 1), fontsize=7, color=ink, **place)
        axes.set(xlim=(0, rate / 2), ylim=(0, 1.25), yticks=[0, 1], ylabel=f"{rate:g} fps")
    left.axes[0].set_title("(a) share explained by a harmonic")
    left.axes[-1].set_xlabel("frequency in Hz, up to half of the frame rate")
    misfits, costs = right.subplots(2, 1)
    _mark_rates(misfits, part, "candidate_frequency", "misfit")
    line: Any = {"color": style.BLACK_COLOR, "linewidth": 0.8}
    misfits.axvline(float(part["frequency"]), linestyle="--", **line)
    misfits.axhline(1, **line)
    misfits.set(xlabel="frequency in Hz", ylabel="over that by noise", yscale="log")
    misfits.set_title("(b) disagreement of the cameras at each alias")
    misfits.set_ylim(0.5, 20 * max(float(np.nanmax(part["misfit"].values)), MIN_DISAGREEMENT))
    misfits.legend(ncols=2, columnspacing=1, handlelength=1, loc="upper right")
    _mark_rates(costs, part, "cycles", "detuned_error")
    line |= {"linewidth": 1, "label": "loss of amplitude"}
    costs.plot(part["cycles"], part["detuned_prediction"], **line)
    costs.set(title="(c) if the known frequency is wrong", ylim=(0, None), ylabel="mean error in %")
    costs.set_xlabel("error in periods per recording")
    costs.legend(ncols=2, columnspacing=1, handlelength=1.2)
    return drawing


def _mark_rates(axes: Axes, part: xr.Dataset, x: str, y: str) -> None:
    """Mark one variable over another, each frame rate in its colour."""
    for r, one in enumerate(iterate_slices(part, "frame_rate")):
        label = f"{one['frame_rate'].item():g} fps"
        axes.plot(one[x], one[y], "o", markersize=4, color=style.cycle_color(r), label=label)


# Further values for tables.


def _frequency(cube: xr.Dataset) -> dict[str, Any]:
    """Return the disagreement of the cameras at the best two aliases of each mode and rate."""
    modes = iterate_slices(cube, "mode")
    every = (one for mode in modes for one in iterate_slices(mode, "frame_rate"))
    return {"rates": [(one, [*np.sort(one["misfit"].values), np.nan][:2]) for one in every]}


def _conditions(cube: xr.Dataset) -> dict[str, Any]:
    """Return for each mode the error of the known frequency that gives a mean error of 1 %."""
    frames = json.loads(cube.attrs["parameters"])["frames"]
    slowest, cycles, modes = float(cube["frame_rate"].min()), np.linspace(0, 1, 2001), []
    for one in iterate_slices(cube, "mode"):
        shape = one["reference_deflection"].values
        rms = 100 * np.sqrt(np.mean(shape**2)) / np.abs(shape).max()
        allowed = np.interp(1, rms * detuning_loss(cycles, frames), cycles)
        modes.append((one, allowed * slowest / frames))
    return {"modes": modes, "frames": frames, "slowest": slowest}


def _results(cube: xr.Dataset) -> dict[str, Any]:
    """Return median errors of the four ways, by mode and frame rate."""
    rates: list[tuple[xr.Dataset, tuple[Any, ...]]] = []
    for of in iterate_slices(cube, "mode"):
        cases = selection.split_cases(cube, int(of["mode"]))
        further = [part["mean_error"].isel(trial=slice(1, None)) for part in cases.values()]
        own = zip(*(errors.median("trial").values for errors in further), strict=True)
        rates += zip(iterate_slices(of, "frame_rate"), own, strict=True)
    known = selection.select_settings(cube, "known", int(cube["mode"].values[-1]))
    return {"cases": list(cases), "rates": rates, "ends": [known.isel(setting=i) for i in (0, -1)]}


TEXTS = {"frequency": _frequency, "conditions": _conditions, "results": _results}
