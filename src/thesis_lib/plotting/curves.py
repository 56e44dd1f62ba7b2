"""Figures of a beam: deflection shapes and errors along it."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.plotting.panels import bar_panel, setup_panel
from thesis_lib.plotting.selection import best_and_worst, error_bars, ranking, select
from thesis_lib.plotting.style import REFERENCE, color, placed


def beam_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Setup, shapes, marker errors and bars."""
    part = select(cube, case, mode)
    chosen = best_and_worst(part)
    labels = list(part["label"].values)
    drawing, axes = placed("ab;cd", (7.6, 5.4), (0.6, 0.15, 0.5, 0.3), (0.65, 0.75))
    setup_panel(axes["a"], cube, part)
    x = part["x"].values * 1000
    reference = part["reference_deflection"].values * 1000
    axes["b"].plot(x, reference, color=REFERENCE, linewidth=3, label="reference")
    for index, word in zip(chosen, ranking(part), strict=False):
        measured = part["measured_deflection"].isel(setting=index, trial=0).values * 1000
        name = f"{labels[index]}, {word}"
        axes["b"].plot(x, measured, ".-", color=color(index), linewidth=1, label=name)
        error = part["point_error"].values[index]
        axes["c"].plot(x, error, ".-", color=color(index), linewidth=1, label=labels[index])
    axes["b"].set(title="(b) deflection shape", xlabel="x in mm", ylabel="w in mm")
    axes["c"].set(
        title="(c) error of each marker",
        xlabel="x in mm",
        ylabel="% of the largest deflection",
        ylim=(0, None),
    )
    low, high = axes["b"].get_ylim()
    axes["b"].set_ylim(low, high + 0.45 * (high - low))  # room for the legend
    axes["b"].legend(loc="upper left")
    axes["c"].legend()
    bar_panel(axes["d"], part, [error_bars(cube, case, mode)])
    axes["d"].set(title="(d) mean (rms) error", ylabel="% of the largest deflection")
    return drawing
