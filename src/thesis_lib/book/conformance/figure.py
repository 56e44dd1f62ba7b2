"""All checks of the conformance report in one figure: how much of its tolerance each one uses."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from thesis_lib.book.conformance.areas import AREAS, KINDS, area
from thesis_lib.plotting.style import COLORS, INK, POWERS, in_style, subplots

LEAST = 1e-9  # what uses less is drawn here
_COLORS = {**dict(zip(AREAS, (*COLORS, INK), strict=True)), "Other": INK}


def _place(check: dict[str, Any]) -> float:
    """Where on the axis a check stands."""
    return min(max(check["share"] or 0, LEAST), 1.0)


def draw(report: dict[str, Any]) -> Figure:
    """One dot for each check, one row for each kind, on a logarithmic axis."""
    checks = report["checks"]
    x = np.array([_place(check) for check in checks])
    y = np.array([list(KINDS).index(check["kind"]) for check in checks], float)
    y += np.random.default_rng(0).uniform(-0.36, 0.36, len(y))
    areas = np.array([area(check["test"]) for check in checks], str)
    with in_style(POWERS):
        drawing, axes = subplots(figsize=(8, 3.6), layout="constrained")
        for name, colour in _COLORS.items():
            mine = areas == name
            axes.plot(x[mine], y[mine], ".", color=colour, markersize=4, alpha=0.75)
        axes.axvline(1, color=INK, linewidth=1)
        axes.set(xscale="log", xlim=(LEAST / 2, 3), xlabel="share of the tolerance that is used")
        axes.set_yticks(range(len(KINDS)), list(KINDS))
        axes.invert_yaxis()
        axes.grid(axis="y", visible=False)
        handles = [
            Line2D([], [], color=_COLORS[name], linestyle="", marker=".", label=name)
            for name in AREAS
        ]
        drawing.legend(handles=handles, loc="outside lower center", ncols=4, handletextpad=0.1)
    return drawing
