"""Post-processing of Sphinx's HTML pages: accessible names, images, search index.

Table cells of five numbers become sparklines, and drawings get colours for dark mode. Each page is
parsed once.

The index serves the book's search and previews of links. Its entries are headings, figures,
equations, names of the library, terms, warnings, sources and claims. All entries are in one
script, since a page opened as a local file may fetch no other page.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from lxml import etree, html
from lxml.html import builder
from matplotlib.colors import to_hex
from PIL import Image, ImageColor

from thesis_lib.facts.claims import read_index
from thesis_lib.web.html import render_html

_UNUSED_SCRIPTS = ("searchtools.js", "language_data.js", "searchindex.js", "fontawesome.js")
_KEPT_KINDS = ("text/plain", "text/markdown")  # of outputs, in downloadable notebooks


def finish_pages(book: Path) -> None:
    """Post-process all pages and drawings of a rendered book, and write its search index."""
    for drawing in (book / "_images").glob("*.svg"):
        theme_drawing(drawing)
    entries: dict[str, list[SearchEntry]] = {}
    for path in sorted({*book.rglob("*.html")} - {*(book / "_static").rglob("*.html")}):
        name = path.relative_to(book).as_posix()
        page = html.document_fromstring(path.read_text(encoding="utf-8"))
        entries[name] = index_page(page)
        for script in [*page.iter("script")]:  # widget state, held by viewers; Sphinx's search
            state = script.get("type") == "application/vnd.jupyter.widget-state+json"
            if state or script.get("src", "").partition("?")[0].endswith(_UNUSED_SCRIPTS):
                script.drop_tree()
        for second in page.xpath("//meta[@name='viewport']")[1:]:
            second.drop_tree()
        name_controls(page)
        fold_contents(page)
        draw_intervals(page)
        load_lazily(page, path.parent)
        text = html.tostring(page, encoding="unicode", doctype="<!DOCTYPE html>")
        path.write_text(text, encoding="utf-8")
    write_index(book, entries)
    for path in (book / "_sources").rglob("*.ipynb"):
        # A downloadable notebook omits figures and widgets, which its page shows.
        notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        notebook["metadata"].pop("widgets", None)
        for output in (one for cell in notebook["cells"] for one in cell.get("outputs", [])):
            if data := output.get("data"):
                kept = {kind: data[kind] for kind in data if kind in _KEPT_KINDS}
                output["data"], output["metadata"] = kept or data, {}
        path.write_text(json.dumps(notebook, ensure_ascii=False, indent=1), encoding="utf-8")


def name_controls(page: html.HtmlElement) -> None:
    """Add missing accessible names and roles to controls of the theme and its extensions.

    ``tests/book/test_book_pages.py`` checks them with axe in a browser.
    """
    for fold in page.iter("details"):
        link = fold.getprevious()
        if link is not None and "internal" in link.classes:
            fold.find("summary").set("aria-label", f"Pages below: {link.text_content().strip()}")
    superfluous = (
        # Its own text is more specific
        ("//button[contains(@class, 'search-button-field')]", "aria-label"),
        ("//summary[@aria-label='Toggle hidden content']", "aria-label"),
        # A second text in addition to the symbol's name
        ("//i[contains(@class, 'theme-switch')]", "title"),
        ("//form[contains(@class, 'bd-search')]", "action"),
        ("//form[contains(@class, 'bd-search')]", "method"),
    )
    for path, name in superfluous:
        for element in page.xpath(path):
            element.attrib.pop(name, None)
    for element in page.xpath("//*[@id='pst-primary-sidebar']"):
        element.attrib.update({"role": "region", "aria-label": "Title and contents"})
    for element in page.iter("th"):
        if not element.text_content().strip():
            element.tag = "td"  # an empty header is a data cell
    for element in page.xpath("//*[@role='doc-biblioentry']"):
        element.set("role", "listitem")  # the former role is deprecated


def fold_contents(page: html.HtmlElement) -> None:
    """Fold the parts of the table of contents in the side bar, except for this page's part."""
    for caption in page.xpath("//nav//p[contains(@class, 'caption')]"):
        pages = caption.getnext()
        if len(pages.xpath(".//li")) == 1:  # a part with a single page needs no caption
            caption.drop_tree()
            continue
        summary = builder.SUMMARY(*caption, {"class": "caption"})
        part = builder.DETAILS(summary, {"class": "tl-part"})
        if "current" in pages.classes:
            part.set("open", "")
        caption.getparent().replace(caption, part)
        part.append(pages)


def load_lazily(page: html.HtmlElement, folder: Path) -> None:
    """Load images lazily, with their size and panels as attributes."""
    for image in page.iter("img"):
        source = image.get("src", "")
        known = {} if ":" in source else measure_image(folder / unquote(source))
        if "width" in known:
            image.attrib.update({"loading": "lazy", **known})


MAX_LINEAR_DECADES = 1.7  # a scale that spans more is logarithmic
INTERVAL_CELL_WIDTH_PX = 90
_INTERVAL_PATTERN = re.compile(r"([\d.]+) · ([\d.]+) \(([\d.]+)–([\d.]+)\) · ([\d.]+)")
_KEY_PATTERN = re.compile(
    r"Each cell: (.*?) · median \(5–95 %\) of the (.*?) · (.*?), in % of (.*)", re.DOTALL
)


def draw_intervals(page: Any) -> None:
    """Replace the table cells of five numbers of a parsed page, and their key, by sparklines."""
    keys = [p for p in page.iter("p") if (p.text or "").startswith("Each cell: ")]
    match = _KEY_PATTERN.fullmatch(keys[0].text_content()) if keys else None
    if match is None:
        return
    nominal, draws, predicted, unit = match.groups()
    words = (nominal, f"5–95 % of the {draws}", predicted)
    scales = [scale for table in page.iter("table") if (scale := _draw_table(table, words))]
    if not scales:
        return
    links = page.xpath("//a[contains(@href, 'data/') and contains(@href, '.csv')]/@href")
    values = {"scale": scales[0], "words": words, "unit": unit, "numbers": "".join(links[:1])}
    new = html.fragment_fromstring(render_html("book/templates/interval_key.html.j2", **values))
    new.tail = keys[0].tail
    keys[0].getparent().replace(keys[0], new)


def _draw_table(table: Any, words: tuple[str, str, str]) -> str:
    """Draw the cells of a table; return the text for their scale, "" without any."""
    found = [
        (cell, _INTERVAL_PATTERN.fullmatch(cell.text_content().strip()))
        for cell in table.iter("td")
    ]
    cells = [(cell, match.groups()) for cell, match in found if match]
    if not cells:
        return ""
    numbers = [float(text) for _, texts in cells for text in texts]
    low, high = min((one for one in numbers if one > 0), default=1.0), max(numbers)
    logarithmic = low < high and math.log10(high / low) > MAX_LINEAR_DECADES

    def place_mark(text: str) -> float:
        share = float(text) / high if high else 0.0
        if logarithmic:
            share = 1 - math.log(max(share, low / high)) / math.log(low / high)
        return round(5 + (INTERVAL_CELL_WIDTH_PX - 10) * share, 1)

    names = ("nominal", "median", "lower", "upper", "predicted")
    for cell, texts in cells:
        values = {"words": words, "width": INTERVAL_CELL_WIDTH_PX, "place": place_mark}
        values |= dict(zip(names, texts, strict=True))
        drawing = render_html("book/templates/interval_cell.html.j2", **values)
        cell[:], cell.text = [html.fragment_fromstring(drawing)], None
    begin, kind = (f"{low:g}", ", by powers of ten") if logarithmic else ("0", "")
    return f"from {begin} to {high:g} %{kind}"


DARK_GROUND, DARK_INK = (18, 18, 18), (222, 226, 230)  # of the book's pages in dark mode
MIN_CONTRAST = 4.5  # WCAG 2 AA
MAX_GREY_SPREAD = 16  # largest difference of the RGB channels of a grey
PX_PER_UNIT = {"pt": 4 / 3, "px": 1.0, "": 1.0}
_to_hex = cache(to_hex)
_COLOUR_PATTERN = re.compile(r"#[0-9a-fA-F]{6}\b|#[0-9a-fA-F]{3}\b")
_LENGTH_PATTERN = re.compile(r"([\d.]+)(pt|px|)")
_COLOUR_ATTRIBUTE_PATTERN = re.compile(r'\s(?:style|fill|stroke|stop-color)="[^"]*"')


def measure_image(path: Path) -> dict[str, str]:
    """Return width and height in CSS pixels and the panels of an image, as attributes of HTML."""
    if not path.is_file():
        return {}
    if path.suffix != ".svg":
        with Image.open(path) as photograph:
            width, height = photograph.size
        return {"width": str(width), "height": str(height)}
    _, root = next(etree.iterparse(path, events=("start",)))
    sides = [(side, _LENGTH_PATTERN.fullmatch(root.get(side, ""))) for side in ("width", "height")]
    found = {side: str(round(float(m[1]) * PX_PER_UNIT[m[2]])) for side, m in sides if m}
    if panels := root.get("data-panels"):
        found["data-panels"] = panels
    return found


def theme_drawing(path: Path) -> None:
    """Rewrite a drawing with colours that follow the page: other values in dark mode.

    There, white becomes the page's background, black its text colour, greys lie between, and
    colours are lightened until they have the contrast that text needs.
    """
    colours = {"#000000"}

    def name_variable(match: re.Match[str]) -> str:
        colours.add(colour := _to_hex(match[0]))
        return f"var(--c{colour[1:]})"

    text = _COLOUR_ATTRIBUTE_PATTERN.sub(
        lambda found: _COLOUR_PATTERN.sub(name_variable, found[0]),
        path.read_text(encoding="utf-8"),
    )
    light = "".join(f"--c{one[1:]}:{one};" for one in sorted(colours))
    dark = "".join(f"--c{one[1:]}:{find_dark_colour(one)};" for one in sorted(colours))
    rules = f"svg{{{light}fill:var(--c000000)}}@media (prefers-color-scheme:dark){{svg{{{dark}}}}}"
    text = re.sub("<svg[^>]*>", rf"\g<0><style>{rules}</style>", text, count=1)
    path.write_text(text, encoding="utf-8")


def find_dark_colour(colour: str) -> str:
    """Return the dark-mode replacement of a colour, ``#rrggbb``.

    Examples
    --------
    >>> find_dark_colour("#ffffff"), find_dark_colour("#000000"), find_dark_colour("#e69f00")
    ('#121212', '#dee2e6', '#e69f00')
    """
    rgb = ImageColor.getrgb(colour)
    if max(rgb) - min(rgb) < MAX_GREY_SPREAD:
        share = sum(rgb) / 765
        pairs = zip(DARK_INK, DARK_GROUND, strict=True)
        shown = [ink + share * (ground - ink) for ink, ground in pairs]
    else:
        ground = compute_luminance(DARK_GROUND) + 0.05
        for step in range(101):
            shown = [one + (255 - one) * step / 100 for one in rgb]
            if compute_luminance(shown) + 0.05 >= MIN_CONTRAST * ground:
                break
    return f"#{bytes(map(round, shown)).hex()}"


def compute_luminance(rgb: Sequence[float]) -> float:
    """Return the relative luminance (WCAG), from 0 to 1, of RGB values from 0 to 255."""
    parts = [one / 255 for one in rgb]
    linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


INDEX_FILE = "_static/entries.js"
MAX_TEXT_LENGTH = 2000
MAX_NAME_TEXT_LENGTH = 300  # signature and return values are on the name's page
_CLAIMS_MARK = 'const state = {"data":{"rows":'
_HEADING_TAGS = {"h1", "h2", "h3", "h4", "h5", "h6"}
_BLOCK_TAGS = {"p", "li", "dd", "td", "th", "dt", "pre", "div"}  # they separate words
_NO_TEXT = {"script", "style", "noscript", "svg", "button", "summary"}
_NO_TEXT_CLASSES = {"headerlink", "caption-number", "cell_input", "sig-object", "tl-under-figure"}
_TITLE_CLASSES = {"eqno", "label"}


@dataclass
class SearchEntry:
    """A place that can be searched for or previewed."""

    kind: str  #: section, figure, equation, name, term, source, claim or thesis
    places: list[str]  #: Anchors on its page, its own first
    title: str = ""
    text: str = ""
    picture: str = ""  #: Image of a figure, relative to the page


def index_page(page: Any) -> list[SearchEntry]:
    """Return the entries of a parsed page in their order; the first one is the page itself."""
    found: list[SearchEntry] = []
    for article in page.xpath("//article[contains(@class, 'bd-article')]"):
        _read_element(article, None, found, in_title=False)
    for entry in found:
        length = MAX_NAME_TEXT_LENGTH if entry.kind == "name" else MAX_TEXT_LENGTH
        entry.text = " ".join(entry.text.split())[:length]
        entry.title = _name_entry(entry)
    if found and (tab := page.findtext(".//title")):
        found[0].title = " ".join(tab.partition(" \N{EM DASH} ")[0].split())  # unique in the book
    return [*found, *_list_claims(page)] if found else []


def _read_element(
    parent: Any, current: SearchEntry | None, found: list[SearchEntry], in_title: bool
) -> None:
    """Add the text below an element to the innermost entry that it belongs to."""
    for child in parent:
        if isinstance(child.tag, str):  # not a comment
            new, anchor = _begin_entry(child), child.get("id", "")
            owner = new or current
            if new:
                found.append(new)
                if new.kind in ("term", "name"):  # the list's next item explains it
                    current = new
            elif owner and child.tag == "span" and anchor and anchor not in owner.places:
                owner.places.append(anchor)
            elif owner and child.tag == "img" and owner.kind == "figure":
                owner.picture = child.get("src", "")
            classes = {*child.get("class", "").split()}
            if child.tag not in _NO_TEXT and classes.isdisjoint(_NO_TEXT_CLASSES):
                title = in_title or child.tag in _HEADING_TAGS
                title |= not classes.isdisjoint(_TITLE_CLASSES)
                title |= new is not None and new.kind == "term" and not new.title
                _add_words(owner, child.text, title)
                _read_element(child, owner, found, title)
            if child.tag in _BLOCK_TAGS:
                _add_words(owner, " ", title=False)
        _add_words(current, child.tail, in_title)


def _begin_entry(element: Any) -> SearchEntry | None:
    """Return the entry that an element begins, if any."""
    anchor, classes = element.get("id", ""), element.get("class", "").split()
    kinds = {
        str(element.tag): element.tag in ("section", "figure") and anchor,
        "equation": anchor.startswith("equation-"),
        "source": "citation" in classes,
        "term": element.tag == "dt" and anchor.startswith("term-"),
        "name": "sig-object" in classes and anchor,
    }
    if kind := next((kind for kind, begins in kinds.items() if begins), ""):
        return SearchEntry(kind, [anchor])
    code = element.find("span[@id]/code") if element.tag == "dt" else None
    if code is None:
        return None
    # A warning, to be found by its name
    return SearchEntry("term", [code.getparent().get("id")], code.text_content())


def _add_words(entry: SearchEntry | None, text: str | None, title: bool) -> None:
    if entry and text and title:
        entry.title += text
    elif entry and text:
        entry.text += text


def _name_entry(entry: SearchEntry) -> str:
    """Return an entry's title; for a figure, its number in the thesis or its first sentence."""
    if entry.kind == "name":
        return entry.places[0].removeprefix("thesis_lib.")
    if entry.kind == "figure":
        sentence = entry.text.partition(". ")[0].rstrip(".")
        return sentence.removesuffix(" of the thesis") if sentence[:6] == "Figure" else sentence
    title = " ".join(entry.title.split())
    return f"Equation {title}" if entry.kind == "equation" else title


def _list_claims(page: Any) -> Iterator[SearchEntry]:
    """Yield the rows of the ledger, which its page contains as data."""
    for script in page.iter("script"):
        for line in (script.text or "").splitlines():
            if not line.startswith(_CLAIMS_MARK):
                continue
            for row in json.loads(line.removeprefix("const state = ").rstrip(";"))["data"]["rows"]:
                words = f"{row['what']}. The thesis: {row['stated']}; here: {row['got']}"
                text = f"{row['place']}: {words} ({row['verdict']})."
                yield SearchEntry("claim", [f"claim-{row['id']}"], f"Claim {row['id']}", text)


def write_index(book: Path, pages: Mapping[str, list[SearchEntry]]) -> None:
    """Write the entries of all pages, by page address, as a script that sets a variable.

    Then follow the figures, tables and equations of the thesis without an entry of their name.
    """
    rows = [(page, entry) for page, entries in sorted(pages.items()) for entry in entries]
    named, index = {entry.title for _, entry in rows}, "thesis-index.html"
    for one in read_index() if index in pages else ():
        title = one.item.capitalize()
        if title in named:
            continue
        name, _, anchor = one.page.partition("#")
        page = f"{name}.html" if f"{name}.html" in pages else index
        known = {place for entry in pages[page] for place in entry.places}
        places = [place for place in (anchor, f"equation-{anchor}") if place in known]
        text = f"In the thesis: {one.what}. {one.reason}".strip()
        rows.append((page, SearchEntry("thesis", places, title, text)))
    texts = [[page, e.kind, e.places, e.title, e.text, e.picture] for page, e in rows]
    text = json.dumps(texts, ensure_ascii=False, separators=(",", ":"))
    (book / INDEX_FILE).write_text(f"window.thesisEntries={text};\n", encoding="utf-8")
