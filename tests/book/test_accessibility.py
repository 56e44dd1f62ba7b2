"""Names, roles, alternatives and contrast as axe-core sees them, light and dark.

The pages of the book are held against it where they are opened: in ``test_book_pages``.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="the browser tests need the playwright package")

import axe
from book.test_book_pages import notebook  # noqa: F401
from browser import browser, find_browser
from playwright.sync_api import Page

from thesis_lib.book import explorer
from thesis_lib.web import page as web_page
from thesis_lib.web.page import index_page

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="no Chromium or Chrome on this machine"
)


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    """A tab that all tests share; skipped where the checker cannot be installed."""
    if axe.absent():
        pytest.skip(axe.absent())
    with browser() as running:
        context = running.new_context(viewport={"width": 1280, "height": 900}, offline=True)
        context.set_default_timeout(120_000)
        yield context.new_page()


def opened(page: Page, path: Path) -> Page:
    """The tab with a file in it, its equations included."""
    page.goto(path.resolve().as_uri())
    page.evaluate("() => window.MathJax?.startup?.promise")
    return page


@pytest.mark.slow
def test_nothing_serious_on_a_page_of_a_run(
    page: Page,
    notebook: Path,  # noqa: F811
) -> None:
    html = notebook.with_suffix(".html")
    html.write_text(web_page.export_notebook(notebook, "Run"), encoding="utf-8")
    assert axe.light_and_dark(opened(page, html)) == []
    html.write_text(index_page("Runs", [("A", "a.html")]), encoding="utf-8")
    assert axe.light_and_dark(opened(page, html)) == []


@pytest.mark.slow
def test_nothing_serious_in_the_form(page: Page, tmp_path: Path) -> None:
    """Filled, refused, and with every kind of control."""
    html = tmp_path / "form.html"
    head = "<!doctype html><html lang='en'><meta charset='utf-8'><title>Form</title>"
    html.write_text(
        f"{head}<main><h1>Form</h1>{explorer.rerun_form_html()}</main>", encoding="utf-8"
    )
    for dark in (False, True):
        page.emulate_media(color_scheme="dark" if dark else "light")
        for query in ("set=beam-arrays&modes=1", "set=lab-plate&frames=x", "set=ch3&seed=-1"):
            page.goto(f"{html.as_uri()}?{query}")
            page.evaluate(axe.PREPARE)
            assert axe.findings(page) == []


def test_the_checker_sees_what_is_wrong(page: Page, tmp_path: Path) -> None:
    html = tmp_path / "wrong.html"
    html.write_text(
        "<!doctype html><html lang='en'><title>Wrong</title><main><h1>Wrong</h1>"
        "<img src='data:,'><button></button><input><p style='color: #999'>Too pale.</p>"
        "<details><summary><i></i></summary>More</details></main>",
        encoding="utf-8",
    )
    page.emulate_media(color_scheme="light")
    page.goto(html.as_uri())
    found = [line.split(":")[0] for line in axe.findings(page)]
    assert sorted(found) == ["button-name", "color-contrast", "image-alt", "label", "summary-name"]
