"""Style of all figures: colours, axes, maps and files, independent of any configuration.

Matplotlib's parameters belong to the whole process, and pyplot's figures, too. So nothing here uses
pyplot; code that draws or saves does it inside :func:`in_style`, alone among all threads, with
our style over Matplotlib's own defaults; no ``matplotlibrc`` has a say.
"""

from __future__ import annotations

import contextlib
import io
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.plotting.panel_boxes import find_panels

# Okabe and Ito's palette: distinct with any colour vision, mid-tone on white and on black.
CYCLE_COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9")
REFERENCE_COLOR = "#8a8a8a"
HIGHLIGHT_COLOR = "#B22222"
INK_COLOR = "#444444"
RC_STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # no ticks are looked for above a panel, where none are
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "svg.fonttype": "none",  # words are text: found, copied, read, and in fewer bytes
    "font.sans-serif": ["DejaVu Sans", "Verdana", "sans-serif"],  # of equal widths, and any
    "svg.hashsalt": "thesis",  # the same picture gives the same bytes
    "text.parse_math": False,  # a dollar in a reader's name is a dollar
}
MATH_STYLE = {"text.parse_math": True}
"""For figures with powers of ten at their axes, and without a reader's words."""

_BOX_DIGITS = 9  # of a panel's place in its figure
_ONE_AT_A_TIME = threading.RLock()

_LAYOUT_FIELDS = (
    "sharex",
    "sharey",
    "squeeze",
    "width_ratios",
    "height_ratios",
    "subplot_kw",
    "gridspec_kw",
)


def cycle_color(index: int) -> str:
    """Return the colour of the `index`-th setting of a case; they repeat after six."""
    return CYCLE_COLORS[index % len(CYCLE_COLORS)]


@contextlib.contextmanager
def in_style(changed: Any = None) -> Iterator[None]:
    """Draw or save a figure: alone, in our style, and nothing of it left behind.

    Parameters
    ----------
    changed : dict, optional
        Parameters of Matplotlib that differ from :data:`RC_STYLE`.
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


def subplots(rows: int = 1, columns: int = 1, **how: Any) -> tuple[Figure, Any]:
    """Return a figure and its panels like ``pyplot.subplots``, but unknown to pyplot."""
    figure = Figure(**{key: value for key, value in how.items() if key not in _LAYOUT_FIELDS})
    panels = figure.subplots(rows, columns, **{k: how[k] for k in _LAYOUT_FIELDS if k in how})
    if how.get("sharey"):  # a phone shows each panel alone
        for axes in figure.axes:
            axes.tick_params(labelleft=True)
    return figure, panels


def make_mosaic(names: Any, **how: Any) -> tuple[Figure, dict[str, Any]]:
    """Return a figure and its panels by name like ``pyplot.subplot_mosaic``."""
    figure = Figure(**{key: value for key, value in how.items() if key not in _LAYOUT_FIELDS})
    return figure, figure.subplot_mosaic(names, **{k: how[k] for k in _LAYOUT_FIELDS if k in how})


def place_panels(
    names: str,
    size: tuple[float, float],
    edges: tuple[float, float, float, float],
    gaps: tuple[float, float],
    heights: Sequence[float] | None = None,
) -> tuple[Figure, dict[str, Any]]:
    """Return a figure and its panels by name, in places that do not depend on their content.

    So figures of one kind are alike; and to look for room, as layout engines do, takes as long as
    to draw.

    Parameters
    ----------
    names : str
        As ``pyplot.subplot_mosaic`` takes them.
    size : tuple of float
        Width and height of the figure in inches.
    edges : tuple of float
        Room at the left, right, bottom and top in inches.
    gaps : tuple of float
        Room between columns and between rows in inches.
    heights : sequence of float, optional
        Of the rows, relative to each other.
    """
    (width, height), (left, right, bottom, top) = size, edges
    rows = names.split(";")
    across = (width - left - right - gaps[0] * (len(rows[0]) - 1)) / len(rows[0])
    up = (height - bottom - top - gaps[1] * (len(rows) - 1)) / len(rows)
    grid = {
        "left": left / width,
        "right": 1 - right / width,
        "bottom": bottom / height,
        "top": 1 - top / height,
        "wspace": gaps[0] / across,
        "hspace": gaps[1] / up,
    }
    figure = Figure(figsize=size)
    return figure, figure.subplot_mosaic(names, gridspec_kw=grid, height_ratios=heights)


def bar_beside(panel: Axes, picture: Any, label: str) -> None:
    """Add a colour bar at the right of a panel, below its label."""
    box, figure = panel.get_position(), panel.get_figure(root=True)
    assert figure is not None
    width = figure.get_figwidth()
    place = (box.x1 + 0.08 / width, box.y0 + 0.05 * box.height, 0.1 / width, 0.85 * box.height)
    bar = figure.colorbar(picture, cax=figure.add_axes(place))
    bar.ax.tick_params(labelsize=7)
    bar.ax.text(0, 1.04, label, transform=bar.ax.transAxes, fontsize=8)


def save_figure(figure: Figure, kind: str, changed: Any = None, **how: Any) -> bytes:
    """Return a figure as a file of a kind in its style; equal figures give equal bytes."""
    without: Mapping[str, None] = {"svg": {"Date": None}, "png": {"Software": None}}[kind]
    content = io.BytesIO()
    with in_style(changed):
        panels = ""
        if kind == "svg":
            _lay_out(figure)
            panels = find_panels(figure)
        figure.savefig(content, format=kind, metadata=dict(without), **how)
    if panels:  # the book shows them one below the other on a phone
        return content.getvalue().replace(b"<svg ", f'<svg data-panels="{panels}" '.encode(), 1)
    return content.getvalue()


def _lay_out(figure: Figure) -> None:
    """Place the panels as a file of 72 dots per inch has them; to save would draw all to do so."""
    if engine := figure.get_layout_engine():
        figure.set_canvas(FigureCanvasSVG(figure))
        figure.dpi = 72
        engine.execute(figure)
        figure.set_layout_engine(None)
        for axes in figure.axes:  # the solver's last digits hang on addresses in memory
            place = axes.get_position(original=True).bounds
            axes.set_position(tuple(round(each, _BOX_DIGITS) for each in place))


def figure_svg(figure: Figure, changed: Any = None) -> str:
    """Return a figure as SVG; equal figures give equal text."""
    return save_figure(figure, "svg", changed).decode()


def make_logarithmic(axis: Axis, ticks: Sequence[float]) -> None:
    """Make an axis logarithmic, with plain numbers at its ticks."""
    axes = axis.axes
    (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _diverging(count: int = 129) -> tuple[str, ...]:
    """Compute colours from blue over near-white to orange, distinct with any colour vision.

    Straight lines in Oklab from the ends to the middle; `count` is odd, the middle is zero.
    """
    ends = {-1: (0.42, -0.045, -0.145), 1: (0.47, 0.105, 0.09)}
    middle = np.array([0.97, 0.0, 0.002])
    steps = np.linspace(-1, 1, count)
    lab = np.array([middle + abs(t) * (np.array(ends[1 if t > 0 else -1]) - middle) for t in steps])
    to_lms = np.array(
        [
            [1, 0.3963377774, 0.2158037573],
            [1, -0.1055613458, -0.0638541728],
            [1, -0.0894841775, -1.2914855480],
        ]
    )
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    linear = np.clip((lab @ to_lms.T) ** 3 @ to_rgb.T, 0, 1)
    srgb = np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)
    return tuple("#" + "".join(f"{round(255 * c):02x}" for c in color) for color in srgb)


DIVERGING_COLORS = _diverging()
_DIVERGING_MAP = ListedColormap(list(DIVERGING_COLORS), "diverging")


def draw_map(axes: Axes, values: Array, across: Array, up: Array, limit: float) -> Any:
    """Draw a map to scale: values (up, across) at the centres of cells, zero in the middle."""
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


TICK_STEPS = tuple(float(f"{digit}e{power}") for power in range(-5, 5) for digit in (1, 2, 5))
"""Ticks of logarithmic axes: 1, 2 and 5 times powers of ten."""


def iterate_slices(cube: xr.Dataset, dim: str) -> Iterator[xr.Dataset]:
    """Iterate over a cube along a dimension."""
    return (cube.isel({dim: index}) for index in range(cube.sizes[dim]))


def panel_grid(count: int, width: float, height: float, **how: Any) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels, two in a row of some `height`."""
    rows = -(-count // 2)
    size = (width, rows * height)
    drawing, panels = subplots(rows, 2, figsize=size, layout="constrained", squeeze=False, **how)
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


def draw_errors(axes: Axes, x: Any, y: Any, error: Any, ink: str, size: float = 3) -> None:
    """Draw values with error bars."""
    axes.errorbar(x, y, error, fmt="o", color=ink, ms=size, lw=1)


def log_axes(axes: Axes, x: Sequence[float], y: Sequence[float] = TICK_STEPS) -> None:
    """Make both axes logarithmic, with these ticks."""
    make_logarithmic(axes.xaxis, [float(tick) for tick in x])
    make_logarithmic(axes.yaxis, y)


def add_legend(axes: Axes, room: float = 0.0, loc: Any = "upper left", **how: Any) -> None:
    """Add a legend in some room above what is drawn, a share of the logarithmic axis."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** room)
    axes.legend(loc=loc, **how)
