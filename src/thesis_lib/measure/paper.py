"""Printable PDF pages in true scale, with a ruler: board, markers, camera positions."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from thesis_lib.arrays import Array, ArrayLike
from thesis_lib.files import check_file, whole_file
from thesis_lib.measure.recordings.board import MARK_DICTIONARY, MARK_RATIO, Board
from thesis_lib.measure.recordings.manifest import CameraFiles
from thesis_lib.plotting.style import cycle_color, drawable_names
from thesis_lib.studies.fields import format_limit
from thesis_lib.text import RefusedError

ISO_SIDES_MM = (210.0, 297.0, 420.0, 594.0, 841.0, 1189.0)  # mm, of A4 to A0
PAGE_SIZES_MM = {f"A{4 - k}": sides for k, sides in enumerate(pairwise(ISO_SIDES_MM))}  # upright
PAGE_SIZES_MM |= {"letter": (215.9, 279.4), "tabloid": (279.4, 431.8)}
BORDER_MM = 6.0  # mm along a page's edge that printers leave blank
STRIP_MM = 16.0  # mm at the foot of a page for ruler and text
RULER_MM = 100.0  # mm
MM_PER_INCH = 25.4

Draw = Callable[[Axes], object]


def _drawable_mm(paper: str, landscape: bool) -> tuple[float, float]:
    """Return width and height in mm of the drawable area above the strip with the ruler."""
    width, height = sorted(PAGE_SIZES_MM[paper], reverse=landscape)
    return width - 2 * BORDER_MM, height - 2 * BORDER_MM - STRIP_MM


def _write_pages(path: Path, paper: str, lying: bool, pages: Iterable[tuple[Draw, str]]) -> None:
    """Write pages of one size as a PDF, never a partial file.

    Each page is a function that draws on axes in mm, with the origin at the lower left corner of
    the drawable area (:func:`_drawable_mm`), and a text next to the ruler.
    """
    check_file(path, ".pdf")
    width, height = sorted(PAGE_SIZES_MM[paper], reverse=lying)
    foot = 4 - STRIP_MM
    ruler = [_rectangle_vertices(0, foot, RULER_MM, 0.25)]
    for k in range(11):
        tick_mm = 2.5 if k % 10 else 4.0
        ruler.append(_rectangle_vertices(RULER_MM / 10 * k - 0.125, foot, 0.25, tick_mm))

    def write_part(part: Path) -> None:
        with PdfPages(part, metadata={"CreationDate": None, "Creator": "thesis_lib"}) as file:
            for draw, words in pages:
                figure = Figure(figsize=(width / MM_PER_INCH, height / MM_PER_INCH))
                axes = figure.add_axes((0, 0, 1, 1))
                axes.set_xlim(-BORDER_MM, width - BORDER_MM)
                axes.set_ylim(-BORDER_MM - STRIP_MM, height - BORDER_MM - STRIP_MM)
                axes.set_axis_off()
                draw(axes)
                _draw_polygons(axes, ruler)
                advice = "Print at 100 %, without scaling. This line is 100 mm long: measure it."
                axes.text(0, foot - 3.2, advice, size=6.5)
                axes.text(RULER_MM + 6, foot, words, size=6.5, va="bottom", wrap=False)
                file.savefig(figure)

    whole_file(path, write_part)


def _draw_polygons(axes: Axes, vertices: ArrayLike) -> None:
    """Draw black polygons without outline, (polygons, vertices, 2), mm."""
    polygons = [*np.asarray(vertices, float)]
    axes.add_collection(PolyCollection(polygons, fc="black", ec="none"), autolim=False)


def _rectangle_vertices(x: float, y: float, width: float, height: float) -> Array:
    """Return the vertices (4, 2) of a rectangle with its lower left corner at x, y."""
    return np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])


BITS_PER_MARK = 7  # cells along a mark, black border included
DICTIONARY_MARKS = 1000  # in the dictionary


def write_board(
    path: Path, columns: int, rows: int, tile_mm: float, paper: str, charuco: bool, two_sided: bool
) -> str:
    """Write a board as a PDF to true scale.

    The lower left tile is dark; with ArUco marks, the upper left one.

    Parameters
    ----------
    charuco : bool
        Whether white tiles carry ArUco marks, as in OpenCV's ``CharucoBoard``.
    two_sided : bool
        Whether a second page has the mirror image, for the back: tiles coincide when the sheet is
        turned like a page of a book. Not allowed with marks, which would be mirrored, too.

    Returns
    -------
    str
        The board's entry in the manifest; with marks, also OpenCV's call of ``CharucoBoard``.

    Raises
    ------
    RefusedError
        If the board with a white margin of half a tile does not fit the paper, or has marks on both
        sides or more marks than the dictionary.
    """
    if charuco and two_sided:
        raise RefusedError("--two-sided: given with --charuco, allowed: for a checkerboard")
    if charuco and columns * rows // 2 > DICTIONARY_MARKS:
        most = f"at most {2 * DICTIONARY_MARKS + 1} with --charuco"
        raise RefusedError(f"--columns, --rows: given {columns} × {rows} tiles, allowed: {most}")
    landscape = columns >= rows
    wide, high = _drawable_mm(paper, landscape)
    largest_mm = min(wide / (columns + 1), high / (rows + 1))  # with half a tile all around
    if tile_mm > largest_mm + 1e-9:
        most = f"at most {format_limit(largest_mm)} for {columns} × {rows} tiles on {paper}"
        raise RefusedError(f"--tile-mm: given {tile_mm:g}, allowed: {most}")
    margin = min(wide - columns * tile_mm, high - rows * tile_mm) / 2
    board = Board(columns, rows, tile_mm / 1000, margin / 1000)
    left, low = (wide - columns * tile_mm) / 2, (high - rows * tile_mm) / 2
    dark = 1000 * board.dark_tiles + [columns * tile_mm / 2, rows * tile_mm / 2]
    said = f"{'kind: charuco, ' * charuco}columns: {columns}, rows: {rows}, tile_mm: {tile_mm:g}"
    said += f", margin_mm: {np.floor(margin):g}, two_sided: {str(two_sided).lower()}"
    said = f"in the manifest: board: {{{said}}}"
    if charuco:
        dark = dark * [1, -1] + [0, rows * tile_mm]  # OpenCV begins with a dark tile at the top
        dark = np.concatenate([dark[:, ::-1], _marks(columns, rows, tile_mm)])
        sides_mm = f"{tile_mm:g}, {MARK_RATIO * tile_mm:g}"
        said += f"\nfor OpenCV: CharucoBoard(({columns}, {rows}), {sides_mm}, {MARK_DICTIONARY})"
    dark = dark + [left, low]
    pages = [(partial(_draw_polygons, vertices=dark), "front: " * two_sided + said)]
    if two_sided:
        back = (dark * [-1, 1] + [wide, 0])[:, ::-1]
        pages.append((partial(_draw_polygons, vertices=back), f"back: {said}"))
    _write_pages(path, paper, landscape, pages)
    return said


def _marks(columns: int, rows: int, tile: float) -> Array:
    """Return the dark cells of the marks, (cells, 4, 2), mm from the board's lower left corner.

    OpenCV counts the white tiles from the upper left, row by row; each mark is centred in its tile.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, MARK_DICTIONARY))
    side, cells = MARK_RATIO * tile, []
    step = side / BITS_PER_MARK
    white = np.argwhere(np.indices((rows, columns)).sum(axis=0) % 2)
    for number, (row, column) in enumerate(white):
        x = column * tile + (tile - side) / 2
        y = (rows - row) * tile - (tile - side) / 2
        for i, j in np.argwhere(dictionary.generateImageMarker(number, BITS_PER_MARK) == 0):
            cells.append(_rectangle_vertices(x + j * step, y - (i + 1) * step, step, step))
    return np.array(cells)


def write_markers(
    path: Path,
    columns: int,
    rows: int,
    spacing_mm: float,
    row_spacing_mm: float | None,
    diameter_mm: float,
    paper: str,
    bright: bool,
) -> int:
    """Write a grid of markers as a PDF to true scale.

    A grid larger than a page continues on the next. Corner marks are half a spacing beyond the
    outermost markers: pages that are cut there join edge to edge. The row spacing defaults to the
    column spacing; ``bright`` markers are white on black. Return the number of pages.

    Raises
    ------
    RefusedError
        If markers overlap or reach the corner marks, or are further apart than a page is long.
    """
    across = row_spacing_mm or spacing_mm
    least = min(spacing_mm, across)  # also of one row: corner marks are half of it beyond
    if diameter_mm >= least:
        allowed = f"below {least:g}, the least spacing"
        raise RefusedError(f"--diameter-mm: given {diameter_mm:g}, allowed: {allowed}")
    wide, high = _drawable_mm(paper, landscape=True)
    per = int(wide // spacing_mm), int(high // across)
    if not all(per):
        most = f"at most {wide:g} and {high:g} on {paper}"
        raise RefusedError(f"--spacing-mm: given {spacing_mm:g} and {across:g}, allowed: {most}")

    def draw(axes: Axes, nx: int, ny: int) -> None:
        width, height, colour = nx * spacing_mm, ny * across, "white" if bright else "black"
        if bright:
            _draw_polygons(axes, [_rectangle_vertices(0, 0, width, height)])
        for row, column in np.ndindex(ny, nx):
            centre = (column + 0.5) * spacing_mm, (row + 0.5) * across
            axes.add_patch(Circle(centre, diameter_mm / 2, fc=colour, ec="none"))
        for x, side in ((0.0, -4), (width, 4)):  # corner marks, outside the used area
            for y, up in ((0.0, -4), (height, 4)):
                axes.plot([x, x + side], [y, y], "k-", linewidth=0.3, clip_on=False)
                axes.plot([x, x], [y, y + up], "k-", linewidth=0.3, clip_on=False)

    pages = []
    for low in range(0, rows, per[1]):
        for left in range(0, columns, per[0]):
            nx, ny = min(per[0], columns - left), min(per[1], rows - low)
            words = f"columns {left + 1} to {left + nx}, rows {low + 1} to {low + ny}: diameter "
            words += f"{diameter_mm:g} mm, {spacing_mm:g} mm × {across:g} mm apart"
            pages.append((partial(draw, nx=nx, ny=ny), words))
    _write_pages(path, paper, True, pages)
    return len(pages)


PLACE_FIELDS = ("azimuth_deg", "elevation_deg", "distance_mm")
CENTRED_TEXT: dict[str, Any] = {"ha": "center", "va": "center"}


def write_stand(path: Path, cameras: Sequence[CameraFiles], paper: str) -> None:
    """Write a protractor with a ray to each camera, and the camera's distance and height.

    Raises
    ------
    RefusedError
        If a camera has no ``azimuth_deg``, ``elevation_deg`` or ``distance_mm``.
    """
    for camera, field in product(cameras, PLACE_FIELDS):
        if getattr(camera, field) is None:
            raise RefusedError(f"camera {camera.name}: {field} is not given, allowed: a number")
    places = [[getattr(camera, field) for field in PLACE_FIELDS] for camera in cameras]
    wide, high = _drawable_mm(paper, landscape=False)
    radius = min(wide, high) / 2 - 12

    def draw(axes: Axes) -> None:
        centre = np.array([wide / 2, high - radius - 10])

        def polar_point(azimuth: float, length: float) -> tuple[float, float]:
            angle = np.radians(azimuth)  # from +Y, upward on the sheet, towards +X
            x, y = centre + length * np.array([np.sin(angle), np.cos(angle)])
            return x, y

        for azimuth in range(-180, 180, 5):
            inner = radius - (6 if azimuth % 10 == 0 else 3)
            ends = polar_point(azimuth, inner), polar_point(azimuth, radius)
            axes.plot(*np.transpose(ends), "k-", lw=0.4)
            if azimuth % 30 == 0:
                place = polar_point(azimuth, radius + 5)
                axes.text(*place, f"{azimuth}°", size=7, **CENTRED_TEXT)
        arrow = {"arrowstyle": "->", "lw": 0.8}
        for name, azimuth in (("X", 90), ("Y", 0)):
            axes.annotate("", polar_point(azimuth, 26), polar_point(0, 0), arrowprops=arrow)
            axes.text(*polar_point(azimuth, 30), name, size=9, **CENTRED_TEXT)
        lines = [
            "Lay the sheet under the structure's centre, X along its length.",
            "Each camera stands on its ray, so far and so high with the middle of its lens:",
        ]
        names = drawable_names([camera.name for camera in cameras], "camera")
        for k, (name, (turn, elevation, distance)) in enumerate(zip(names, places, strict=True)):
            colour, tilt = cycle_color(k), np.radians(elevation)
            axes.plot(*np.transpose([centre, polar_point(turn, radius)]), color=colour, lw=1.2)
            axes.text(*polar_point(turn, 0.8 * radius), name, size=10, color=colour)
            along, up = f"{distance * np.cos(tilt):.0f} mm", f"{distance * np.sin(tilt):.0f} mm"
            at = f"azimuth {turn:g}°, elevation {elevation:g}°; {along} along its ray"
            lines.append(f"{name}: {at}, {up} above the structure; {distance:g} mm from its centre")
        top = high - 2 * radius - 24
        step = min(6.0, top / (len(lines) - 1))  # mm, so that the last line is above the strip
        for k, line in enumerate(lines):
            axes.text(4, top - step * k, line, size=min(8.0, 2 * step))

    _write_pages(path, paper, False, [(draw, "")])
