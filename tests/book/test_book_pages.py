"""Every page of the rendered book, opened from its folder without a network."""

import base64
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeVar

import nbformat
import pytest

pytest.importorskip("playwright", reason="the browser tests need the playwright package")

import axe
from browser import Opened, browser, find_browser, open_offline, server
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from playwright.sync_api import Browser, Page, TimeoutError

from thesis_lib.book import rendering
from thesis_lib.book.pieces import manifest as recordings
from thesis_lib.web import page as web_page
from thesis_lib.web.page import BookError, index_page

BOOK = Path(__file__).parents[2] / "build" / "html"
# Without a report as users get it, which is no page: test_sample.py looks at it.
PAGES = sorted(
    path.relative_to(BOOK).as_posix()
    for path in {*BOOK.rglob("*.html")} - {BOOK / recordings.SAMPLE_PAGE}
    if not path.relative_to(BOOK).as_posix().startswith(("_static/", "_sources/"))
)
SIZES = {name: (BOOK / name).stat().st_size for name in PAGES}
ALIKE = {
    name
    for kind in ("api/", "executed/beam-", "executed/plate-", "executed/shape-", "executed/sound-")
    for name in sorted((one for one in PAGES if one.startswith(kind)), key=SIZES.__getitem__)[:-2]
}
"""Pages that are made as the two longest of their kind are: those alone are checked by axe, the
others at night; all else is checked on every page."""
LONGEST = sorted(PAGES, key=SIZES.__getitem__)[-5:]

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="no Chromium or Chrome on this machine"
)


T = TypeVar("T")


def needs_book(test: T) -> T:
    """Mark a test, or a class of them, that opens the rendered book."""
    rendered = pytest.mark.skipif(not PAGES, reason="no book in build/html: render it first")
    return pytest.mark.book(rendered(test))


PAINT_MS = 500
PICTURES = """() => [...document.querySelectorAll('.cell_output svg, .cell_output canvas')]
    .map(one => one.tagName === 'CANVAS' ? one.toDataURL() : one.innerHTML).join()
    + (document.querySelector('.tl-ledger-count')?.textContent ?? '')"""
FACTS = """async () => {
    const all = (css, of) => [...document.querySelectorAll(css)].map(of);
    const images = [...document.querySelectorAll('.bd-article img:not(.tl-panel img)')];
    images.forEach(image => { image.loading = 'eager'; });
    await Promise.allSettled(images.map(image => image.decode()));
    return {
        images: images.map(image => [image.src, image.naturalWidth, image.alt]),
        links: all('a[href]', link => link.href),
        math: all('.math', one => one.querySelectorAll('mjx-container svg').length),
        mistakes: all('mjx-merror, [data-mjx-error]', one => one.textContent),
        text: document.body.innerText,
        paint_ms: performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN,
    };
}"""
FITS = """async () => {
    const seen = { opacityProperty: true, visibilityProperty: true };
    const all = (css) => [...document.querySelectorAll(css)]
      .filter((one) => one.checkVisibility(seen));
    for (const one of document.querySelectorAll('.bd-article details')) one.open = true;
    for (let i = 0; i < 3; i++) await new Promise((done) => requestAnimationFrame(done));
    const boxes = all('.bd-article :is(pre, table):not(.tl-fragment table)')
      .map((one) => (one.tagName === 'PRE' ? one : one.parentElement))
      .filter((one) => one.scrollWidth > one.clientWidth + 1);
    const told = (one) => `${one.closest('section[id]')?.id} ${one.tagName} ${one.className} `
      + (one.ariaLabel ?? one.innerText).slice(0, 40);
    const box = (one) => one.getBoundingClientRect();
    const targets = all(`a[href], button, select, summary, textarea, [role=button],
      input:not([type=hidden], label input), label:has(input)`)
      .filter((one) => getComputedStyle(one).display !== 'inline')
      .map((one) => [one, Math.min(box(one).width, box(one).height)])
      .filter(([, least]) => least > 1 && least < 23.9) // else it is its parts that are tapped
      .map(([one]) => one);
    return {
      cut: boxes.filter((one) => !one.matches('.tl-scrolls')).map(told),
      scrolling: boxes.filter((one) => one.matches('.tl-scrolls')).map(told),
      small: targets.map(told),
    };
}"""
SAME = (".bd-sidebar-primary", ".bd-header-article", ".bd-footer")  # on every page


@dataclass
class Visit:
    """What one page was seen to hold and to do."""

    trouble: list[str]
    sideways_px: int
    images: list[tuple[str, int, str]]
    links: list[str]
    math: list[int]
    mistakes: list[str]
    text: str
    paint_ms: float
    cut: list[str]  # tables and code that do not fit and do not say so
    scrolling: list[str]  # tables that say that they scroll
    small: list[str]  # what is to be clicked or tapped, too small for a finger
    answers: bool | None = None  # whether a choice changes a picture; None without a choice
    inaccessible: tuple[str, ...] = ()


def said_by_us(opened: Opened) -> list[str]:
    """Messages in the console but those of the theme and its extensions."""
    return [one for one in opened.said if not re.match(r"console: \[(PST|togglebutton)\]", one)]


def look(opened: Opened) -> Visit:
    opened.page.mouse.wheel(0, 20_000)
    return Visit(
        sideways_px=opened.sideways_px(),
        trouble=[*opened.trouble, *said_by_us(opened)],
        **opened.page.evaluate(FACTS),
        **opened.page.evaluate(FITS),
    )


def choose(page: Page) -> bool | None:
    """Take another choice in the first widget that has one: whether its picture changes."""
    lists = page.locator(".cell_output select:has(option:nth-of-type(2))")
    buttons = page.locator(".cell_output input[type=radio]:not(:checked)")
    before = page.evaluate(PICTURES)
    if lists.count():
        chosen = lists.first.evaluate("one => one.selectedIndex")
        lists.first.select_option(index=1 if chosen == 0 else 0)
    elif buttons.count():
        buttons.first.check(force=True)
    else:
        return None
    try:
        page.wait_for_function(f"before => ({PICTURES})() !== before", arg=before, timeout=5_000)
    except TimeoutError:
        return False
    return True


def use(opened: Opened, name: str) -> Visit:
    """Look at a page, use its widget, and let the checker of accessibility have it at last."""
    seen = look(opened)
    if name.startswith("executed/"):
        seen.answers = choose(opened.page)
    seen.trouble = [*opened.trouble, *said_by_us(opened)]
    if name not in {"index.html", *ALIKE} and not axe.absent():  # the former is intro
        seen.inaccessible = amiss(opened, name)
    return seen


def amiss(opened: Opened, name: str) -> tuple[str, ...]:
    """What axe finds on a page, in the light and in the dark."""
    without = () if name == "intro.html" else SAME
    return tuple(axe.light_and_dark(opened.page, theme=True, without=without))


@pytest.fixture(scope="module")
def running() -> Iterator[Browser]:
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Where a server on this machine has the book."""
    with server(BOOK) as one:
        yield one


@pytest.fixture(scope="module")
def visit(running: Browser, address: str) -> Callable[[str, bool], Visit]:
    """Open a page of the book once from its folder, and once on a phone in the dark over HTTP."""

    @cache
    def once(name: str, phone: bool) -> Visit:
        if phone:
            where = {"width": 390, "dark": True, "served": f"{address}/{name}"}
            with open_offline(running, BOOK / name, **where) as opened:
                seen = look(opened)
                opened.page.set_viewport_size({"width": 320, "height": 700})
                opened.page.wait_for_timeout(50)
                seen.sideways_px = max(seen.sideways_px, opened.sideways_px())
                return seen
        with open_offline(running, BOOK / name) as opened:
            return use(opened, name)

    return once


@needs_book
@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("phone", [False, True], ids=["screen, folder", "phone, http"])
def test_page_is_whole(visit: Callable[[str, bool], Visit], name: str, phone: bool) -> None:
    """It loads nothing from outside, fits, is typeset, and its pictures are there and described."""
    seen = visit(name, phone)
    assert seen.trouble == []
    assert seen.sideways_px <= 0
    assert seen.cut == []
    assert phone or seen.scrolling == []
    assert seen.small == []
    assert seen.answers is not False  # a choice in a widget changes its picture
    assert all(seen.math)
    assert seen.mistakes == []
    for source, width, alt in seen.images:
        assert width > 0, source
        assert alt.strip(), source
        assert not re.search(r"\.(svg|png)$", alt), source


LONG_PATH = """() => { document.querySelector('article p').innerHTML =
    `<code class="docutils"><span class="pre">${'src/thesis_lib/'.repeat(9)}</span></code>`; }"""


@needs_book
def test_a_long_path_in_prose_breaks_on_a_phone(running: Browser) -> None:
    with open_offline(running, BOOK / "developers.html", width=390) as opened:
        opened.page.evaluate(LONG_PATH)
        assert opened.sideways_px() <= 0


@needs_book
@pytest.mark.parametrize("name", PAGES)
def test_first_paint_within_half_a_second(
    running: Browser, visit: Callable[[str, bool], Visit], name: str
) -> None:
    """Of the longest also in a window that has seen no page before."""
    tried = [] if name in LONGEST else [visit(name, False).paint_ms]
    waiting = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))  # jobs for each processor
    while not tried or (min(tried) > PAINT_MS * waiting and len(tried) < 8):  # it may be busy
        with open_offline(running, BOOK / name, fresh=True) as opened:
            tried.append(look(opened).paint_ms)
    assert min(tried) <= PAINT_MS * waiting, tried


@needs_book
@pytest.mark.parametrize("name", PAGES)
def test_page_refers_to_what_is_there(visit: Callable[[str, bool], Visit], name: str) -> None:
    """Its links lead to files and anchors, its source loads nothing from elsewhere."""
    seen = visit(name, False)
    assert re.findall(r"\{(?:numref|eq|ref|doc|cite\S*)\}`", seen.text) == []
    for link in seen.links:
        if link.startswith("file:"):
            address, _, anchor = link.removeprefix("file://").partition("#")
            target = Path(address.partition("?")[0])
            assert target.is_relative_to(BOOK), link
            assert target.is_file(), link
            if anchor and target.suffix == ".html":
                assert anchor in anchors(target), link
    html = (BOOK / name).read_text(encoding="utf-8")
    html = re.sub(r"<script(?![^>]*\bsrc=)[^>]*>.*?</script>", "", html, flags=re.DOTALL)
    loads = r"""<(?:script|img|iframe|source|link)\b[^>]*?(?:src|href)=["']((?:https?:)?//[^"']+)"""
    assert re.findall(loads, html) == []


@cache
def anchors(page: Path) -> set[str]:
    """The names of all places of a page; those of claims are made by the ledger's script."""
    text = page.read_text(encoding="utf-8")
    claims = re.findall(r'"id":"([\w-]+)","kind"', text) if page.stem == "claims" else ()
    return {*re.findall(r'\bid="([^"]*)"', text), *(f"claim-{one}" for one in claims)}


@needs_book
def test_the_book_with_its_downloads_is_small() -> None:
    assert sum(file.stat().st_size for file in BOOK.rglob("*") if file.is_file()) < 85e6


@needs_book
@pytest.mark.parametrize("name", [name for name in PAGES if name not in {"index.html", *ALIKE}])
def test_nothing_is_amiss_for_those_who_cannot_see_well(
    visit: Callable[[str, bool], Visit], name: str
) -> None:
    if axe.absent():
        pytest.skip(axe.absent())
    assert visit(name, False).inaccessible == ()


@needs_book
@pytest.mark.nightly
@pytest.mark.parametrize("name", sorted(ALIKE))
def test_nothing_amiss_on_the_other_pages_of_a_kind(running: Browser, name: str) -> None:
    if axe.absent():
        pytest.skip(axe.absent())
    with open_offline(running, BOOK / name) as opened:
        assert amiss(opened, name) == ()


@needs_book
def test_tabs_tell_pages_apart() -> None:
    texts = [(BOOK / name).read_text(encoding="utf-8") for name in PAGES if name != "index.html"]
    titles = [re.findall(r"<title>(.*?)</title>", text, re.DOTALL)[0] for text in texts]
    assert len(set(titles)) == len(titles)


@needs_book
def test_the_ledger_begins_with_its_filters_also_on_a_phone(running: Browser) -> None:
    with open_offline(running, BOOK / "executed" / "claims.html", width=390, height=844) as opened:
        box = opened.page.locator(".tl-ledger-controls").bounding_box()
        assert box is not None
        assert box["y"] < 2 * 844
        assert (
            opened.page.evaluate("document.documentElement.scrollHeight") < 15_500
        )  # with reasons


@needs_book
@pytest.mark.parametrize("width", [390, 320])
def test_the_cameras_of_a_plan_fit_on_a_phone_or_say_that_they_scroll(
    running: Browser, width: int
) -> None:
    beyond = "one => one.scrollWidth - one.clientWidth"
    said = "one => getComputedStyle(one, '::before').content"
    with open_offline(running, BOOK / "planner.html", width=width) as opened:
        for box in opened.page.locator(".tl-layouts .tl-scroll").all():
            assert box.evaluate(beyond) <= 1 or "scrolls" in box.evaluate(said)


@needs_book
def test_home_answers_on_one_screen_and_ends_on_two(running: Browser) -> None:
    with open_offline(running, BOOK / "intro.html", height=800) as opened:
        page = opened.page
        below = {".bd-article h1": 800, ".bd-article ul": 800, ".tl-explorer": 1600}
        for css, limit in {**below, ".sd-container-fluid >> nth=-1": 1600}.items():
            box = page.locator(css).first.bounding_box()
            assert box is not None
            assert box["y"] >= 0, css
            assert box["y"] + box["height"] <= limit, css
        before = page.locator(".tl-ex-status").inner_text()
        page.locator(".tl-explorer .tl-camera").first.focus()
        for _ in range(10):
            page.keyboard.press("ArrowUp")
        page.wait_for_function(
            "before => document.querySelector('.tl-ex-status').innerText !== before", arg=before
        )
        page.locator(".tl-ex-export a").click()
        page.wait_for_load_state("load")
        assert "/explorer.html?" in page.url
        assert page.locator(".tl-ex-cameras input").count() == 2 * 8
        assert opened.trouble == []


SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="900" height="9"><path d="M0 0h900"/></svg>'
WIDGET = """<select aria-label="x"><option>1</option><option>2</option></select><b id="w">?</b>
<script type="module">
const list = document.querySelector("select"), show = () => { w.textContent = "=" + list.value; };
list.addEventListener("change", show); show();
</script>"""


@pytest.fixture
def notebook(tmp_path: Path) -> Path:
    """A small executed notebook with one of everything a page shows."""
    figure = {"figure": {"name": "fig-a", "caption": "*Error* of $w$."}, "image": {"alt": 'a "b"'}}
    view = {"application/vnd.jupyter.widget-view+json": {"model_id": "m"}, "text/html": WIDGET}
    state = {"application/vnd.jupyter.widget-state+json": {"state": {"m": {"secret": 1}}}}
    cells = [
        new_markdown_cell("# Head\n\nSee {eq}`eq-a`, [x](some-label).\n\n$$\na^2\n$$ (eq-a)"),
        new_code_cell("n = 12345  # how many", metadata={"tags": ["injected-parameters"]}),
        new_code_cell("hidden_word()", metadata={"tags": ["remove-input"]}),
        new_code_cell(
            "print(1)", outputs=[new_output("stream", name="stdout", text="<1 & 2>" * 50)]
        ),
        new_code_cell(
            "draw()",
            metadata={"mystnb": figure},
            outputs=[new_output("display_data", data={"image/svg+xml": SVG})],
        ),
        new_code_cell("explore()", outputs=[new_output("display_data", data=view)]),
    ]
    path = tmp_path / "run.ipynb"
    nbformat.write(new_notebook(cells=cells, metadata={"widgets": state}), path)
    return path


@pytest.mark.parametrize("width", [1280, 390])
def test_self_contained_page_works_alone(running: Browser, notebook: Path, width: int) -> None:
    html = notebook.with_suffix(".html")
    html.write_text(web_page.export_notebook(notebook, "<i>R</i> & co"), encoding="utf-8")
    with open_offline(running, html, width=width) as opened:
        page = opened.page
        assert page.title() == "<i>R</i> & co"
        assert opened.sideways_px() <= 0
        assert page.locator("figure#fig-a figcaption").inner_text().startswith("Error")
        assert page.locator("figure#fig-a img").get_attribute("alt") == 'a "b"'
        assert page.locator("a[href='#equation-eq-a']").inner_text() == "(1)"
        assert page.locator("a").count() == 1
        assert page.locator("#w").inner_text() == "=1"
        page.locator("select").select_option("2")
        assert page.locator("#w").inner_text() == "=2"
        assert "<1 & 2>" in page.locator("pre").nth(2).inner_text()
        assert opened.trouble == []


def test_self_contained_page_keeps_the_picture_and_drops_the_rest(notebook: Path) -> None:
    text = web_page.export_notebook(notebook, "run")
    assert base64.b64encode(SVG.encode()).decode() in text
    assert "hidden_word" not in text
    assert "secret" not in text


def test_page_without_equations_is_small(tmp_path: Path) -> None:
    path = tmp_path / "plain.ipynb"
    nbformat.write(new_notebook(cells=[new_markdown_cell("# Plain, costs 5 $")]), path)
    assert len(web_page.export_notebook(path, "plain")) < 20_000


def test_index_page_escapes_and_links(running: Browser, tmp_path: Path) -> None:
    path = tmp_path / "index.html"
    path.write_text(index_page("<b>", [("a <x>", "a%20b.html"), ("c", 'd".html')]))
    with open_offline(running, path, width=390) as opened:
        links = opened.page.locator("a")
        assert links.all_inner_texts() == ["a <x>", "c"]
        assert links.nth(1).get_attribute("href") == 'd".html'
        assert opened.page.title() == "<b>"
        assert opened.trouble == []


def test_unreadable_notebook_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "bad.ipynb").write_text("{")
    for name in ("bad.ipynb", "none.ipynb"):
        with pytest.raises(BookError, match=name) as caught:
            web_page.export_notebook(tmp_path / name, "x")
        assert "\n" not in str(caught.value)


def test_missing_lock_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BookError, match=r"package-lock\.json"):
        rendering.install_assets(tmp_path)
