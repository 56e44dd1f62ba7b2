"""What stands under a figure, and what it shows, for those who cannot see it."""

from __future__ import annotations

from dataclasses import dataclass

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.plotting.numbers import figure_names


@dataclass(frozen=True)
class Caption:
    """Words of a figure, all of them plain text."""

    name: str = ""  #: What its page calls it, for links
    text: str = ""  #: What stands under it
    alt: str = ""  #: What it shows; empty if :func:`panels` tells it


def of_cases(cube: xr.Dataset) -> dict[tuple[str, int], Caption]:
    """Caption of the figure of each case and mode, from what the cube tells of them."""
    made = {}
    cases, modes = cube["case"].values.tolist(), cube["mode"].values.tolist()
    for (case, mode), file in figure_names(cube).items():
        at = cases.index(case)
        title = str(cube["case_title"].values[at])
        number = str(cube["thesis_figure"].values[at, modes.index(mode)])
        name = number.replace(".", "-") or f"{cube.attrs['figure_set']}-{file}"
        text = f"Figure {number} of the thesis. " if number else ""
        text += f"Case {case.replace(chr(39), '′') if title else case}, mode {mode}"
        made[case, mode] = Caption(f"fig-{name}", text + (f": {title}." if title else "."))
    return made


def panels(drawing: Figure) -> str:
    """The panels of a figure in words: title, what is drawn over what, and legend of each."""
    return f"Panels: {'; '.join(filter(None, map(_panel, drawing.axes)))}."


def _panel(axes: Axes) -> str:
    """One panel, or a scale of colours; empty if it has no words."""
    title = "".join(axes.get_title(place) for place in ("left", "center", "right"))
    title = title.replace("\n", " ")
    scale = "colours" if axes.get_label() == "<colorbar>" else ""
    drawn = " over ".join(filter(None, (axes.get_ylabel(), axes.get_xlabel())))
    words = ", ".join(filter(None, (title or scale, drawn)))
    legend = axes.get_legend()
    names = ", ".join(text.get_text() for text in legend.get_texts()) if legend else ""
    return ": ".join(filter(None, (words, names)))
