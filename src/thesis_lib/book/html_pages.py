"""Finishing of the rendered pages: names for screen readers, images, shared viewers, search index.

Sphinx, its theme and its extensions wrote the pages; here a parser reads each of them once.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import lxml.html
from lxml.html import HtmlElement, builder

from thesis_lib.book.drawings import measure_image, theme_drawing
from thesis_lib.book.interval_cells import draw_intervals
from thesis_lib.book.search_index import SearchEntry, index_page, write_index

VIEWERS_FOLDER = "_viewers"
_STATE_MARK = "\nconst state = "  # the data of a viewer; its program stands before them
_MODEL_MARK = "\nfunction createModel("  # stands after them
_FRONTS_MARK = "window.thesisFronts"
_WITHOUT_BOOK = (
    "this.insertAdjacentText('beforebegin', 'The viewer that stands here needs the whole book.')"
)
_UNUSED_SCRIPTS = ("searchtools.js", "language_data.js", "searchindex.js", "fontawesome.js")


def finish_pages(book: Path) -> None:
    """Finish all pages and drawings of a rendered book, and write its search index."""
    for name in ("search.html", "searchindex.js"):  # the search opens in each page
        (book / name).unlink(missing_ok=True)
    for drawing in (book / "_images").glob("*.svg"):
        theme_drawing(drawing)
    entries: dict[str, list[SearchEntry]] = {}
    for path in sorted({*book.rglob("*.html")} - {*(book / "_static").rglob("*.html")}):
        name = path.relative_to(book).as_posix()
        page = lxml.html.document_fromstring(path.read_text(encoding="utf-8"))
        entries[name] = index_page(page)
        remove_unused(page)
        name_controls(page)
        fold_contents(page)
        draw_intervals(page)
        load_lazily(page, path.parent)
        share_viewers(page, book, "../" * name.count("/"))
        text = lxml.html.tostring(page, encoding="unicode", doctype="<!DOCTYPE html>")
        path.write_text(text, encoding="utf-8")
    write_index(book, entries)
    for notebook in (book / "_sources").rglob("*.ipynb"):
        strip_notebook(notebook)


def find_class(page: HtmlElement, *classes: str) -> Iterator[HtmlElement]:
    """Yield the elements of a page that have one of some classes."""
    for element in page.iter(lxml.html.etree.Element):
        if not {*classes}.isdisjoint(element.classes):
            yield element


def remove_unused(page: HtmlElement) -> None:
    """Remove the state of widgets, which viewers carry, and the scripts of Sphinx's search."""
    for script in [*page.iter("script")]:
        state = script.get("type") == "application/vnd.jupyter.widget-state+json"
        if state or script.get("src", "").partition("?")[0].endswith(_UNUSED_SCRIPTS):
            script.drop_tree()
    for second in page.xpath("//meta[@name='viewport']")[1:]:
        second.drop_tree()


def name_controls(page: HtmlElement) -> None:
    """Give controls of the theme and its extensions the names and roles that they lack.

    ``tests/book/test_book_pages.py`` checks them with axe in a browser.
    """
    for link in find_class(page, "internal"):
        fold = link.getnext()
        if fold is not None and fold.tag == "details":
            fold.find("summary").set("aria-label", f"Pages below: {link.text_content().strip()}")
    for element in find_class(page, "search-button-field"):
        element.attrib.pop("aria-label", None)  # its own text says more
    for element in page.xpath("//summary[@aria-label='Toggle hidden content']"):
        del element.attrib["aria-label"]
    for element in find_class(page, "theme-switch"):
        element.attrib.pop("title", None)  # a second text next to the button's name
    for element in page.xpath("//form[contains(@class, 'bd-search')]"):
        for name in ("action", "method"):
            element.attrib.pop(name, None)
    for element in page.xpath("//*[@id='pst-primary-sidebar']"):
        element.set("role", "region")
        element.set("aria-label", "Title and contents")
    for element in page.iter("th"):
        if not element.text_content().strip():
            element.tag = "td"  # a head without words is no head
    for element in page.xpath("//*[@role='doc-biblioentry']"):
        element.set("role", "listitem")  # the former role is deprecated


def fold_contents(page: HtmlElement) -> None:
    """Fold the parts of the contents in the margin, except for the part of this page."""
    for caption in page.xpath("//nav//p[contains(@class, 'caption')]"):
        pages = caption.getnext()
        if len(pages.xpath(".//li")) == 1:  # a part of one page is that page
            caption.drop_tree()
            continue
        summary = builder.SUMMARY(*caption, {"class": "caption"})
        part = builder.DETAILS(summary, {"class": "tl-part"})
        if "current" in pages.classes:
            part.set("open", "")
        caption.getparent().replace(caption, part)
        part.append(pages)


def load_lazily(page: HtmlElement, folder: Path) -> None:
    """Let images load when they come near the screen, with their size and panels known before."""
    for image in page.iter("img"):
        source = image.get("src", "")
        known = {} if ":" in source else measure_image(folder / unquote(source))
        if "width" not in known or image.get("loading"):
            continue
        if image.get("width"):
            known = {name: known[name] for name in known if name == "data-panels"}
        image.attrib.update({"loading": "lazy", **known})


def share_viewers(page: HtmlElement, book: Path, root: str) -> None:
    """Move the programs and styles of viewers to files that pages share; the data stay in the page.

    A page opened from a folder may load no module, but a script, whose function returns the front
    end; both run when the page is read, in their order.
    """
    for script in page.xpath("//script[@type='module']"):
        head, found, model = (script.text or "").rpartition(_MODEL_MARK)
        program, _, state = head.rpartition(_STATE_MARK)
        style = script.getprevious()
        if not found or style is None or style.tag != "style":
            continue
        name, css = _write_viewer(book, program.strip(), style.text or "")
        script.addprevious(builder.LINK(rel="stylesheet", href=f"{root}{VIEWERS_FOLDER}/{css}"))
        front = builder.SCRIPT(
            {"defer": "", "onerror": _WITHOUT_BOOK}, src=f"{root}{VIEWERS_FOLDER}/{name}.js"
        )
        script.addprevious(front)
        script.text = (
            f"\nconst widget = {_FRONTS_MARK}['{name}']();{_STATE_MARK}{state}{_MODEL_MARK}{model}"
        )
        style.drop_tree()


def _write_viewer(book: Path, program: str, style: str) -> tuple[str, str]:
    """Write a program and a style sheet, named by their contents; return the names."""
    name, css = (hashlib.sha256(text.encode()).hexdigest()[:16] for text in (program, style))
    folder = book / VIEWERS_FOLDER
    folder.mkdir(exist_ok=True)
    js = f"({_FRONTS_MARK} ??= {{}})['{name}'] = () => {{\n{program}\nreturn widget;\n}};\n"
    (folder / f"{name}.js").write_text(js, encoding="utf-8")
    (folder / f"{css}.css").write_text(style, encoding="utf-8")
    return name, f"{css}.css"


def strip_notebook(path: Path) -> None:
    """Remove from an offered notebook what its page shows: pictures and widgets."""
    notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    notebook["metadata"].pop("widgets", None)
    for output in (one for cell in notebook["cells"] for one in cell.get("outputs", [])):
        data = output.get("data", {})
        text = {
            kind: value for kind, value in data.items() if kind in ("text/plain", "text/markdown")
        }
        if data:
            output["data"], output["metadata"] = text or data, {}
    path.write_text(json.dumps(notebook, ensure_ascii=False, indent=1), encoding="utf-8")
