"""Every page of the rendered book, opened from its folder without a network."""

import base64
import os
import re
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

import nbformat
import pytest

pytest.importorskip("playwright", reason="the browser tests need the playwright package")

import axe
from browser import open_offline, server, write_page
from lxml.html import document_fromstring
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from playwright.sync_api import TimeoutError

from thesis_lib.book import explorer
from thesis_lib.book.pieces import manifest as recordings
from thesis_lib.web import page as web_page

BOOK = Path(__file__).parents[2] / "build" / "html"
# Without a report as users get it, which is no page: test_sample.py looks at it.
PAGES = sorted(
    path.relative_to(BOOK).as_posix()
    for path in {*BOOK.rglob("*.html")} - {BOOK / recordings.SAMPLE_PAGE}
    if not path.relative_to(BOOK).as_posix().startswith(("_static/", "_sources/"))
)
SIZES = {name: (BOOK / name).stat().st_size for name in PAGES}
KINDS = ("api/", "executed/beam-", "executed/lab-", "executed/plate-", "executed/shape-",
         "executed/sound-")  # fmt: skip
ALIKE = {
    name
    for kind in KINDS
    for name in sorted((one for one in PAGES if one.startswith(kind)), key=SIZES.__getitem__)[:-1]
}
"""Pages that are made as the longest of their kind is: they are opened at night."""
LONGEST = sorted(PAGES, key=SIZES.__getitem__)[-3:]
# Each has something that no other page has: what is seen here is on the others, too.
ONE_OF_EACH = {
    "api/laboratory.html", "executed/beam-resolution.html", "executed/claims.html",
    "executed/plate-resolution.html", "executed/sound-resolution.html", "intro.html",
    "planner.html", "recordings-warnings.html", "rerun.html", "rounding.html",
}  # fmt: skip


def needs_book(test):
    """Mark a test, or a class of them, that opens the rendered book."""
    rendered = pytest.mark.skipif(not PAGES, reason="no book in build/html: render it first")
    return pytest.mark.book(rendered(test))


def by_night(at_night):
    """All pages but the first, which is home; some of them at night."""
    names = [name for name in PAGES if name != "index.html"]
    return [pytest.param(n, marks=[pytest.mark.nightly] * (n in at_night)) for n in names]


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
        math: all('.math', one => one.querySelectorAll('mjx-container svg').length),
        mistakes: all('mjx-merror, [data-mjx-error]', one => one.textContent),
        text: document.body.innerText,
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
      cut: boxes.filter((one) => innerWidth > 1000 || !one.matches('.tl-scrolls')).map(told),
      small: targets.map(told),
    };
}"""
SAME = (".bd-sidebar-primary", ".bd-header-article", ".bd-footer")  # on every page


def said_by_us(opened):
    """Messages in the console but those of the theme and its extensions."""
    return [one for one in opened.said if not re.match(r"console: \[(PST|togglebutton)\]", one)]


def assert_it_fits(opened, *widths):
    """That nothing sticks out, is too small for a finger, or is cut: on a phone tables scroll."""
    for width in widths:
        opened.page.set_viewport_size({"width": width, "height": 900})
        assert opened.page.evaluate(FITS) == {"cut": [], "small": []}, width
        assert opened.sideways_px() <= 0, width


def choose(page):
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
        return True
    try:
        page.wait_for_function(f"before => ({PICTURES})() !== before", arg=before, timeout=5_000)
    except TimeoutError:
        return False
    return True


@pytest.fixture(scope="module")
def address():
    with server(BOOK) as one:
        yield one


@needs_book
@pytest.mark.parametrize("name", by_night(ALIKE))
def test_page_is_whole(chromium, name):
    """It loads nothing from outside, fits, is typeset, and its pictures are there and described."""
    with open_offline(chromium, BOOK / name) as opened:
        opened.page.mouse.wheel(0, 20_000)
        seen = opened.page.evaluate(FACTS)
        assert all(seen["math"])
        assert seen["mistakes"] == []
        assert re.findall(r"\{(?:numref|eq|ref|doc|cite\S*)\}`", seen["text"]) == []
        for source, width, alt in seen["images"]:
            assert width > 0, source
            assert alt.strip(), source
            assert not re.search(r"\.(svg|png)$", alt), source
        assert_it_fits(opened, 1280)
        assert not name.startswith("executed/") or choose(opened.page)
        assert_it_fits(opened, 390, 320)
        assert said_by_us(opened) == []


@needs_book
@pytest.mark.parametrize("name", by_night({*PAGES} - ONE_OF_EACH))
def test_page_is_whole_on_a_phone_in_the_dark_and_served(chromium, address, name):
    with open_offline(chromium, BOOK / name, 390, 844, True, served=f"{address}/{name}") as opened:
        assert all(opened.page.evaluate(FACTS)["math"])
        assert_it_fits(opened, 390)
        assert said_by_us(opened) == []


@needs_book
@pytest.mark.parametrize("name", by_night({*PAGES} - ONE_OF_EACH))
def test_nothing_is_amiss_for_those_who_cannot_see_well(chromium, name):
    if axe.absent():
        pytest.skip(axe.absent())
    without = () if name == "intro.html" else SAME
    with open_offline(chromium, BOOK / name) as opened:
        assert axe.light_and_dark(opened.page, theme=True, without=without) == []


@pytest.mark.slow
def test_nothing_is_amiss_in_a_form_that_refuses(chromium, tmp_path):
    if axe.absent():
        pytest.skip(axe.absent())
    file = write_page(tmp_path / "form.html", f"<main><h1>x</h1>{explorer.rerun_form_html()}")
    for dark, query in ((False, "set=beam-arrays&modes=1"), (True, "set=lab-plate&frames=x")):
        with open_offline(chromium, file, dark=dark, query=query) as opened:
            opened.page.evaluate(axe.PREPARE)
            assert axe.findings(opened.page) == []


@needs_book
@pytest.mark.few(1)
@pytest.mark.parametrize("name", LONGEST)
def test_first_paint_within_half_a_second(chromium, name):
    """Of the longest pages, in a window that has seen no page before."""
    paint = "() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN"
    waiting = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))  # jobs for each processor
    tried = []
    while not tried or (min(tried) > PAINT_MS * waiting and len(tried) < 8):  # it may be busy
        with open_offline(chromium, BOOK / name, fresh=True) as opened:
            tried.append(opened.page.evaluate(paint))
    assert min(tried) <= PAINT_MS * waiting, tried


@needs_book
def test_pages_refer_to_what_is_there_and_load_nothing_from_elsewhere():
    titles = []
    for name in PAGES:
        page = document_fromstring((BOOK / name).read_text(encoding="utf-8"))
        titles.append(page.findtext(".//title"))
        for link in page.xpath("//a/@href"):
            parts = urlsplit(link)
            if not parts.scheme and not parts.netloc:
                target = (BOOK / name).parent.joinpath(unquote(parts.path)).resolve()
                target = target if parts.path else BOOK / name
                assert target.is_relative_to(BOOK), (name, link)
                assert target.is_file(), (name, link)
                if parts.fragment and target.suffix == ".html":
                    assert unquote(parts.fragment) in anchors(target), (name, link)
        loads = "//script/@src | //img/@src | //iframe/@src | //source/@src | //link/@href"
        assert [one for one in page.xpath(loads) if re.match("(https?:)?//", one)] == []
    assert len(set(titles)) == len(titles)  # tabs tell them apart
    assert sum(file.stat().st_size for file in BOOK.rglob("*") if file.is_file()) < 85e6


@cache
def anchors(page):
    """The names of all places of a page; those of claims are made by the ledger's script."""
    text = page.read_text(encoding="utf-8")
    claims = re.findall(r'"id":"([\w-]+)","kind"', text) if page.stem == "claims" else ()
    return {*re.findall(r'\bid="([^"]*)"', text), *(f"claim-{one}" for one in claims)}


@needs_book
def test_home_answers_and_leads_to_the_explorer(chromium):
    with open_offline(chromium, BOOK / "intro.html", height=800) as opened:
        page = opened.page
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


SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="900" height="9"><path d="M0 0h900"/></svg>'
WIDGET = """<select aria-label="x"><option>1</option><option>2</option></select><b id="w">?</b>
<script type="module">
const list = document.querySelector("select"), show = () => { w.textContent = "=" + list.value; };
list.addEventListener("change", show); show();
</script>"""


def test_the_page_of_a_run_works_alone(chromium, tmp_path):
    """A small executed notebook with one of everything that a page shows."""
    figure = {"figure": {"name": "fig-a", "caption": "*Error* of $w$."}, "image": {"alt": 'a "b"'}}
    view = {"application/vnd.jupyter.widget-view+json": {"model_id": "m"}, "text/html": WIDGET}
    state = {"application/vnd.jupyter.widget-state+json": {"state": {"m": {"secret": 1}}}}
    said = new_output("stream", name="stdout", text="<1 & 2>" * 50)
    drawing = new_output("display_data", data={"image/svg+xml": SVG})
    cells = [
        new_markdown_cell("# Head\n\nSee [x](some-label).\n\n$$\na^2\n$$"),
        new_code_cell("n = 12345  # how many", metadata={"tags": ["injected-parameters"]}),
        new_code_cell("hidden_word()", metadata={"tags": ["remove-input"]}),
        new_code_cell("print(1)", outputs=[said]),
        new_code_cell("draw()", metadata={"mystnb": figure}, outputs=[drawing]),
        new_code_cell("explore()", outputs=[new_output("display_data", data=view)]),
    ]
    path, html = tmp_path / "run.ipynb", tmp_path / "run.html"
    nbformat.write(new_notebook(cells=cells, metadata={"widgets": state}), path)
    text = web_page.export_notebook(path, "<i>R</i> & co")
    html.write_text(text, encoding="utf-8")
    assert base64.b64encode(SVG.encode()).decode() in text
    assert "hidden_word" not in text
    assert "secret" not in text
    assert r"\[a^2\]" in text
    with open_offline(chromium, html) as opened:
        page = opened.page
        assert page.title() == "<i>R</i> & co"
        assert page.locator("figure#fig-a figcaption").inner_text().startswith("Error")
        assert page.locator("figure#fig-a img").get_attribute("alt") == 'a "b"'
        assert page.locator("a").count() == 0
        page.locator("select").select_option("2")
        assert page.locator("#w").inner_text() == "=2"
        assert "<1 & 2>" in page.locator("pre").nth(2).inner_text()
        for width in (1280, 390):
            page.set_viewport_size({"width": width, "height": 900})
            assert opened.sideways_px() <= 0
        assert axe.light_and_dark(page) == []
