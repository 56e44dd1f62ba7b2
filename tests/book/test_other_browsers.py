"""The book in Firefox and in WebKit: nothing asked of a network, no message, Chromium's numbers."""

from pathlib import Path

import pytest
from book.test_book_pages import BOOK, PAGES, needs_book, said_by_us
from browser import FLAGS, find_browser, open_offline
from playwright.sync_api import sync_playwright

pytestmark = pytest.mark.nightly
UNSETTLED = """async () => {
    for (const image of document.querySelectorAll('.bd-article img')) {
      image.loading = 'eager';
      await image.decode();
    }
    return document.querySelectorAll('.math').length
      - document.querySelectorAll('.math mjx-container svg').length; }"""
LAYOUTS = [
    "s=beam&m=3&w=320&f=24&d=500&c=20,30;-60,40",
    "s=beam&m=1&t=4a-6",
    "s=plate&m=2&t=4d-8",
    "s=plate&m=3&w=1280&f=35&d=700&r=known&c=45,20;-45,20;135,20;-135,20",
]
NUMBERS = """async () => {
    const busy = () => document.querySelector('.tl-ex-status')?.getAttribute('aria-busy');
    while (busy() !== 'false') await new Promise((done) => setTimeout(done, 50));
    return [...document.querySelectorAll('.tl-ex-status, .tl-explorer td, .tl-ex-facts')]
      .map((one) => one.textContent); }"""


@pytest.fixture(scope="module")
def playwright():
    with sync_playwright() as running:
        yield running


@pytest.fixture(scope="module", params=["firefox", "webkit"])
def other(request, playwright):
    kind = getattr(playwright, request.param)
    if not Path(kind.executable_path).exists():
        pytest.skip(f"no browser: `playwright install {request.param}`")
    running = kind.launch()
    yield running
    running.close()


@needs_book
@pytest.mark.parametrize("name", [name for name in PAGES if name != "index.html"])
def test_pages_ask_for_nothing_and_say_nothing(other, name):
    with open_offline(other, BOOK / name) as opened:
        assert opened.page.evaluate(UNSETTLED) <= 0  # equations are typeset
        assert said_by_us(opened) == []


@needs_book
def test_the_explorer_has_the_same_numbers(playwright, other):
    chromium = playwright.chromium.launch(executable_path=find_browser(), args=FLAGS)
    for layout in LAYOUTS:
        numbers = []
        for browser in (chromium, other):
            with open_offline(browser, BOOK / "explorer.html", query=layout) as opened:
                numbers.append(opened.page.evaluate(NUMBERS))
        assert len(numbers[0]) > 10
        assert numbers[1] == numbers[0]
    chromium.close()
