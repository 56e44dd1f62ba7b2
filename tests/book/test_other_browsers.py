"""The book in Firefox and in WebKit: nothing asked of a network, no message, Chromium's numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="the browser tests need the playwright package")

import others
from book.test_book_pages import BOOK, PAGES, needs_book
from browser import open_offline
from others import Other
from playwright.sync_api import Browser

pytestmark = pytest.mark.nightly
READ = [name for name in PAGES if name != "index.html"]
BAD = """<!doctype html><html><head></head><title>Bad</title><img src="http://192.0.2.1/x.png">
<script>console.warn("loud"); undefined_function();</script></html>"""
SETTLED = """await window.MathJax?.startup?.promise;
    for (const image of document.querySelectorAll('.bd-article img')) {
      image.loading = 'eager';
      await image.decode();
    }
    await new Promise((done) => setTimeout(done, 300));
    return document.querySelectorAll('.math').length
      - document.querySelectorAll('.math mjx-container svg').length;"""
LAYOUTS = [
    "s=beam&m=3&w=320&f=24&d=500&c=20,30;-60,40",
    "s=beam&m=1&t=4a-6",
    "s=plate&m=2&t=4d-8",
    "s=plate&m=3&w=1280&f=35&d=700&r=known&c=45,20;-45,20;135,20;-135,20",
]
NUMBERS = """const busy = () => document.querySelector('.tl-ex-status')?.getAttribute('aria-busy');
    while (busy() !== 'false') await new Promise((done) => setTimeout(done, 50));
    return [...document.querySelectorAll('.tl-ex-status, .tl-explorer td, .tl-ex-facts')]
      .map((one) => one.textContent);"""


@pytest.fixture(scope="module", params=["firefox", "webkit"])
def other(request: pytest.FixtureRequest) -> Iterator[Other]:
    if others.absent(request.param):
        pytest.skip(others.absent(request.param))
    with getattr(others, request.param)() as running:
        yield running


@pytest.fixture(scope="module")
def book(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The book with pages that note what stands in the console."""
    folder = tmp_path_factory.mktemp("noting")
    others.noting(BOOK, folder, READ)
    return folder


def test_what_is_wrong_with_a_page_is_told(other: Other, tmp_path: Path) -> None:
    (tmp_path / "bad.html").write_text(BAD, encoding="utf-8")
    others.noting(tmp_path, tmp_path / "noting", ["bad.html"])
    other.open((tmp_path / "noting" / "bad.html").as_uri())
    told = "\n".join(other.told())
    assert "console: loud" in told
    assert re.search("undefined_function|Script error", told)  # WebKit tells no more of a file
    assert "192.0.2.1/x.png" in told


@needs_book
@pytest.mark.parametrize("name", READ)
def test_pages_ask_for_nothing_and_say_nothing(other: Other, book: Path, name: str) -> None:
    other.open((book / name).as_uri())
    assert other.evaluate(SETTLED) <= 0  # equations are typeset
    assert other.told() == []


@needs_book
@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_explorer_has_the_same_numbers(
    other: Other, book: Path, chromium: Browser, layout: str
) -> None:
    with open_offline(chromium, BOOK / "explorer.html", query=layout) as opened:
        expected = opened.page.evaluate(f"async () => {{ {NUMBERS} }}")
    assert len(expected) > 10
    other.open(f"{(book / 'explorer.html').as_uri()}?{layout}")
    assert other.evaluate(NUMBERS) == expected
    assert other.told() == []
