"""Index of what a book's pages hold, for its search and for the previews of links.

Entries are headings, figures, equations, names of the library, terms, warnings, sources and claims.
All of them stand in one script, since a page opened from a folder may fetch no other page.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from thesis_lib.facts.claims import read_index

INDEX_FILE = "_static/entries.js"
MAX_TEXT_LENGTH = 2000
MAX_NAME_TEXT_LENGTH = 300  # the signature and the returned values stand on the name's page
_CLAIMS_MARK = 'const state = {"data":{"rows":'
_HEADING_TAGS = {"h1", "h2", "h3", "h4", "h5", "h6"}
_BLOCK_TAGS = {"p", "li", "dd", "td", "th", "dt", "pre", "div"}  # words on both sides are apart
_NO_TEXT = {"script", "style", "noscript", "svg", "button", "summary"}
_NO_TEXT_CLASSES = {"headerlink", "caption-number", "cell_input", "sig-object", "tl-under-figure"}
_TITLE_CLASSES = {"eqno", "label"}


@dataclass
class SearchEntry:
    """A place that can be searched for or previewed."""

    kind: str  #: section, figure, equation, name, term, source, claim or thesis
    places: list[str]  #: Anchors on its page, the first of them its own
    title: str = ""
    text: str = ""
    picture: str = ""  #: Of a figure, relative to the page
    words: list[str] = field(default_factory=list, repr=False)
    title_words: list[str] = field(default_factory=list, repr=False)


def index_page(page: Any) -> list[SearchEntry]:
    """Return the entries of a parsed page in their order; the first one is the page itself."""
    found: list[SearchEntry] = []
    for article in page.xpath("//article[contains(@class, 'bd-article')]"):
        _read_element(article, None, found, title=False)
    for entry in found:
        length = MAX_NAME_TEXT_LENGTH if entry.kind == "name" else MAX_TEXT_LENGTH
        entry.text = _join_words(entry.words)[:length]
        entry.title = _name_entry(entry)
    if found and (tab := page.findtext(".//title")):
        found[0].title = " ".join(tab.partition(" \N{EM DASH} ")[0].split())  # unique in the book
    return [*found, *_list_claims(page)] if found else []


def _read_element(
    parent: Any, current: SearchEntry | None, found: list[SearchEntry], title: bool
) -> None:
    """Add the text below an element to the innermost entry that it belongs to."""
    for child in parent:
        if not isinstance(child.tag, str):  # a comment
            _add_words(current, child.tail, title)
            continue
        owner, kind, anchor = current, _find_kind(child), child.get("id", "")
        code = child.find("span[@id]/code") if child.tag == "dt" and not kind else None
        if code is not None:  # a warning, which is searched for by its name
            kind, anchor = "term", code.getparent().get("id")
        if kind:
            owner = SearchEntry(kind, [anchor])
            if code is not None:
                owner.title_words.append(code.text_content())
            found.append(owner)
            if kind in ("term", "name"):  # what explains it follows in the list
                current = owner
        elif owner and child.tag == "span" and anchor and anchor not in owner.places:
            owner.places.append(anchor)
        elif owner and child.tag == "img" and owner.kind == "figure":
            owner.picture = child.get("src", "")
        classes = {*child.classes}
        if child.tag not in _NO_TEXT and classes.isdisjoint(_NO_TEXT_CLASSES):
            in_title = title or child.tag in _HEADING_TAGS or not classes.isdisjoint(_TITLE_CLASSES)
            in_title |= kind == "term" and code is None
            _add_words(owner, child.text, in_title)
            _read_element(child, owner, found, in_title)
        if child.tag in _BLOCK_TAGS:
            _add_words(owner, " ", title=False)
        _add_words(current, child.tail, title)


def _find_kind(element: Any) -> str:
    """Return the kind of entry that an element begins, or an empty text."""
    anchor, classes = element.get("id", ""), {*element.classes}
    if element.tag in ("section", "figure") and anchor:
        return str(element.tag)
    if anchor.startswith("equation-"):
        return "equation"
    if "citation" in classes:
        return "source"
    if element.tag == "dt" and anchor.startswith("term-"):
        return "term"
    return "name" if "sig-object" in classes and anchor else ""


def _add_words(entry: SearchEntry | None, text: str | None, title: bool) -> None:
    if entry and text:
        (entry.title_words if title else entry.words).append(text)


def _join_words(words: list[str]) -> str:
    return " ".join("".join(words).split())


def _name_entry(entry: SearchEntry) -> str:
    """Return the title of an entry: of a figure, its number in the thesis or its first sentence."""
    if entry.kind == "name":
        return entry.places[0].removeprefix("thesis_lib.")
    if entry.kind == "figure":
        sentence = entry.text.partition(". ")[0].rstrip(".")
        return sentence.removesuffix(" of the thesis") if sentence[:6] == "Figure" else sentence
    title = _join_words(entry.title_words)
    return f"Equation {title}" if entry.kind == "equation" else title


def _list_claims(page: Any) -> Iterator[SearchEntry]:
    """Yield the rows of the ledger, which its page carries as data."""
    for script in page.iter("script"):
        for line in (script.text or "").splitlines():
            if not line.startswith(_CLAIMS_MARK):
                continue
            for row in json.loads(line.removeprefix("const state = ").rstrip(";"))["data"]["rows"]:
                words = f"{row['what']}. The thesis: {row['stated']}; here: {row['got']}"
                text = f"{row['place']}: {words} ({row['verdict']})."
                yield SearchEntry("claim", [f"claim-{row['id']}"], f"Claim {row['id']}", text)


def write_index(book: Path, pages: Mapping[str, list[SearchEntry]]) -> None:
    """Write the entries of all pages, by address, as a script that sets a variable."""
    rows = [(page, entry) for page, entries in sorted(pages.items()) for entry in entries]
    rows += _list_thesis(pages)
    texts = [[page, e.kind, e.places, e.title, e.text, e.picture] for page, e in rows]
    text = json.dumps(texts, ensure_ascii=False, separators=(",", ":"))
    (book / INDEX_FILE).write_text(f"window.thesisEntries={text};\n", encoding="utf-8")


def _list_thesis(pages: Mapping[str, list[SearchEntry]]) -> Iterator[tuple[str, SearchEntry]]:
    """Yield figures, tables and equations of the thesis that have no entry of their own name."""
    index = "thesis-index.html"
    named = {entry.title for entries in pages.values() for entry in entries}
    for one in read_index() if index in pages else ():
        title = one.item.capitalize()
        if title in named:
            continue
        name, _, anchor = one.page.partition("#")
        page = f"{name}.html" if f"{name}.html" in pages else index
        known = {place for entry in pages[page] for place in entry.places}
        places = [place for place in (anchor, f"equation-{anchor}") if place in known]
        text = f"In the thesis: {one.what}. {one.reason}".strip()
        yield page, SearchEntry("thesis", places, title, text)
