"""Style of all figures: colours, axes, maps, panels and files, independent of any configuration.

Matplotlib's parameters and pyplot's figures are global to the process. So nothing here uses pyplot;
code draws and saves inside :func:`in_style`, one thread at a time, with this style over
Matplotlib's own defaults; ``matplotlibrc`` files are ignored.
"""

import contextlib
import io
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import LinearSegmentedColormap, to_hex
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from thesis_lib.arrays import Array, ArrayLike

Box = tuple[float, float, float, float]  # left, top, right, bottom in fractions of the figure

MARGIN_PT = 3.0
MAX_SCALE_WIDTH = 0.13  # fraction of the figure's width; narrower boxes are colour bars

# Okabe and Ito's palette: distinct with any colour vision, mid-tone on white and on black.
CYCLE_COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9")
BLUE, ORANGE, GREEN, PINK, RED, SKY = CYCLE_COLORS
BEST_COLOR, WORST_COLOR = BLUE, RED
REFERENCE_COLOR = "#8a8a8a"
HIGHLIGHT_COLOR = "#B22222"
BLACK_COLOR = "#222222"
INK_COLOR = "#444444"
RC_STYLE = matplotlib.rc_params_from_file(
    Path(__file__).with_name("figures.mplstyle"), use_default_template=False
)
MATH_STYLE = {"text.parse_math": True}
"""Style of figures with powers of ten at their axes, and without texts of a user."""

_BOX_DIGITS = 9  # of a panel's place in its figure
_ONE_AT_A_TIME = threading.RLock()


def cycle_color(index: int) -> str:
    """Return the colour of the `index`-th category; colours repeat after six."""
    return CYCLE_COLORS[index % len(CYCLE_COLORS)]


def ordered_colors(count: int) -> list[str]:
    """Return colours of ordered settings, whose order a legend or an axis shows."""
    shades = matplotlib.colormaps["viridis"](np.linspace(0.2, 0.8, count))
    return [to_hex(shade) for shade in shades]


@contextlib.contextmanager
def in_style(changed: Any = None) -> Iterator[None]:
    """Apply the style within a context, in one thread at a time, and restore the parameters.

    `changed` are parameters of Matplotlib that differ from :data:`RC_STYLE`.
    """
    with _ONE_AT_A_TIME, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update({**RC_STYLE, **(changed or {})})
        yield


def drawable_names(names: Iterable[Any], otherwise: str) -> list[str]:
    """Replace names by their number where the font lacks some of their letters.

    Examples
    --------
    >>> drawable_names(["links", "左"], "camera")
    ['links', 'camera 2']
    """
    letters = get_font(findfont("DejaVu Sans"))
    texts = [str(name) for name in names]
    known = [all(letters.get_char_index(ord(c)) for c in text) for text in texts]
    return [text if known[k] else f"{otherwise} {k + 1}" for k, text in enumerate(texts)]


def subplots(
    rows: int = 1, columns: int = 1, figsize: Any = None, layout: Any = "constrained", **how: Any
) -> tuple[Figure, Any]:
    """Return a figure and its panels like ``pyplot.subplots``, but independent of pyplot."""
    figure = Figure(figsize=figsize, layout=layout)
    panels = figure.subplots(rows, columns, **how)
    if how.get("sharey"):  # a phone shows each panel alone
        for axes in figure.axes:
            axes.tick_params(labelleft=True)
    return figure, panels


def make_mosaic(
    names: Any, figsize: Any, layout: Any = "constrained", **how: Any
) -> tuple[Figure, dict[str, Any]]:
    """Return a figure and its panels by name like ``pyplot.subplot_mosaic``.

    Without a layout engine, which takes as long as drawing, ``gridspec_kw`` places the panels
    regardless of their content: figures of one kind are alike.
    """
    figure = Figure(figsize=figsize, layout=layout)
    return figure, figure.subplot_mosaic(names, **how)


def add_colorbar(panel: Axes, picture: Any, label: str) -> None:
    """Add a colour bar to the right of a panel, with its label below."""
    box, figure = panel.get_position(), panel.get_figure(root=True)
    assert figure is not None
    width = figure.get_figwidth()
    place = (box.x1 + 0.08 / width, box.y0 + 0.05 * box.height, 0.1 / width, 0.85 * box.height)
    bar = figure.colorbar(picture, cax=figure.add_axes(place))
    bar.ax.tick_params(labelsize=7)
    bar.ax.text(0, -0.08, label, transform=bar.ax.transAxes, fontsize=8, va="top")


def save_figure(figure: Figure, kind: str, changed: Any = None, **how: Any) -> bytes:
    """Return a figure as the bytes of a file of a kind; equal figures give equal bytes."""
    without = {"svg": "Date", "png": "Software"}[kind]
    content = io.BytesIO()
    with in_style(changed):
        if kind == "svg":
            _lay_out(figure)
        figure.savefig(content, format=kind, metadata={without: None}, **how)
    return content.getvalue()


def _lay_out(figure: Figure) -> None:
    """Place the panels for a file of 72 dpi, without drawing everything as saving would do."""
    if engine := figure.get_layout_engine():
        figure.set_canvas(FigureCanvasSVG(figure))
        figure.dpi = 72
        engine.execute(figure)
        figure.set_layout_engine(None)
        for axes in figure.axes:  # the solver's last digits depend on addresses in memory
            place = axes.get_position(original=True).bounds
            axes.set_position(tuple(round(each, _BOX_DIGITS) for each in place))


def find_panels(figure: Figure) -> str:
    """Return the boxes of a figure's panels, ``left top width height`` in %, in reading order.

    The text is empty if the panels form one column. The figure must have been laid out.
    """
    boxes: list[Box] = []
    for artist in (*figure.axes, *figure.legends, *figure.texts):
        extent = artist.get_tightbbox()
        if extent is None or not artist.get_visible():
            continue
        extent = extent.padded(MARGIN_PT * figure.dpi / 72).transformed(
            figure.transFigure.inverted()
        )
        box = (max(extent.x0, 0), max(1 - extent.y1, 0), min(extent.x1, 1), min(1 - extent.y0, 1))
        left = [one for one in boxes if one[0] < box[0] and _overlap_vertically(one, box)]
        if left and box[2] - box[0] <= MAX_SCALE_WIDTH:  # a colour bar joins the panel on its left
            x0, y0, x1, y1 = panel = max(left)
            whole = min(x0, box[0]), min(y0, box[1]), max(x1, box[2]), max(y1, box[3])
            boxes[boxes.index(panel)] = whole
        else:
            boxes.append(box)
    boxes = _sort_for_reading(boxes)
    if not any(_overlap_vertically(*two) for two in pairwise(boxes)):
        return ""
    return ";".join(
        f"{100 * left:.1f} {100 * top:.1f} {100 * (right - left):.1f} {100 * (bottom - top):.1f}"
        for left, top, right, bottom in boxes
    )


def _sort_for_reading(boxes: list[Box]) -> list[Box]:
    """Sort boxes by row, and from left to right in each row."""
    rows: list[list[Box]] = []
    for box in sorted(boxes, key=lambda one: one[1]):
        if rows and _overlap_vertically(rows[-1][0], box):
            rows[-1].append(box)
        else:
            rows.append([box])
    return [box for row in rows for box in sorted(row)]


def _overlap_vertically(one: Box, other: Box) -> bool:
    """Return whether two boxes overlap vertically by more than half of the lower one's height."""
    common = min(one[3], other[3]) - max(one[1], other[1])
    return common > 0.5 * min(one[3] - one[1], other[3] - other[1])


def figure_svg(figure: Figure, changed: Any = None) -> str:
    """Return a figure as SVG that names its panels; equal figures give equal text."""
    text = save_figure(figure, "svg", changed).decode()
    with in_style(changed):  # the book shows panels below each other on a phone
        panels = find_panels(figure)
    return text.replace("<svg ", f'<svg data-panels="{panels}" ', 1) if panels else text


def make_logarithmic(axis: Axis, ticks: ArrayLike) -> None:
    """Make an axis logarithmic, with plain numbers at its ticks."""
    axes = axis.axes
    (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
    axis.set_major_locator(FixedLocator(np.asarray(ticks, float).tolist()))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


# From blue over near-white to orange, distinct with any colour vision: two even steps in Oklab to
# each side of the middle, which is zero
_DIVERGING_MAP = LinearSegmentedColormap.from_list(
    "diverging", ["#004b9c", "#7ba0cb", "#f5f5f4", "#cb9683", "#98380c"], 129
)
DIVERGING_COLORS = tuple(to_hex(color) for color in _DIVERGING_MAP(range(129)))


def draw_map(axes: Axes, values: Array, across: Array, up: Array, limit: float) -> Any:
    """Draw a map to scale: values (up, across) at centres of cells, colours symmetric about 0."""
    half = [(a[1] - a[0]) / 2 for a in (across, up)]
    extent = (across[0] - half[0], across[-1] + half[0], up[0] - half[1], up[-1] + half[1])
    picture = axes.imshow(
        values,
        _DIVERGING_MAP,
        vmin=-limit,
        vmax=limit,
        extent=extent,
        origin="lower",
        interpolation="nearest",
    )
    axes.grid(visible=False)
    return picture


def draw_maps(
    row: Sequence[Axes], maps: Any, across: Array, up: Array, names: Sequence[str], **look: Any
) -> list[Any]:
    """Draw a row of maps, each a title, values (up, across) and a limit; label the axes in mm."""
    pictures = []
    for axes, (title, values, limit) in zip(row, maps, strict=True):
        pictures.append(draw_map(axes, values, across, up, limit))
        axes.set_title(title, **look)
        axes.set_xlabel(f"{names[0]} in mm")
    row[0].set_ylabel(f"{names[1]} in mm")
    return pictures


TICK_STEPS = tuple(float(f"{digit}e{power}") for power in range(-5, 5) for digit in (1, 2, 5))
"""Ticks of logarithmic axes: 1, 2 and 5 times powers of ten."""


def panel_grid(count: int, width: float, height: float, **how: Any) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels, two in a row of some `height`."""
    rows = -(-count // 2)
    size = (width, rows * height)
    drawing, panels = subplots(rows, 2, figsize=size, squeeze=False, **how)
    flat = panels.ravel().tolist()
    for spare in flat[count:]:
        spare.set_visible(False)
    return drawing, flat


def draw_curves(
    axes: Axes, x: ArrayLike, part: Any, curves: Mapping[str, tuple[str, str, str]], **style: Any
) -> None:
    """Draw variables over `x`: each by its label, line and colour."""
    for name, (label, line, ink) in curves.items():
        axes.plot(x, part[name], line, color=ink, label=label, **style)


def name_styles(axes: Axes, styles: Mapping[str, Mapping[str, Any]]) -> None:
    """Add legend entries without data to a panel: the style of a line by its label."""
    for label, style in styles.items():
        axes.plot([], [], label=label, **{"color": INK_COLOR, "lw": 1, **style})


def log_axes(axes: Axes, x: ArrayLike, y: ArrayLike = TICK_STEPS) -> None:
    """Make both axes logarithmic, with these ticks."""
    make_logarithmic(axes.xaxis, x)
    make_logarithmic(axes.yaxis, y)


def add_legend(axes: Axes, room: float = 0.0, loc: Any = "upper left", **how: Any) -> None:
    """Add a legend, and extend the axis above the curves by `room`, as a share of it."""
    low, high = axes.get_ylim()
    linear = axes.get_yscale() == "linear"
    axes.set_ylim(low, high + room * (high - low) if linear else high * (high / low) ** room)
    axes.legend(loc=loc, **how)


def legend_below(figure: Figure, axes: Axes, ncols: int, first: int = 0) -> None:
    """Put a panel's legend, from its `first` entry on, below the figure, for all panels."""
    handles, labels = axes.get_legend_handles_labels()
    how: Any = {"loc": "outside lower center", "ncols": ncols, "fontsize": 7}
    figure.legend(handles[first:], labels[first:], **how)
