"""Finished pages: names, folded contents, images with sizes, drawn intervals."""

import re

import numpy as np
from lxml.html import document_fromstring, tostring
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from thesis_lib.book import html_pages
from thesis_lib.book.html_pages import draw_intervals
from thesis_lib.plotting.style import figure_svg


def test_cells_of_five_numbers_are_drawn_on_one_scale():
    cells = ("12.5 · 10.0 (5.0–20.0) · 15.0", "5.0 · 5.0 (2.5–7.5) · 5.0", "nodal [1.4]")
    page = document_fromstring(
        f"<table><tr>{''.join(f'<td><p>{one}</p></td>' for one in cells)}</tr></table>"
        "<p>Each cell: nominal run · median (5–95 %) of the trials · law of rounding, in % of "
        'the peak.</p><a href="../data/beam-arrays.csv">all</a>'
    )
    draw_intervals(page)
    text = tostring(page, encoding="unicode")
    found = r'd="M(\S+) 7H(\S+)".*?d="M(\S+) 1v12".*?cx="(\S+)".*?d="M(\S+) 3l'
    marks = [[*map(float, one)] for one in re.findall(found, text, re.DOTALL)][:2]
    assert marks == [[25.0, 85.0, 65.0, 45.0, 55.0], [15.0, 35.0, 25.0, 25.0, 25.0]]
    assert "nodal [1.4]" in text
    assert "nominal run 12.5, median 10.0, 5–95 % of the trials 5.0 to 20.0" in text


def test_colours_in_the_dark_have_the_contrast_of_text():
    ground = html_pages.compute_luminance(html_pages.DARK_GROUND)
    for colour in ("#0072b2", "#b22222", "#1d3557"):
        dark = [int(html_pages.find_dark_colour(colour)[i : i + 2], 16) for i in (1, 3, 5)]
        assert (html_pages.compute_luminance(dark) + 0.05) / (ground + 0.05) >= 4.4


def test_panels_of_a_figure_are_where_matplotlib_draws_them():
    """Four panels, of which the last has a colour scale; a single column has none."""
    figure = Figure(figsize=(7.6, 5.4), layout="constrained")
    axes = figure.subplots(2, 2)
    axes[0, 0].plot([0, 1], [0, 1e4])
    axes[0, 0].set(ylim=(0, 10), ylabel="deflection, mm", title="(a) shape")
    figure.colorbar(axes[1, 1].imshow(np.eye(3)), ax=axes[1, 1], label="w, mm")
    told = re.findall('data-panels="([^"]*)"', figure_svg(figure))[0]
    boxes = [[float(one) for one in box.split()] for box in told.split(";")]
    assert len(boxes) == 4
    width, height = 72 * figure.get_size_inches()
    extent = figure.axes[0].get_tightbbox()
    expected = [100 * extent.x0 / width, 100 - 100 * extent.y1 / height, 100 * extent.width / width]
    assert_allclose(boxes[0][:3], expected, atol=2)
    assert boxes[3][0] + boxes[3][2] > 95  # with its scale
    column = Figure(figsize=(5, 5), layout="constrained")
    column.subplots(3)
    assert "data-panels" not in figure_svg(column)
