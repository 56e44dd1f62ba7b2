"""The whole book as one PDF: all pages in one, printed by the Chromium of this machine.

The explorer and the ledger are printed as they first stand. A line that says where they are
replaces the viewers of results: the figures below them show the same, case by case.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import lxml.html
from lxml.html import builder

from thesis_lib.book import rendering
from thesis_lib.book.downloads import ARCHIVE_NAME
from thesis_lib.files import whole_file
from thesis_lib.runs.progress import Progress
from thesis_lib.web.page import BookError

BROWSER_COMMANDS = ("chromium", "chromium-browser", "google-chrome")
PRINT_STYLE = "book/assets/print.css"
UNLINK_PAGES = """() => document.querySelectorAll("a[href]:not([href^='#'])").forEach(
  link => link.protocol === "file:" && link.replaceWith(...link.childNodes))"""
BROWSER_FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]


def find_browser() -> str:
    """Return the path of Chromium or Chrome.

    Raises
    ------
    BookError
        If there is none.
    """
    for name in filter(None, (os.environ.get("CHROME_BIN"), *BROWSER_COMMANDS)):
        if path := shutil.which(name):
            return path
    raise BookError("to print the book install Chromium, for example `apt install chromium`")


def print_book(root: Path) -> Path:
    """Print the book of a project in which `thesis book` has run, as it was last executed.

    Raises
    ------
    BookError
        If the pages do not build, or there is no browser.
    """
    browser, pdf = find_browser(), root / "build" / f"{ARCHIVE_NAME}.pdf"
    if not (root / "build" / "html" / "index.html").is_file():
        raise BookError("there is no book to print yet: run `thesis book` first")
    progress = Progress(3)
    with progress.report_step("pages"):
        rendering.install_assets(root)
        page = rendering.run_sphinx(root, "singlehtml") / "intro.html"
        text = prepare_page(page.read_text(encoding="utf-8"))
        printable = page.with_name("print.html")
        printable.write_text(text, encoding="utf-8")

    def write_printed(part: Path) -> None:
        with progress.report_step("print"):
            print_page(browser, printable, root / PRINT_STYLE, part)
        with progress.report_step("outline"):
            mend_outline(part)

    whole_file(pdf, write_printed)
    return pdf


def prepare_page(text: str) -> str:
    """Return the book in one page without viewers, its details open."""
    page, name = lxml.html.document_fromstring(text), ""
    for element in [*page.iter(lxml.html.etree.Element)]:
        if (anchor := element.get("id", "")).startswith("document-"):
            name = anchor.removeprefix("document-")
        if "tl-fragment" in element.classes and "data-tl-print" not in element.attrib:
            for follower in [*element.itersiblings("style", "script")][:2]:
                follower.drop_tree()
            note = builder.P(builder.EM(f"Interactive, in the book: {name}.html"))
            element.getparent().replace(element, note)
        elif element.tag == "details":
            element.set("open", "")
    return lxml.html.tostring(page, encoding="unicode", doctype="<!DOCTYPE html>")


def print_page(browser: str, page: Path, style: Path, pdf: Path) -> None:
    """Print one local page on A4, with an outline and page numbers, without a network."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        chromium = running.chromium.launch(executable_path=browser, args=BROWSER_FLAGS)
        opened = chromium.new_context(offline=True, color_scheme="light").new_page()
        opened.set_default_timeout(300_000)
        opened.goto(page.resolve().as_uri(), wait_until="load")
        opened.evaluate("() => window.MathJax?.startup?.promise")
        opened.add_style_tag(path=style)
        opened.evaluate(UNLINK_PAGES)  # whole elements: a script may set an address again
        opened.pdf(
            path=pdf, prefer_css_page_size=True, print_background=True, tagged=True, outline=True
        )
        chromium.close()


def mend_outline(pdf: Path) -> None:
    """Write titles of the outline once: Chromium doubles that of a heading moved to a new page."""
    from pypdf import PdfWriter
    from pypdf.generic import NameObject, TextStringObject

    writer = PdfWriter(clone_from=pdf)
    entries = [writer.root_object.get("/Outlines")]
    while entries:
        if entry := entries.pop():
            entry = entry.get_object()
            entries += [entry.get("/First"), entry.get("/Next")]
            title = str(entry.get("/Title", ""))
            half = title[: len(title) // 2]
            if len(half) > 1 and title == 2 * half:
                entry[NameObject("/Title")] = TextStringObject(half)
    writer.write(pdf)
