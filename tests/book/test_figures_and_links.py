"""What a page offers to those who read it: figures that grow, previews, the dark, citations."""

import re
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="the browser tests need the playwright package")

import axe
from book.test_book_pages import BOOK, PAGES, needs_book
from browser import open_offline, server
from PIL import Image
from playwright.sync_api import Browser

from thesis_lib import __version__

RESULTS = BOOK / "executed" / "beam-aperture.html"
WIDTH = "() => document.querySelector('.tl-zoom img').getBoundingClientRect().width"
CORNER = """async (image) => { image.loading = 'eager'; await image.decode();
    return [getComputedStyle(image).backgroundColor, getComputedStyle(image).filter,
            getComputedStyle(image).colorScheme]; }"""


@needs_book
def test_a_figure_grows_by_keyboard_and_by_mouse(chromium: Browser) -> None:
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
        before = page.evaluate("() => document.querySelector('.tl-zoom-view').scrollLeft")
        page.mouse.move(640, 400)
        page.mouse.down()
        page.mouse.move(740, 400)
        page.mouse.up()
        moved = page.evaluate("() => document.querySelector('.tl-zoom-view').scrollLeft")
        assert moved == pytest.approx(before - 100, abs=2)
        page.keyboard.press("0")
        assert page.evaluate(WIDTH) == pytest.approx(small, rel=0.01)
        for name, grown in {"Larger": 1.4, "Smaller": 1.0, "Fit the window": 1.0}.items():
            page.get_by_role("button", name=name, exact=True).click()
            assert page.evaluate(WIDTH) == pytest.approx(grown * small, rel=0.01)
        page.locator(".tl-zoom-view").focus()
        if not axe.absent():
            assert axe.findings(page) == []
        page.keyboard.press("Escape")
        assert not page.locator(".tl-zoom").is_visible()
        page.locator("#fig-3-7 img").click()
        assert page.locator(".tl-zoom").is_visible()
        page.mouse.wheel(0, -400)
        page.wait_for_function(f"small => ({WIDTH})() > 1.5 * small", arg=small)
        assert opened.trouble == []


@needs_book
@pytest.mark.parametrize(
    ("name", "link", "says"),
    [
        ("glossary.html", "a[href$='#equation-eq-noisy-law']", r"Equation \(\d+\)"),
        ("intro.html", "a[href$='beam-arrays.html#fig-3-24']", r"Figure 3\.24"),
        ("how-to.html", "a[href$='#fig-3-8']", r"Figure 3\.8"),
        ("thesis-index.html", "a[href$='#errata-b2']", r"B2\. Angles of view"),
        ("glossary.html", "a[href$='#equation-eq-angle-of-view']", r"Equation"),
    ],
)
def test_a_link_tells_what_it_leads_to(chromium: Browser, name: str, link: str, says: str) -> None:
    with open_offline(chromium, BOOK / name) as opened:
        page = opened.page
        one = page.locator(f".bd-article {link}").first
        one.focus()
        preview = page.locator(".tl-preview")
        preview.wait_for()
        assert re.search(says, preview.inner_text())
        assert one.get_attribute("aria-describedby") == "tl-preview"
        if not axe.absent() and name == "how-to.html":
            assert axe.findings(page, "color-contrast", "aria-tooltip-name") == []
        page.keyboard.press("Escape")
        assert not preview.is_visible()
        one.hover()
        preview.wait_for()
        assert opened.trouble == []


@needs_book
def test_a_first_tap_shows_and_a_second_goes(chromium: Browser) -> None:
    with open_offline(chromium, BOOK / "how-to.html", width=390) as opened:
        page = opened.page
        link = page.locator(".bd-article a[href$='#fig-3-8']").first
        link.tap()
        page.locator(".tl-preview").wait_for()
        assert page.url.endswith("how-to.html")
        assert opened.sideways_px() <= 0
        link.tap()
        page.wait_for_url("**/beam-aperture.html#fig-3-8")
        assert opened.trouble == []


PANELS = """() => [...document.querySelectorAll('#fig-3-7 .tl-panel')].map((one) => {
    const { left, top, right, bottom } = one.getBoundingClientRect();
    return [left, top, right, bottom];
})"""


@needs_book
def test_on_a_phone_panels_stand_one_below_the_other(chromium: Browser) -> None:
    with open_offline(chromium, RESULTS, width=390) as opened:
        page = opened.page
        boxes = page.evaluate(PANELS)
        assert len(boxes) == 4
        for (_, _, _, bottom), (_, top, _, _) in pairwise(boxes):
            assert top >= bottom
        assert all(right - left > 240 for left, _, right, _ in boxes)
        whole = page.locator("#fig-3-7 .tl-grows").bounding_box()
        assert whole is not None
        assert whole["width"] <= 1
        page.locator("#fig-3-7 .tl-panel").nth(1).tap()
        assert page.locator(".tl-zoom").is_visible()
        page.keyboard.press("Escape")
        page.set_viewport_size({"width": 1000, "height": 800})
        assert page.locator("#fig-3-7 .tl-panel").first.is_hidden()
        whole = page.locator("#fig-3-7 .tl-grows").bounding_box()
        assert whole is not None
        assert whole["width"] > 500
        assert opened.trouble == []


@needs_book
def test_a_page_that_is_saved_alone_has_its_text_and_figures(
    chromium: Browser, tmp_path: Path
) -> None:
    """Saved by the browser as one file from where it is served, and opened when that is gone."""
    loaded = """() => [...document.querySelectorAll('.bd-article img')]
        .every((one) => one.complete && one.naturalWidth)"""
    with (
        server(BOOK) as address,
        open_offline(chromium, RESULTS, served=f"{address}/executed/beam-aperture.html") as opened,
    ):
        opened.page.wait_for_function(loaded, timeout=120_000)
        text = opened.page.locator(".bd-article p").all_text_contents()
        session = opened.page.context.new_cdp_session(opened.page)
        saved = session.send("Page.captureSnapshot", {"format": "mhtml"})["data"]
        session.detach()
    file = tmp_path / "saved.mhtml"
    file.write_bytes(saved.encode())
    with open_offline(chromium, file, fresh=True) as opened:
        opened.page.wait_for_function(loaded)
        assert opened.page.locator(".bd-article img").count() > 10
        assert opened.page.locator(".bd-article p").all_text_contents() == text


@needs_book
def test_a_page_that_is_copied_alone_has_its_text(chromium: Browser, tmp_path: Path) -> None:
    """Without styles, scripts and pictures: what figures show is told in words."""
    file = tmp_path / "copied.html"
    file.write_bytes(RESULTS.read_bytes())
    with open_offline(chromium, file, fresh=True) as opened:
        said = opened.page.locator(".bd-article").inner_text()
        assert "Mean error" in said
        assert "Figure 3.7 of the thesis" in said
        assert "The viewer that stands here needs the whole book." in said
        alt = opened.page.locator("#fig-3-7 img").get_attribute("alt")
        assert alt is not None
        assert "deflection shape" in alt


@needs_book
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_drawings_follow_the_page(chromium: Browser, dark: bool) -> None:
    """Also against the browser's own wish: the page's switch decides."""
    with open_offline(chromium, RESULTS, dark=not dark) as opened:
        page = opened.page
        switch = page.locator(".theme-switch-button")
        for _ in range(3):
            if page.evaluate("() => document.documentElement.dataset.theme") == (
                "dark" if dark else "light"
            ):
                break
            switch.click()
        image = page.locator("#fig-3-7 img")
        image.scroll_into_view_if_needed()
        page.wait_for_timeout(300)
        told = image.evaluate(CORNER)
        assert told == ["rgba(0, 0, 0, 0)", "none", "dark" if dark else "light"]
        shot = Image.open(BytesIO(image.screenshot())).convert("L")
        ground = shot.getpixel((3, 3))
        assert (ground < 40) if dark else (ground > 240)
        extremes = shot.getextrema()
        assert (extremes[1] > 180) if dark else (extremes[0] < 80)  # its words are to be seen


@needs_book
def test_pages_figures_and_cubes_are_cited_with_their_edition(chromium: Browser) -> None:
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
        cube = page.locator(".tl-cites option").last
        page.locator(".tl-cites select").select_option(label=cube.inner_text())
        assert "Cube beam-aperture.nc" in said.first.inner_text()
        if not axe.absent():
            assert axe.findings(page) == []
        page.keyboard.press("Escape")
        assert not page.locator(".tl-cites").is_visible()
        page.evaluate("location.hash = 'fig-3-8'")
        page.locator("button.tl-cite").click()
        assert "Figure 3.8 (The beam: aperture)" in said.first.inner_text()
        assert opened.trouble == []


@needs_book
def test_each_page_describes_itself() -> None:
    for name in [name for name in PAGES if name != "index.html"]:
        text = (BOOK / name).read_text(encoding="utf-8")
        head = text[: text.index("</head>")]
        assert re.search(r'<meta name="description" content="[^"]+"', head), name
        card = re.search(r'<meta property="og:image" content="([^"]+)"', head)
        assert card, name
        assert ((BOOK / name).parent / card[1]).is_file(), name
        icon = re.search(r'<link rel="icon" href="([^"?]+)', head)
        assert icon, name
        assert ((BOOK / name).parent / icon[1]).is_file(), name
        assert head.count('name="viewport"') == 1, name


@needs_book
def test_no_picture_stands_on_two_pages() -> None:
    """But for the index, which is home, and what the theme shows on each."""
    pages: dict[str, set[str]] = {}
    for path in BOOK.rglob("*.html"):
        name = path.relative_to(BOOK).as_posix()
        if name != "index.html" and not name.startswith(("_", "sample-report")):
            for image in re.findall(r'src="[^"]*_images/([^"]+)"', path.read_text("utf-8")):
                pages.setdefault(image, set()).add(name)
    assert len(pages) > 100
    assert {image: found for image, found in pages.items() if len(found) > 1} == {}
