"""Where the panels of a drawing are, as Matplotlib itself tells."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from thesis_lib.book.panels import panels, with_panels
from thesis_lib.plotting.style import svg

NEAR = 2.0  # % of the drawing: words are taken to be as high as their font


def four() -> Figure:
    """Labelled panels, one with lines that go on beyond it, one with a scale beside it."""
    figure = Figure(figsize=(7.6, 5.4), layout="constrained")
    axes = figure.subplots(2, 2)
    axes[0, 0].plot([0, 1], [0, 1e4])
    axes[0, 0].set(ylim=(0, 10), ylabel="deflection, mm", title="(a) shape")
    axes[0, 1].plot([0, 1])
    axes[0, 1].set(xlabel="x, mm", ylabel="error, %")
    axes[1, 0].plot([3, 2, 1])
    axes[1, 0].set(xlabel="x, mm")
    figure.colorbar(axes[1, 1].imshow(np.eye(3)), ax=axes[1, 1], label="w, mm")
    return figure


def boxes(told: str) -> list[list[float]]:
    return [[float(one) for one in box.split()] for box in told.split(";")]


def test_boxes_are_those_of_matplotlib() -> None:
    figure = four()
    found = boxes(panels(svg(figure)))
    width, height = 72 * figure.get_size_inches()
    figure.set_dpi(72)
    figure.canvas.draw()
    *single, image, scale = [one.get_tightbbox() for one in figure.axes]
    extents = [one.extents for one in single]
    extents.append(np.r_[np.minimum(image.min, scale.min), np.maximum(image.max, scale.max)])
    assert len(found) == 4
    for (left, top, wide, high), (x0, y0, x1, y1) in zip(found, extents, strict=True):
        expected = [100 * x0 / width, 100 - 100 * y1 / height, 100 * x1 / width]
        assert_allclose([left, top, left + wide], expected, atol=NEAR)
        assert top + high == pytest.approx(100 - 100 * y0 / height, abs=NEAR)


def test_a_drawing_says_it_once_and_keeps_it() -> None:
    drawn = svg(four())
    told = with_panels(drawn)
    assert told.count("data-panels=") == 1
    assert panels(told) == panels(drawn)


@pytest.mark.parametrize("rows", [1, 3])
def test_one_column_is_left_alone(rows: int) -> None:
    figure = Figure(figsize=(5, 5), layout="constrained")
    for one in np.ravel(figure.subplots(rows)):
        one.plot([1, 2])
    drawn = svg(figure)
    assert panels(drawn) == ""
    assert with_panels(drawn) == drawn


def test_another_drawing_has_none() -> None:
    assert panels('<svg viewBox="0 0 4 3"><g><path d="M0 0h4"/></g></svg>') == ""
    assert panels("<svg/>") == ""
    assert (
        panels('<svg viewBox="0 0 4 3"><g><g id="a"><text>size untold</text></g></g></svg>') == ""
    )
