"""Pages of a PDF in true scale, drawn in mm, with a ruler that tells how they were printed."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from thesis_lib.files import whole_file
from thesis_lib.outputs import check_file

SIZES = {  # mm, upright
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
    "tabloid": (279.4, 431.8),
}
BORDER = 6.0  # mm along a page's edge that printers leave blank
STRIP = 16.0  # mm at the foot of a page for ruler and words
RULER = 100.0  # mm
MM = 25.4  # of an inch

Draw = Callable[[Axes], object]


class PaperError(ValueError):
    """A sheet that cannot be; the message is one line: the option, what was given, what allowed."""


def area(paper: str, landscape: bool) -> tuple[float, float]:
    """Width and height in mm that can be drawn on, above the strip with the ruler."""
    width, height = sorted(SIZES[paper], reverse=landscape)
    return width - 2 * BORDER, height - 2 * BORDER - STRIP


def write(path: Path, paper: str, landscape: bool, pages: Iterable[tuple[Draw, str]]) -> None:
    """Write pages of a size as a PDF, whole or not at all.

    Parameters
    ----------
    path : Path
        The file.
    paper : str
        One of ``SIZES``.
    landscape : bool
        Whether pages lie.
    pages : iterable of (callable, str)
        What draws on axes in mm, whose origin is the lower left corner of the :func:`area`, and
        words that stand beside the ruler.

    Raises
    ------
    OutputError
        If the file is there already, or does not end in .pdf.
    """
    check_file(path, ".pdf")
    width, height = sorted(SIZES[paper], reverse=landscape)
    made = io.BytesIO()
    with PdfPages(made, metadata={"CreationDate": None, "Creator": "thesis_lib"}) as file:
        for draw, words in pages:
            figure = Figure(figsize=(width / MM, height / MM))
            axes = figure.add_axes((0, 0, 1, 1))
            axes.set(
                xlim=(-BORDER, width - BORDER), ylim=(-BORDER - STRIP, height - BORDER - STRIP)
            )
            axes.set_axis_off()
            draw(axes)
            _ruler(axes, words, width - 2 * BORDER)
            file.savefig(figure)
    whole_file(path, lambda part: part.write_bytes(made.getvalue()))


def polygons(axes: Axes, vertices: ArrayLike, colour: str = "black") -> None:
    """Filled polygons without outline, (polygons, vertices, 2), mm."""
    axes.add_collection(
        PolyCollection([*np.asarray(vertices, float)], facecolors=colour, edgecolors="none"),
        autolim=False,
    )


def discs(axes: Axes, centres: ArrayLike, diameter: float, colour: str = "black") -> None:
    """Filled discs about centres (2, n), mm."""
    around = np.linspace(0, 2 * np.pi, 97)[:-1]
    ring = diameter / 2 * np.column_stack([np.cos(around), np.sin(around)])
    polygons(axes, np.asarray(centres, float).T[:, None] + ring, colour)


def rectangle(x: float, y: float, width: float, height: float) -> list[tuple[float, float]]:
    """Vertices of a rectangle with its lower left corner at x, y."""
    return [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]


def _ruler(axes: Axes, words: str, width: float) -> None:
    y = -STRIP + 4
    polygons(axes, [rectangle(0, y, RULER, 0.25)])
    for k in range(11):
        tall = 4.0 if k in (0, 10) else 2.5
        polygons(axes, [rectangle(RULER / 10 * k - 0.125, y, 0.25, tall)])
    axes.text(
        0,
        y - 3.2,
        "Print at 100 %, without scaling. This line is 100 mm long: measure it.",
        size=6.5,
    )
    axes.text(RULER + 6, y, words, size=6.5, va="bottom", wrap=False)
    if width < RULER + 6:
        raise PaperError(f"--paper: narrower than the ruler of {RULER:g} mm")
