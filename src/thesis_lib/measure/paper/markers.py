"""Round markers on paper: at their places, over as many pages as that takes, or to be cut out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from thesis_lib.arrays import Array
from thesis_lib.measure.paper.page import Draw, PaperError, area, discs, polygons, rectangle, write


def write_markers(
    path: Path,
    columns: int = 10,
    rows: int = 6,
    spacing_mm: float = 25.0,
    row_spacing_mm: float | None = None,
    diameter_mm: float = 8.0,
    paper: str = "A4",
    bright: bool = False,
) -> int:
    """Write a grid of markers as a PDF to true scale.

    Where the grid is larger than a page it goes on, on the next. Corner marks stand half a spacing
    beyond the outermost markers: cut there, and the pages join edge to edge.

    Parameters
    ----------
    path : Path
        The file.
    columns, rows : int
        Markers along and across.
    spacing_mm, row_spacing_mm : float
        Distance of their centres; across the same as along if not given.
    diameter_mm : float
        Diameter of a marker.
    paper : str
        Size of the page.
    bright : bool
        Whether markers are white on black.

    Returns
    -------
    int
        Pages written.

    Raises
    ------
    PaperError
        If markers overlap, or are further apart than a page is long.
    """
    across = row_spacing_mm or spacing_mm
    least = min(spacing_mm if columns > 1 else np.inf, across if rows > 1 else np.inf)
    if diameter_mm >= least:
        raise PaperError(
            f"--diameter-mm: given {diameter_mm:g}, allowed: below {least:g}, the spacing"
        )
    wide, high = area(paper, landscape=True)
    per = int(wide // spacing_mm), int(high // across)
    if not all(per):
        raise PaperError(
            f"--spacing-mm: given {spacing_mm:g} and {across:g}, allowed: at most {wide:g} and "
            f"{high:g} on {paper}"
        )
    pages = []
    for low in range(0, rows, per[1]):
        for left in range(0, columns, per[0]):
            nx, ny = min(per[0], columns - left), min(per[1], rows - low)
            centres = np.stack(
                np.meshgrid((np.arange(nx) + 0.5) * spacing_mm, (np.arange(ny) + 0.5) * across)
            ).reshape(2, -1)
            words = (
                f"columns {left + 1} to {left + nx}, rows {low + 1} to {low + ny}: diameter "
                f"{diameter_mm:g} mm, {spacing_mm:g} mm × {across:g} mm apart"
            )
            size = nx * spacing_mm, ny * across
            pages.append((_sheet(centres, size, diameter_mm, bright), words))
    write(path, paper, True, pages)
    return len(pages)


def _sheet(centres: Array, size: tuple[float, float], diameter: float, bright: bool) -> Draw:
    def draw(axes: Axes) -> None:
        width, height = size
        if bright:
            polygons(axes, [rectangle(0, 0, width, height)])
        discs(axes, centres, diameter, "white" if bright else "black")
        for x in (0.0, width):  # corner marks, outside of what is used
            for y in (0.0, height):
                side, up = (-1 if x == 0 else 1), (-1 if y == 0 else 1)
                axes.plot([x, x + 4 * side], [y, y], "k-", linewidth=0.3, clip_on=False)
                axes.plot([x, x], [y, y + 4 * up], "k-", linewidth=0.3, clip_on=False)

    return draw
