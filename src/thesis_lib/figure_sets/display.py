"""The figure of any cube, and its SVG."""

from __future__ import annotations

from collections.abc import Callable

import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.figure_sets.parametric.curves import beam_figure
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.plotting.style import in_style, svg


def figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """The figure of one case and mode, in the framework of its structure.

    Parameters
    ----------
    cube : xarray.Dataset
        Cube of a figure set.
    case : str
        Case or layout that the cube holds.
    mode : int
        Mode that the cube holds.
    """
    from thesis_lib.figure_sets.parametric.maps import plate_figure, sound_figure

    name = cube.attrs["figure_set"]
    subject = STUDIES[name].subject
    draw: Callable[[xr.Dataset, str, int], Figure]
    draw = {"plate": plate_figure, "shape": plate_figure,
            "sound": sound_figure}.get(subject, beam_figure)  # fmt: skip
    if name in ("lab-modes", "lab-plate"):
        from thesis_lib.figure_sets.lab_modes import figures as lab_figures

        draw = lab_figures.FIGURES[name]
    if name in ("lab-elevation", "lab-layout"):
        from thesis_lib.figure_sets.lab_layout import figures as lab_layout_figures

        draw = lab_layout_figures.figure
    with in_style():
        return draw(cube, case, mode)


def as_svg(cube: xr.Dataset, case: str, mode: int) -> str:
    """The figure of one case and mode as SVG; the same cube gives the same text."""
    return svg(figure(cube, case, mode))
