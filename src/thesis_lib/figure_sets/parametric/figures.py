"""Figures of these sets that are shown by name, drawn from their cubes."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.figure_sets.parametric import sound_sum
from thesis_lib.plotting.style import color, subplots


def turn(cube: xr.Dataset) -> Figure:
    """Field errors against the turn: lines by the law, dots simulated."""
    heard = sound_sum.heard(cube)
    drawing, axes = subplots(
        1,
        len(heard),
        figsize=(2.1 * len(heard) + 1, 2.8),
        layout="constrained",
        squeeze=False,
        sharey=True,
    )
    for panel, (mode, plane) in zip(axes[0], heard, strict=True):
        one = cube.sel(mode=mode, plane=plane)
        for i, elevation in enumerate(cube["elevation"].values):
            part = one.sel(elevation=elevation)
            law = part["turned_law_error"]
            panel.plot(cube["law_turn"], law, color=color(i), linewidth=1, label=f"{elevation:g}°")
            panel.plot(cube["turn"], part["turned_simulated"], "o", color=color(i), markersize=4)
        panel.set(title=f"mode {mode}, {plane}", xlabel="turned by, °")
    axes[0, 0].set(ylabel="field error, %", ylim=(0, None))
    axes[0, -1].legend(title="elevation", fontsize=7)
    return drawing
