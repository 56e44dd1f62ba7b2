"""Cells with five numbers drawn as small plots: nominal run, median with its 5–95 %, prediction.

Notebooks print all five numbers, so that they can be compared; a page shows the median, draws the
rest on one scale for each table, and links to the CSV file that has the numbers.
"""

from __future__ import annotations

import math
import re
from typing import Any

from lxml.html import builder, fragment_fromstring

MAX_LINEAR_DECADES = 1.7  # a scale that spans more is logarithmic
WIDTH_PX, HEIGHT_PX = 90, 14
_INTERVAL_PATTERN = re.compile(r"([\d.]+) · ([\d.]+) \(([\d.]+)–([\d.]+)\) · ([\d.]+)")
_KEY_PATTERN = re.compile(
    r"Each cell: (.*?) · median \(5–95 %\) of the (.*?) · (.*?), in % of (.*)", re.DOTALL
)
_KEY_MARKS = {
    "m": '<circle class="m" cx="8" cy="7" r="3"/>',
    "l": '<path class="l" d="M1 7H15"/>',
    "d": '<path class="d" d="M8 3l4 4-4 4-4-4z"/>',
    "t": '<path class="t" d="M8 1v12"/>',
}


def draw_intervals(page: Any) -> None:
    """Replace the cells of five numbers of a parsed page, and their key, by drawings."""
    keys = [p for p in page.iter("p") if (p.text or "").startswith("Each cell: ")]
    match = _KEY_PATTERN.fullmatch(keys[0].text_content()) if keys else None
    if match is None:
        return
    nominal, draws, predicted, unit = match.groups()
    names = (nominal, f"5–95 % of the {draws}", predicted)
    scales = [scale for table in page.iter("table") if (scale := _draw_table(table, names))]
    if not scales:
        return
    new = builder.P({"class": "tl-interval-key"}, f"Each cell: the median, and drawn {scales[0]}: ")
    words = {
        "m": "median and",
        "l": f"{names[1]},",
        "d": f"{nominal},",
        "t": f"{predicted}; in % of {unit} ",
    }
    for name, text in words.items():
        mark = _parse_drawing(_KEY_MARKS[name], 'class="tl-interval" aria-hidden="true" width="16"')
        mark.tail = f" {text} "
        new.append(mark)
    for link in page.xpath("//a[contains(@href, 'data/') and contains(@href, '.csv')]")[:1]:
        attributes = {"class": "tl-download", "download": "", "href": link.get("href")}
        new.append(builder.A("All numbers (CSV)", attributes))
    new.tail = keys[0].tail
    keys[0].getparent().replace(keys[0], new)


def _draw_table(table: Any, names: tuple[str, str, str]) -> str:
    """Draw the cells of a table; return the words for their scale, empty if it has no such cell."""
    found = [
        (cell, _INTERVAL_PATTERN.fullmatch(cell.text_content().strip()))
        for cell in table.iter("td")
    ]
    cells = [(cell, match.groups()) for cell, match in found if match]
    if not cells:
        return ""
    numbers = [float(text) for _, texts in cells for text in texts]
    low, high = min((one for one in numbers if one > 0), default=1.0), max(numbers)
    logarithmic = low < high and math.log10(high / low) > MAX_LINEAR_DECADES

    def place_mark(text: str) -> float:
        share = float(text) / high if high else 0.0
        if logarithmic:
            share = 1 - math.log(max(share, low / high)) / math.log(low / high)
        return round(5 + (WIDTH_PX - 10) * share, 1)

    for cell, texts in cells:
        nominal, median, lower, upper, predicted = texts
        d, m, a, b, t = map(place_mark, texts)
        words = (
            f"{names[0]} {nominal}, median {median}, {names[1]} {lower} to {upper}, "
            f"{names[2]} {predicted}"
        )
        drawing = _parse_drawing(
            f'<title></title><path class="l" d="M{a} 7H{b}"/><path class="t" d="M{t} 1v12"/>'
            f'<circle class="m" cx="{m}" cy="7" r="3"/><path class="d" d="M{d} 3l4 4-4 4-4-4z"/>',
            f'role="img" width="{WIDTH_PX}"',
        )
        drawing.find("title").text = words
        cell[:] = [builder.SPAN(f"{median} ", drawing, {"class": "tl-interval"})]
        cell.text = None
    begin, kind = (f"{low:g}", ", by powers of ten") if logarithmic else ("0", "")
    return f"from {begin} to {high:g} %{kind}"


def _parse_drawing(shapes: str, attributes: str) -> Any:
    return fragment_fromstring(f'<svg {attributes} height="{HEIGHT_PX}">{shapes}</svg>')
