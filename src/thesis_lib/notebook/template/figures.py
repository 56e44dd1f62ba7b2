"""Figures of the figure set footprint."""

import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.plotting.style import subplots


def line(cube: xr.Dataset) -> Figure:
    """Plot the length of a pixel against the distance."""
    figure, axes = subplots(figsize=(5, 3), layout="constrained")
    axes.plot(cube["distance"], cube["value"], "o-")
    axes.set(xlabel="distance in mm", ylabel="length of a pixel in mm")
    return figure
