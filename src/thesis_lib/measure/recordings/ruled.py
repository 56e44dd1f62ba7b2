"""The first frame of a video between rulers, in which places are read in pixels."""

from __future__ import annotations

from matplotlib.figure import Figure

from thesis_lib.arrays import Image
from thesis_lib.plotting.style import COLORS, HIGHLIGHT, in_style

LEAST = 1200  # px of the picture that is drawn, at least
DPI = 100
STEPS = (5, 10, 25, 50)  # px between fine lines
LINES = 40  # fine lines across, at most
ROOM = 0.5  # inches for the numbers


def ruled(image: Image) -> Figure:
    """A picture with lines every so many pixels, counted from its upper left corner.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Grey values.
    """
    height, width = image.shape
    step = next((one for one in STEPS if width <= LINES * one), width // LINES)
    scale = max(1.0, LEAST / width) / DPI
    wide, high = width * scale + 2 * ROOM, height * scale + 2 * ROOM
    with in_style():
        figure = Figure(figsize=(wide, high), dpi=DPI)
        axes = figure.add_axes(
            (ROOM / wide, ROOM / high, width * scale / wide, height * scale / high)
        )
        axes.imshow(image, cmap="gray", vmin=0, vmax=255, extent=(0, width, height, 0))
        axes.set_xticks(range(0, width + 1, 2 * step))
        axes.set_yticks(range(0, height + 1, 2 * step))
        axes.set_xticks(range(0, width + 1, step), minor=True)
        axes.set_yticks(range(0, height + 1, step), minor=True)
        axes.grid(visible=True, which="minor", color=COLORS[0], linewidth=0.4, alpha=0.5)
        axes.grid(visible=True, which="major", color=HIGHLIGHT, linewidth=0.5, alpha=0.7)
        axes.tick_params(labelsize=8, labeltop=True, labelright=True)
    return figure
