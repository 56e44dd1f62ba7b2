"""Cells with five numbers drawn as small plots: nominal run, median with its 5–95 %, prediction.

Notebooks print all five numbers, so that they can be compared; a page shows the median, draws the
rest on one scale for each table, and links to the CSV file that has the numbers.
"""

from __future__ import annotations

import math
import re
from typing import Any

from lxml.html import fragment_fromstring

from thesis_lib.web.html import render_html

MAX_LINEAR_DECADES = 1.7  # a scale that spans more is logarithmic
WIDTH_PX = 90
_INTERVAL_PATTERN = re.compile(r"([\d.]+) · ([\d.]+) \(([\d.]+)–([\d.]+)\) · ([\d.]+)")
_KEY_PATTERN = re.compile(
    r"Each cell: (.*?) · median \(5–95 %\) of the (.*?) · (.*?), in % of (.*)", re.DOTALL
)


def draw_intervals(page: Any) -> None:
    """Replace the cells of five numbers of a parsed page, and their key, by drawings."""
    keys = [p for p in page.iter("p") if (p.text or "").startswith("Each cell: ")]
    match = _KEY_PATTERN.fullmatch(keys[0].text_content()) if keys else None
    if match is None:
        return
    nominal, draws, predicted, unit = match.groups()
    words = (nominal, f"5–95 % of the {draws}", predicted)
    scales = [scale for table in page.iter("table") if (scale := _draw_table(table, words))]
    if not scales:
        return
    links = page.xpath("//a[contains(@href, 'data/') and contains(@href, '.csv')]/@href")
    values = {"scale": scales[0], "words": words, "unit": unit, "numbers": "".join(links[:1])}
    new = fragment_fromstring(render_html("book/templates/interval_key.html.j2", **values))
    new.tail = keys[0].tail
    keys[0].getparent().replace(keys[0], new)


def _draw_table(table: Any, words: tuple[str, str, str]) -> str:
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

    names = ("nominal", "median", "lower", "upper", "predicted")
    for cell, texts in cells:
        values = {"words": words, "width": WIDTH_PX, "place": place_mark}
        values |= dict(zip(names, texts, strict=True))
        drawing = render_html("book/templates/interval_cell.html.j2", **values)
        cell[:], cell.text = [fragment_fromstring(drawing)], None
    begin, kind = (f"{low:g}", ", by powers of ten") if logarithmic else ("0", "")
    return f"from {begin} to {high:g} %{kind}"
