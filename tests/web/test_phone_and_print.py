"""The rendered book on a phone and on paper: figures grow, nothing to press is printed."""

from io import BytesIO

import pytest

pytest.importorskip("playwright", reason="the browser tests need the playwright package")

from book.test_book_pages import BOOK, needs_book
from browser import Opened, open_offline
from playwright.sync_api import Browser

PRESSED = """() => [...document.querySelectorAll(
    'main :is(input, select, textarea, button:not(thead *), .tl-controls)')]
  .filter(one => one.checkVisibility({ visibilityProperty: true })).map(one => one.outerHTML)"""


def enlarge(opened: Opened, figure: str) -> tuple[list[float], list[tuple[float, float, float]]]:
    """Widths of a figure's parts in the page, and left, top and width of those enlarged."""
    boxes = """parts => parts.map(one => one.getBoundingClientRect())
      .map(({ left, top, width }) => [left, top, width])"""
    parts = ":is(.tl-panel, .tl-frame:not(:has(.tl-panels)) img)"
    before = opened.page.locator(figure).first.locator(parts).evaluate_all(boxes)
    opened.page.locator(figure).first.locator(".tl-grow").click()
    after = opened.page.locator(".tl-zoom-view :is(.tl-panel, :scope > img)")
    return [width for *_, width in before], after.evaluate_all(boxes)


@needs_book
def test_a_phone_enlarges_to_twice_the_width(chromium: Browser) -> None:
    """Panels stay one below the other."""
    with open_offline(chromium, BOOK / "executed" / "beam-aperture.html", 390, 844) as opened:
        opened.page.locator("#fig-3-7").first.scroll_into_view_if_needed()
        before, after = enlarge(opened, "#fig-3-7")
        assert len(before) == len(after) > 0
        assert all(new[2] >= 1.99 * old for old, new in zip(before, after, strict=True))
        assert [top for _, top, _ in after] == sorted({top for _, top, _ in after})


@needs_book
@pytest.mark.parametrize(
    ("name", "sheets"),
    [("executed/beam-arrays", 18), ("explorer", 2)],
)
def test_nothing_to_press_is_printed(chromium: Browser, name: str, sheets: int) -> None:
    pypdf = pytest.importorskip("pypdf", reason="sheets are counted with pypdf")
    with open_offline(chromium, BOOK / f"{name}.html", 1280, 800) as opened:
        opened.page.emulate_media(media="print")
        assert opened.page.evaluate(PRESSED) == []
        margin = dict.fromkeys(("top", "right", "bottom", "left"), "10mm")
        printed = opened.page.pdf(format="A4", margin=margin, print_background=True)
        assert len(pypdf.PdfReader(BytesIO(printed)).pages) <= sheets
