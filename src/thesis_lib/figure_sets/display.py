"""The figure of any cube, and its SVG."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.plotting.style import in_style, svg


def figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """The figure of one case and mode, as its figure set draws it.

    Parameters
    ----------
    cube : xarray.Dataset
        Cube of a figure set.
    case : str
        Case or layout that the cube holds.
    mode : int
        Mode that the cube holds.
    """
    with in_style():
        return FIGURE_SETS[cube.attrs["figure_set"]].draw(cube, case, mode)


def as_svg(cube: xr.Dataset, case: str, mode: int) -> str:
    """The figure of one case and mode as SVG; the same cube gives the same text."""
    return svg(figure(cube, case, mode))
