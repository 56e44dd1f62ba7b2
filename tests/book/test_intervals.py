"""Cells of five numbers as small plots: where the marks stand, and what they are called."""

from __future__ import annotations

import re

import pytest

from thesis_lib.book.intervals import drawn

CELLS = ("12.5 · 10.0 (5.0–20.0) · 15.0", "0.50 · 1.0 (0.40–2.0) · 1.1", "nodal [1.4]")
KEY = (
    "<p>Each cell: literal run · median (5–95 %) of the trials · law of rounding, "
    "in % of the largest &lt;deflection&gt;.</p>"
)


def page(*cells: str) -> str:
    row = "".join(f'<td class="a"><p>{one}</p></td>' for one in cells)
    return f'<table><tr>{row}</tr></table>{KEY}<a href="../data/beam-arrays.csv">all</a>'


def marks(html: str) -> list[list[float]]:
    """Where literal run, median, low, high and expectation are drawn, in px, for each cell."""
    found = r'd="M(\S+) 7H(\S+)".*?d="M(\S+) 1v12".*?cx="(\S+)".*?d="M(\S+) 3l'
    rows = [list(map(float, one)) for one in re.findall(found, html)]
    return [[d, m, a, b, t] for a, b, t, m, d in rows if t != 8]


def test_numbers_are_drawn_on_one_scale() -> None:
    made = drawn(page(CELLS[0], "5.0 · 5.0 (2.5–7.5) · 5.0", CELLS[2]))
    first, second = marks(made)
    assert first == [55.0, 45.0, 25.0, 85.0, 65.0]  # 20 % is at 85, 0 at 5
    assert second == [25.0, 25.0, 15.0, 35.0, 25.0]
    assert "nodal [1.4]" in made
    assert "drawn from 0 to 20 %:" in made
    assert "·" not in made


def test_what_spans_decades_is_drawn_by_powers_of_ten() -> None:
    made = drawn(page("100 · 10 (1.0–100) · 10", "1.0 · 1.0 (1.0–1.0) · 1.0"))
    assert marks(made)[0] == [85.0, 45.0, 5.0, 85.0, 45.0]
    assert "from 1 to 100 %, by powers of ten" in made


def test_all_numbers_are_said_and_can_be_had() -> None:
    made = drawn(page(*CELLS))
    said = re.findall("<title>(.*?)</title>", made)
    assert said[0] == (
        "literal run 12.5, median 10.0, 5–95 % of the trials 5.0 to 20.0, law of rounding 15.0"
    )
    assert '<a class="tl-download" download href="../data/beam-arrays.csv">' in made
    assert "of the largest &lt;deflection&gt;." in made


@pytest.mark.parametrize(
    "html", ["<p>none</p>", KEY, page(CELLS[2]), page(*CELLS).replace(KEY, "")]
)
def test_a_page_without_such_cells_stays(html: str) -> None:
    assert drawn(html) == html
