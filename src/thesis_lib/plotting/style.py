"""How figures look, and that they always look so: one drawing at a time, whatever is configured.

Matplotlib's parameters belong to the whole process, and pyplot's figures, too. So nothing here uses
pyplot, and whoever draws or saves does it inside :func:`in_style`, alone among all threads, with
our style over Matplotlib's own defaults; no ``matplotlibrc`` has a say.
"""

from __future__ import annotations

import contextlib
import io
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

# Okabe and Ito's palette: told apart with any colour vision, mid-tone on white and on black.
COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9")
REFERENCE = "#8a8a8a"
HIGHLIGHT = "#B22222"
INK = "#444444"
STYLE: Any = {
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
BELOW = "below"
"""What the name of a panel begins with that goes with the one above it, also on a phone."""
POWERS = {"text.parse_math": True}
"""For figures with powers of ten at their axes, and without a reader's words."""

_DIGITS = 9  # of a panel's place in its figure
_ONE_AT_A_TIME = threading.RLock()

_LAYOUT = (
    "sharex",
    "sharey",
    "squeeze",
    "width_ratios",
    "height_ratios",
    "subplot_kw",
    "gridspec_kw",
)


def color(index: int) -> str:
    """Colour of the `index`-th setting of a case; they repeat after six."""
    return COLORS[index % len(COLORS)]


@contextlib.contextmanager
def in_style(changed: Any = None) -> Iterator[None]:
    """Draw or save a figure: alone, in our style, and nothing of it left behind.

    Parameters
    ----------
    changed : dict, optional
        Parameters of Matplotlib that differ from :data:`STYLE`.
    """
    with _ONE_AT_A_TIME, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update({**STYLE, **(changed or {})})
        yield


def drawable(names: Iterable[Any], otherwise: str) -> list[str]:
    """Names as a figure can show them: by their number where our font has not all letters.

    Examples
    --------
    >>> drawable(["links", "左"], "camera")
    ['links', 'camera 2']
    """
    letters = get_font(findfont("DejaVu Sans"))
    texts = [str(name) for name in names]
    known = [all(letters.get_char_index(ord(c)) for c in text) for text in texts]
    return [text if known[k] else f"{otherwise} {k + 1}" for k, text in enumerate(texts)]


def subplots(rows: int = 1, columns: int = 1, **how: Any) -> tuple[Figure, Any]:
    """A figure and its panels, as ``pyplot.subplots`` makes them, but known to nobody else."""
    figure = Figure(**{key: value for key, value in how.items() if key not in _LAYOUT})
    panels = figure.subplots(rows, columns, **{k: how[k] for k in _LAYOUT if k in how})
    if how.get("sharey"):  # a phone shows each panel alone
        for axes in figure.axes:
            axes.tick_params(labelleft=True)
    return figure, panels


def mosaic(names: Any, **how: Any) -> tuple[Figure, dict[str, Any]]:
    """A figure and its panels by name, as ``pyplot.subplot_mosaic`` makes them."""
    figure = Figure(**{key: value for key, value in how.items() if key not in _LAYOUT})
    return figure, figure.subplot_mosaic(names, **{k: how[k] for k in _LAYOUT if k in how})


def placed(
    names: str,
    size: tuple[float, float],
    edges: tuple[float, float, float, float],
    gaps: tuple[float, float],
    heights: Sequence[float] | None = None,
) -> tuple[Figure, dict[str, Any]]:
    """A figure and its panels by name, in places that do not depend on what is drawn in them.

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
    """A colour bar at the right of a panel, in the room there, below its label."""
    box, figure = panel.get_position(), panel.get_figure(root=True)
    assert figure is not None
    width = figure.get_figwidth()
    place = (box.x1 + 0.08 / width, box.y0 + 0.05 * box.height, 0.1 / width, 0.85 * box.height)
    bar = figure.colorbar(picture, cax=figure.add_axes(place))
    bar.ax.tick_params(labelsize=7)
    bar.ax.text(0, 1.04, label, transform=bar.ax.transAxes, fontsize=8)


def saved(figure: Figure, kind: str, changed: Any = None, **how: Any) -> bytes:
    """A figure as a file of a kind, in the style it was drawn in; the same gives the same bytes."""
    without: Mapping[str, None] = {"svg": {"Date": None}, "png": {"Software": None}}[kind]
    content = io.BytesIO()
    with in_style(changed):
        if kind == "svg":
            _lay_out(figure)
        figure.savefig(content, format=kind, metadata=dict(without), **how)
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
            axes.set_position(tuple(round(each, _DIGITS) for each in place))


def svg(figure: Figure, changed: Any = None) -> str:
    """A figure as SVG; the same figure gives the same text."""
    return saved(figure, "svg", changed).decode()


def logarithmic(axis: Axis, ticks: Sequence[float]) -> None:
    """A logarithmic axis with plain numbers at its ticks."""
    axes = axis.axes
    (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
