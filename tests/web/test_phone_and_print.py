"""The rendered book on a phone and on paper: figures grow, nothing to press is printed."""

from io import BytesIO

import numpy as np
import pytest
from book.test_book_pages import BOOK, needs_book
from browser import open_offline

BOXES = """parts => parts.map(one => one.getBoundingClientRect())
  .map(({ top, width }) => [top, width])"""
PRESSED = """() => [...document.querySelectorAll(
    'main :is(input, select, textarea, button:not(thead *), .tl-controls)')]
  .filter(one => one.checkVisibility({ visibilityProperty: true })).map(one => one.outerHTML)"""


@needs_book
def test_a_phone_enlarges_to_twice_the_width(chromium):
    """Panels stay one below the other."""
    with open_offline(chromium, BOOK / "executed" / "beam-aperture.html", 390, 844) as opened:
        figure = opened.page.locator("#fig-3-7").first
        figure.scroll_into_view_if_needed()
        parts = figure.locator(":is(.tl-panel, .tl-frame:not(:has(.tl-panels)) img)")
        before = np.array(parts.evaluate_all(BOXES))
        figure.locator(".tl-grow").click()
        enlarged = opened.page.locator(".tl-zoom-view :is(.tl-panel, :scope > img)")
        after = np.array(enlarged.evaluate_all(BOXES))
        assert len(before) == len(after) > 0
        assert np.all(after[:, 1] >= 1.99 * before[:, 1])
        assert np.all(np.diff(after[:, 0]) > 0)


@needs_book
@pytest.mark.parametrize(
    ("name", "sheets"),
    [("executed/beam-arrays", 18), ("explorer", 2)],
)
def test_nothing_to_press_is_printed(chromium, name, sheets):
    pypdf = pytest.importorskip("pypdf", reason="sheets are counted with pypdf")
    with open_offline(chromium, BOOK / f"{name}.html", 1280, 800) as opened:
        opened.page.emulate_media(media="print")
        assert opened.page.evaluate(PRESSED) == []
        margin = dict.fromkeys(("top", "right", "bottom", "left"), "10mm")
        printed = opened.page.pdf(format="A4", margin=margin, print_background=True)
        assert len(pypdf.PdfReader(BytesIO(printed)).pages) <= sheets
