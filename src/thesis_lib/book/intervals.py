"""Cells of errors as small plots: a literal run, a median with its 5–95 % and what is expected.

Notebooks print all five numbers, so that they can be compared; a page shows the median, draws the
rest on one scale for its table, and leads to the CSV that has the numbers.
"""

from __future__ import annotations

import math
import re
from html import escape

_TABLE = re.compile(r"<table\b.*?</table>", re.DOTALL)
_CELL = re.compile(r"(<td\b[^>]*>)<p>([\d.]+) · ([\d.]+) \(([\d.]+)–([\d.]+)\) · ([\d.]+)</p></td>")
_KEY = re.compile(
    r"<p>Each cell: (.*?) · median \(5–95 %\) of the (.*?) · (.*?), in % of (.*?)</p>"
)
_CSV = re.compile(r'href="([^"]*data/[\w-]+\.csv)"')
_WIDTH, _HEIGHT = 90, 14  # px
_DECADES = 1.7  # beyond so many the scale is logarithmic


def drawn(html: str) -> str:
    """The same page with its cells of five numbers drawn."""
    key = _KEY.search(html)
    if key is None:
        return html
    first, draws, expected, of = key.groups()
    words = (first, f"5–95 % of the {draws}", expected)
    scales: list[str] = []

    def table(match: re.Match[str]) -> str:
        cells = [tuple(map(float, cell[1:])) for cell in _CELL.findall(match[0])]
        if not cells:
            return match[0]
        scale = _Scale([number for cell in cells for number in cell])
        scales.append(scale.words)
        return _CELL.sub(lambda cell: _cell(cell, scale, words), match[0])

    html = _TABLE.sub(table, html)
    if not scales:
        return html
    csv = _CSV.search(html)
    told = (
        f"Each cell: the median, and drawn {scales[0]}: {_mark('m')} median and {_mark('l')} "
        f"5–95 % of the {draws}, {_mark('d')} {first}, {_mark('t')} {expected}; in % of {of}"
    )
    if csv:
        told += f' <a class="tl-download" download href="{csv[1]}">All numbers (CSV)</a>'
    return html.replace(key[0], f'<p class="tl-interval-key">{told}</p>', 1)


class _Scale:
    """From an error in % to a place in a cell."""

    def __init__(self, numbers: list[float]) -> None:
        some = [number for number in numbers if number > 0] or [1.0]
        self.low, self.high = min(some), max(some)
        self.logarithmic = math.log10(self.high / self.low) > _DECADES
        begin = f"{self.low:g}" if self.logarithmic else "0"
        kind = ", by powers of ten" if self.logarithmic else ""
        self.words = f"from {begin} to {self.high:g} %{kind}"

    def __call__(self, number: float) -> float:
        share = number / self.high
        if self.logarithmic:
            begin = math.log(self.low / self.high)
            share = 1 - math.log(max(share, self.low / self.high)) / begin
        return round(5 + (_WIDTH - 10) * share, 1)


def _cell(cell: re.Match[str], scale: _Scale, words: tuple[str, str, str]) -> str:
    literal, median, low, high, expected = cell.groups()[1:]
    d, m, a, b, t = (scale(float(one)) for one in (literal, median, low, high, expected))
    said = escape(
        f"{words[0]} {literal}, median {median}, {words[1]} {low} to {high}, {words[2]} {expected}"
    )
    marks = (
        f'<path class="l" d="M{a} 7H{b}"/><path class="t" d="M{t} 1v12"/>'
        f'<circle class="m" cx="{m}" cy="7" r="3"/><path class="d" d="M{d} 3l4 4-4 4-4-4z"/>'
    )
    return (
        f'{cell[1]}<span class="tl-interval">{median} <svg role="img" width="{_WIDTH}" '
        f'height="{_HEIGHT}"><title>{said}</title>{marks}</svg></span></td>'
    )


def _mark(kind: str) -> str:
    shapes = {
        "l": '<path class="l" d="M1 7H15"/>',
        "t": '<path class="t" d="M8 1v12"/>',
        "m": '<circle class="m" cx="8" cy="7" r="3"/>',
        "d": '<path class="d" d="M8 3l4 4-4 4-4-4z"/>',
    }
    return (
        f'<svg class="tl-interval" aria-hidden="true" width="16" height="14">{shapes[kind]}</svg>'
    )
