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
from thesis_lib.files import whole_file
from thesis_lib.runs.execute import Progress
from thesis_lib.web.page import BookError

BROWSER_FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]
UNLINK_PAGES = """() => document.querySelectorAll("a[href]:not([href^='#'])").forEach(
  link => link.protocol === "file:" && link.replaceWith(...link.childNodes))"""


def find_browser() -> str:
    """Return the path of Chromium or Chrome; raise BookError if there is none."""
    given = os.environ.get("CHROME_BIN", "chromium")
    for name in (given, "chromium", "chromium-browser", "google-chrome"):
        if path := shutil.which(name):
            return path
    raise BookError("to print the book install Chromium, for example `apt install chromium`")


def print_book(root: Path) -> Path:
    """Print the book of a project in which `thesis book` has run, as it was last executed."""
    browser, pdf = find_browser(), root / "build" / f"{rendering.ARCHIVE_NAME}.pdf"
    if not (root / "build" / "html" / "index.html").is_file():
        raise BookError("there is no book to print yet: run `thesis book` first")
    progress = Progress(2)
    with progress.report_step("pages"):
        rendering.install_assets(root)
        page = rendering.run_sphinx(root, "singlehtml") / "intro.html"
        text = prepare_page(page.read_text(encoding="utf-8"))
        (printable := page.with_name("print.html")).write_text(text, encoding="utf-8")
    with progress.report_step("print"):
        style = root / "book" / "assets" / "print.css"
        whole_file(pdf, lambda part: print_page(browser, printable, style, part))
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
    """Print one local page with an outline and page numbers, without a network."""
    from playwright.sync_api import sync_playwright
    from pypdf import PdfWriter
    from pypdf.generic import NameObject, TextStringObject

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
    writer = PdfWriter(clone_from=pdf)
    entries = [writer.root_object.get("/Outlines")]
    while entries:  # Chromium doubles the title of a heading that is moved to a new page
        if entry := entries.pop():
            entry = entry.get_object()
            entries += [entry.get("/First"), entry.get("/Next")]
            title = str(entry.get("/Title", ""))
            if len(title) > 3 and title[: len(title) // 2] * 2 == title:
                entry[NameObject("/Title")] = TextStringObject(title[: len(title) // 2])
    writer.write(pdf)
