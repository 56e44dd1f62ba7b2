"""What a page offers its readers: figures that grow, previews, the dark, citations, paper."""

import re
from io import BytesIO

import axe
import numpy as np
import pytest
from book.test_book_pages import BOOK, needs_book
from browser import open_offline
from PIL import Image

from thesis_lib import __version__

RESULTS = BOOK / "executed" / "beam-aperture.html"
WIDTH = "() => document.querySelector('.tl-zoom img').getBoundingClientRect().width"
SCROLLED = "() => document.querySelector('.tl-zoom-view').scrollLeft"
CORNER = """async (image) => { image.loading = 'eager'; await image.decode();
    return [getComputedStyle(image).backgroundColor, getComputedStyle(image).filter,
            getComputedStyle(image).colorScheme]; }"""

BOXES = """parts => parts.map(one => one.getBoundingClientRect())
  .map(({ top, width }) => [top, width])"""
PRESSED = """() => [...document.querySelectorAll(
    'main :is(input, select, textarea, button:not(thead *), .tl-controls)')]
  .filter(one => one.checkVisibility({ visibilityProperty: true })).map(one => one.outerHTML)"""


@needs_book
def test_a_figure_grows_by_keyboard_and_by_mouse(chromium):
    with open_offline(chromium, RESULTS) as opened:
        page = opened.page
        grow = page.locator("#fig-3-7 .tl-grow")
        assert grow.get_attribute("aria-label") == "Enlarge: Figure 3.7"
        grow.focus()
        page.keyboard.press("Enter")
        small = page.evaluate(WIDTH)
        assert small > 800
        page.keyboard.press("+")
        assert page.evaluate(WIDTH) == pytest.approx(1.4 * small, rel=0.01)
        before = page.evaluate(SCROLLED)
        page.locator(".tl-zoom-view").press("ArrowRight")
        page.wait_for_function(f"before => ({SCROLLED})() > before", arg=before)
        page.keyboard.press("0")
        assert page.evaluate(WIDTH) == pytest.approx(small, rel=0.01)
        page.locator(".tl-zoom-view").focus()
        assert axe.findings(page) == []
        page.keyboard.press("Escape")
        assert not page.locator(".tl-zoom").is_visible()
        page.locator("#fig-3-7 img").click()
        assert page.locator(".tl-zoom").is_visible()


@needs_book
@pytest.mark.parametrize(
    ("name", "link", "says"),
    [
        ("glossary.html", "a[href$='#equation-eq-noisy-law']", r"Equation \(\d+\)"),
        ("how-to.html", "a[href$='#fig-3-8']", r"Figure 3\.8"),
    ],
)
def test_a_link_tells_what_it_leads_to(chromium, name, link, says):
    with open_offline(chromium, BOOK / name) as opened:
        page = opened.page
        one = page.locator(f".bd-article {link}").first
        one.focus()
        preview = page.locator(".tl-preview")
        preview.wait_for()
        assert re.search(says, preview.inner_text())
        assert one.get_attribute("aria-describedby") == "tl-preview"
        if name == "how-to.html":
            assert axe.findings(page, "color-contrast", "aria-tooltip-name") == []
        page.keyboard.press("Escape")
        assert not preview.is_visible()
        one.hover()
        preview.wait_for()


@needs_book
def test_a_first_tap_shows_and_a_second_goes(chromium):
    with open_offline(chromium, BOOK / "how-to.html", width=390) as opened:
        page = opened.page
        link = page.locator(".bd-article a[href$='#fig-3-8']").first
        link.tap()
        page.locator(".tl-preview").wait_for()
        assert page.url.endswith("how-to.html")
        assert opened.sideways_px() <= 0
        link.tap()
        page.wait_for_url("**/beam-aperture.html#fig-3-8")


@needs_book
def test_drawings_follow_the_page(chromium):
    """Also against the browser's own wish: the page's switch decides."""
    with open_offline(chromium, RESULTS) as opened:
        page = opened.page
        for _ in range(3):
            if page.evaluate("() => document.documentElement.dataset.theme") == "dark":
                break
            page.locator(".theme-switch-button").click()
        image = page.locator("#fig-3-7 img")
        image.scroll_into_view_if_needed()
        page.wait_for_timeout(300)
        assert image.evaluate(CORNER) == ["rgba(0, 0, 0, 0)", "none", "dark"]
        shot = Image.open(BytesIO(image.screenshot())).convert("L")
        assert shot.getpixel((3, 3)) < 40
        assert shot.getextrema()[1] > 180  # its words are to be seen


@needs_book
def test_pages_figures_and_cubes_are_cited_with_their_edition(chromium):
    with open_offline(chromium, RESULTS) as opened:
        page = opened.page
        page.locator("button.tl-cite").click()
        said = page.locator(".tl-cites pre")
        said.first.wait_for()
        assert "The beam: aperture" in said.first.inner_text()
        edition = rf"Version {re.escape(__version__)}, commit [\da-f]{{7,}}"
        assert re.search(edition, said.first.inner_text())
        page.locator(".tl-cites select").select_option(label="Figure 3.8 (The beam: aperture)")
        assert "@misc{vibration-fig-3-8," in said.last.inner_text()
        assert "executed/beam-aperture.html#fig-3-8" in said.nth(1).inner_text()
        page.get_by_role("button", name="Copy BibTeX").click()
        page.get_by_text("BibTeX: copied.").wait_for()
        assert axe.findings(page) == []


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
    [pytest.param("executed/beam-arrays", 18, marks=pytest.mark.nightly), ("explorer", 2)],
)
def test_nothing_to_press_is_printed(chromium, name, sheets):
    pypdf = pytest.importorskip("pypdf", reason="sheets are counted with pypdf")
    with open_offline(chromium, BOOK / f"{name}.html", 1280, 800) as opened:
        opened.page.emulate_media(media="print")
        assert opened.page.evaluate(PRESSED) == []
        margin = dict.fromkeys(("top", "right", "bottom", "left"), "10mm")
        printed = opened.page.pdf(format="A4", margin=margin, print_background=True)
        assert len(pypdf.PdfReader(BytesIO(printed)).pages) <= sheets
