"""The whole book as one PDF: all pages in one, printed by the Chromium of this machine.

The explorer and the ledger are printed as they first stand. The viewers of results give way to a
line that says where they are: the figures below them show the same, case by case and mode by mode.
"""

from __future__ import annotations

import logging
import os
import re
import shutil
from pathlib import Path

from thesis_lib.book import site as book
from thesis_lib.files import staging, whole_file
from thesis_lib.web.page import BookError

TITLE = "Vibration by many cameras"
_WIDGET = re.compile(
    r'<div class="tl-fragment" data-tl-fragment="(?P<id>\w+)">.*?</div>\s*'
    r"(?:<style>.*?</style>\s*)?<script type=\"module\">.*?</script>",
    re.DOTALL,
)
_PAGE = re.compile(r'id="document-([\w/.-]+)"')
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]
_STYLE = """
html, body { background: #fff !important; font-size: 10pt; }
.bd-sidebar-primary, .bd-sidebar-secondary, .bd-header, .bd-header-article, .bd-footer, footer,
.bd-footer-content, .search-button__wrapper, #pst-skip-link, #print-main-content,
.headerlink, .copybtn, .tl-under-figure, .tl-download, .toctree-wrapper > p.caption,
.toctree-wrapper > ul { display: none !important; }
.bd-main .bd-content .bd-article-container { max-width: 100% !important; padding: 0 !important; }
.bd-content, .bd-article-container, .bd-article, main { display: block !important; }
span[id^="document-"] { display: block; break-before: page; }
h1, h2, h3, h4, h5 { break-after: avoid; }
table { font-size: 7pt !important; }
:is(th, td) { padding: .1rem .3rem !important; white-space: normal !important; }
.bd-article img { max-height: 21cm; }
.bd-article figure { margin: .4rem 0 !important; }
.bd-article figure img { max-height: 10.6cm; width: auto !important; }
.cell_output, .cell_output .output { white-space: normal !important; margin: 0 !important; }
mjx-container[jax="SVG"] { overflow: visible !important; }
mjx-container[jax="SVG"] > svg { max-width: 100% !important; }
mjx-container[jax="SVG"] path[data-c] { stroke-width: 0 !important; }
.tl-viewer .tl-ex-hint, .tl-ex-export, .tl-ex-camera button, .tl-ex-cameras > button,
.tl-ledger button { display: none !important; }
.tl-explorer { break-inside: avoid; }
.tl-viewer.tl-explorer .tl-ex-columns {
  grid-template-columns: minmax(0, 1fr) minmax(0, 1fr) !important; }
.tl-viewer.tl-explorer .tl-ex-columns .tl-ex-view { height: 260px !important; }
.bd-article details.tl-provenance > dl { display: grid !important; }
details > summary { display: none !important; }
details.tl-provenance > summary { display: list-item !important; list-style: none; }
pre { font-size: 7pt !important; }
"""
_LOOSE = """() => {
  for (const a of document.querySelectorAll("a[href]"))
    if (!/^(#|https?:|mailto:)/.test(a.getAttribute("href"))) a.removeAttribute("href");
  for (const d of document.querySelectorAll("details")) d.open = true;
  for (const i of document.querySelectorAll("img")) i.loading = "eager";
}"""
_FOOTER = (
    '<div style="font: 8pt sans-serif; width: 100%; text-align: center; color: #666">'
    '<span class="pageNumber"></span> / <span class="totalPages"></span></div>'
)


def without_widgets(text: str) -> str:
    """A page without the widgets that are not to be printed: a line says on which page each is.

    Parameters
    ----------
    text : str
        HTML of the whole book in one page.
    """

    def line(match: re.Match[str]) -> str:
        pages = _PAGE.findall(text, 0, match.start())
        where = f"{pages[-1]}.html" if pages else "its page"
        return f'<p class="tl-print-note"><em>Interactive, in the book: {where}</em></p>'

    return _WIDGET.sub(line, text)


def find_browser() -> str:
    """Path of Chromium or Chrome.

    Raises
    ------
    BookError
        If there is none.
    """
    for name in filter(None, (os.environ.get("CHROME_BIN"), *_BROWSERS)):
        path = shutil.which(name)
        if path:
            return path
    raise BookError("to print the book install Chromium, for example `apt install chromium`")


def build(root: Path) -> Path:
    """Print the book of a project in which `thesis book` has run, as it was last executed.

    Raises
    ------
    BookError
        If the pages do not build, or there is no browser.
    """
    browser, pdf = find_browser(), root / "build" / "vibration-by-many-cameras.pdf"
    if not (root / "build" / "html" / "index.html").is_file():
        raise BookError("there is no book to print yet: run `thesis book` first")
    book.install_assets(root)
    with staging(root / "build") as work:
        pages = book.in_one_page(root, work)
        text = pages.read_text(encoding="utf-8")
        pages.write_text(without_widgets(text), encoding="utf-8")

        def fill(part: Path) -> None:
            print_page(browser, pages, part)
            mend_outline(part)

        whole_file(pdf, fill)
    return pdf


def mend_outline(pdf: Path) -> None:
    """Write titles of the outline once: Chromium doubles that of a heading moved to a new page."""
    from pypdf import PdfWriter
    from pypdf.generic import NameObject, TextStringObject

    logging.getLogger("pypdf").setLevel(logging.ERROR)  # it counts objects in another way
    writer = PdfWriter(clone_from=pdf)
    writer.add_metadata({"/Title": TITLE})
    left = [writer.root_object.get("/Outlines")]
    while left:
        item = left.pop()
        if item is None:
            continue
        item = item.get_object()
        left += [item.get("/First"), item.get("/Next")]
        title = str(item.get("/Title", ""))
        half = len(title) // 2
        if half > 1 and title == 2 * title[:half]:
            item[NameObject("/Title")] = TextStringObject(title[:half])
    writer.write(pdf)


def print_page(browser: str, page: Path, pdf: Path) -> None:
    """Print one local page on A4, with an outline and page numbers, without a network."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        chromium = running.chromium.launch(executable_path=browser, args=FLAGS)
        try:
            opened = chromium.new_context(offline=True, color_scheme="light").new_page()
            opened.set_default_timeout(300_000)
            opened.goto(page.resolve().as_uri(), wait_until="load")
            opened.evaluate("() => window.MathJax?.startup?.promise")
            opened.add_style_tag(content=_STYLE)
            opened.evaluate(_LOOSE)
            opened.evaluate(
                "() => Promise.allSettled([...document.images].map(image => image.decode()))"
            )
            opened.pdf(
                path=pdf,
                format="A4",
                print_background=True,
                tagged=True,
                outline=True,
                display_header_footer=True,
                header_template="<span></span>",
                footer_template=_FOOTER,
                margin={"top": "16mm", "bottom": "18mm", "left": "16mm", "right": "16mm"},
            )
        finally:
            chromium.close()
