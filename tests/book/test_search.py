"""The search of the rendered book, from its folder, and what it looks through."""

import axe
from book.test_book_pages import BOOK, needs_book
from browser import open_offline

TITLES = ".tl-found-title"


def ask(page, words):
    """Titles of what is found for some words."""
    status = page.locator(".tl-results-status")
    page.locator("#pst-search-dialog input").fill("")
    page.wait_for_function("() => !document.querySelector('.tl-results-status').textContent")
    page.locator("#pst-search-dialog input").fill(words)
    status.filter(has_text=r".").wait_for()
    return page.locator(TITLES).all_inner_texts()


FIRST = {
    "3.24": "Figure 3.24",
    "figure 3.24": "Figure 3.24",
    "fig. 3.24": "Figure 3.24",
    "eq. 3.19": "Equation 3.19",
    "Table 4.4": "Table 4.4",
    "hemisphere_cameras": "vision.pinhole.hemisphere_cameras",
    "ch3-1-m1-mean-first": "Claim ch3-1-m1-mean-first",
    "beam distance": "The beam: distance",
    "law of rounding": "The law of rounding",
    "analytic centre": "analytic centre",
}


@needs_book
def test_what_is_meant_comes_first_or_nearly(chromium):
    with open_offline(chromium, BOOK / "executed" / "beam-aperture.html") as opened:
        page = opened.page
        page.keyboard.press("Control+k")
        first = {words: ask(page, words)[:3] for words in FIRST}
        wrong = {words: first[words] for words in FIRST if FIRST[words] not in first[words]}
        assert wrong == {}


@needs_book
def test_endings_typos_and_words_too_many_are_no_hindrance(chromium):
    typed = {
        "roundign": "rounding", "roundinng": "rounding", "triangulating": "triangulation",
        "apertures": "aperture",
    }  # fmt: skip
    with open_offline(chromium, BOOK / "intro.html") as opened:
        page = opened.page
        page.keyboard.press("Control+k")
        for words, meant in typed.items():
            found = ask(page, words)
            assert set(found[:5]) & set(ask(page, meant)[:10]), words
            assert page.locator(".tl-found mark").count(), words
        assert ask(page, "qwertz uiop") == []
        assert page.locator(".tl-results-status").inner_text() == "Nothing found."
        ask(page, "<img src=x onerror=alert(1)>")  # is words
        assert page.locator("#pst-search-dialog :is(script, img)").count() == 0
        assert "Figure 3.24" in ask(page, "figure 3.24 qwertz")[:3]
        assert page.locator(".tl-results-status").inner_text().startswith("No place has all")


@needs_book
def test_it_is_used_by_keyboard_and_loads_when_opened(chromium):
    with open_offline(chromium, BOOK / "executed" / "beam-aperture.html", fresh=True) as opened:
        page = opened.page
        loaded = "() => 'thesisEntries' in window || 'MiniSearch' in window"
        assert not page.evaluate(loaded)
        page.keyboard.press("Control+k")
        page.wait_for_function(loaded)
        page.keyboard.type("figure 3.24")
        page.locator(".tl-found").first.wait_for()
        page.keyboard.press("ArrowDown")
        assert page.evaluate("() => document.activeElement.className") == "tl-found"
        assert axe.findings(page) == []
        page.keyboard.press("Escape")
        assert not page.locator("#pst-search-dialog").is_visible()
        page.keyboard.press("Control+k")
        page.keyboard.type("figure 3.24")
        page.keyboard.press("Enter")
        page.wait_for_url("**/beam-arrays.html#fig-3-24")
