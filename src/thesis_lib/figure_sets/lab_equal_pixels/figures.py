"""Figures of ``lab-equal-pixels``: errors over the number of cameras, rendered and by the laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.plotting.panels import setup_panel
from thesis_lib.plotting.selection import select
from thesis_lib.plotting.style import COLORS, INK, REFERENCE, color, logarithmic, subplots

TICKS = tuple(float(f"{digit}e{power}") for power in range(-3, 4) for digit in (1, 2, 5))
LAWS = {
    "predicted_error": ("law of edges", "--"),
    "equal_noise_error": ("centres equally exact", ":"),
}


def claim(cube: xr.Dataset) -> Figure:
    """The central claim: error over that of the sharp pair, and errors of whole pixels beside."""
    drawing, (left, right) = subplots(1, 2, figsize=(7.6, 3.9), layout="constrained")
    mode = int(cube["mode"].values[0])
    cases = list(dict.fromkeys(cube["case"].values.tolist()))
    for i, case in enumerate(cases):
        part = select(cube, case, mode)
        count, shift = part["n_cameras"].values, 1.012 ** (i - (len(cases) - 1) / 2)
        ratio, band = part["ratio"].values, part["ratio_band"].values
        kind: dict[str, Any] = {"color": color(i), "linewidth": 1}
        left.plot(count * shift, ratio, "o", label=case, markersize=4, **kind)
        left.vlines(count * shift, *band.T, **kind)
        left.plot(count, part["predicted_ratio"], "--", **kind)
    first = select(cube, cases[0], mode)
    count = first["n_cameras"].values
    left.axhline(1, color=INK, linewidth=0.8)
    left.set(
        title="(a) rendered: error over that of the sharp pair", ylabel="ratio", xlabel="cameras"
    )
    right.plot(count, first["rounded_error"], "s-", color=REFERENCE, label="least squares")
    right.plot(count, first["interval_error"], "D-", color=COLORS[1], label="interval")
    right.plot(
        count, first["rms_error"], "o-", color=COLORS[0], label=f"fitted centres, {cases[0]}"
    )
    right.set(
        title="(b) the same rigs with whole pixels",
        ylabel="error in % of the largest deflection",
        xlabel="cameras",
    )
    for axes, names in ((left, 2), (right, 1)):
        _scales(axes, count)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high * (high / low) ** 0.3)  # room for the key
        axes.legend(loc="upper left" if axes is left else "upper right", ncols=names)
    return drawing


def case_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """The rigs of a case, their errors over the number of cameras, and what these are made of."""
    part = select(cube, case, mode)
    count = part["n_cameras"].values
    drawing, axes = subplots(
        1, 3, figsize=(9.2, 3.6), layout="constrained", width_ratios=[0.8, 1, 1]
    )
    setup_panel(axes[0], cube, part)
    axes[0].set_title("(a) cameras")
    each = part["mean_error"].transpose("setting", "trial").values
    for n, errors in zip(count, each, strict=True):
        spread = n * 1.008 ** (np.arange(len(errors)) - (len(errors) - 1) / 2)
        axes[1].plot(spread, errors, ".", color="#b8c8d4", markersize=3)
    axes[1].vlines(count, *part["rms_band"].values.T, color=COLORS[0], linewidth=2)
    axes[1].plot(count, part["rms_error"], "o", color=COLORS[0], label="all recordings, 5–95 %")
    for name, (label, style) in LAWS.items():
        axes[1].plot(count, part[name], style, color=INK, linewidth=1, label=label)
    axes[1].set(title="(b) error of the recordings", ylabel="% of the largest deflection")
    for i, (name, label) in enumerate(
        (
            ("noise_error", "scatter of the centres"),
            ("pose_error", "calibrated poses"),
            ("common_error", "common to all recordings"),
        )
    ):
        values = np.maximum(part[name].values, 1e-3)
        axes[2].plot(count, values, "o-", color=color(i + 2), linewidth=1, label=label)
    axes[2].set(title="(c) parts of the error", ylabel="% of the largest deflection")
    for panel in axes[1:]:
        panel.set_xlabel("cameras")
        _scales(panel, count)
        low, high = panel.get_ylim()
        panel.set_ylim(low, high * (high / low) ** 0.4)
        panel.legend(loc="upper left", fontsize=7)
    return drawing


def _scales(axes: Axes, count: Any) -> None:
    """Logarithmic axes, numbers of cameras along x."""
    low, high = axes.get_ylim() if axes.get_yscale() == "log" else axes.dataLim.intervaly
    logarithmic(axes.xaxis, [float(n) for n in count])
    logarithmic(axes.yaxis, TICKS)
    axes.set_xlim(min(count) / 1.25, max(count) * 1.25)
    axes.set_ylim(low / 1.2, high * 1.2)
