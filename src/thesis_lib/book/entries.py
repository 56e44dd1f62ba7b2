"""What a book's pages hold that can be looked for or shown before one goes there.

A page's own text says it, as it is written: headings, figures, equations, names of the library,
words explained, sources, claims. The search and the previews of links read all of it from one
script, since a page opened from a folder may fetch no other page.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import unescape
from html.parser import HTMLParser

from thesis_lib.facts.claims import read_index

FILE = "_static/entries.js"
_ARTICLE = re.compile(r'<article class="bd-article">(.*?)</article>', re.DOTALL)
_TAB = re.compile(r"<title>(.*?)(?: &#8212;.*?)?</title>")
_ASIDE = re.compile(r"<(script|style|noscript|svg|button|summary)\b.*?</\1>", re.DOTALL)
_CLAIMS = re.compile(r'^const state = (\{"data":\{"rows":.*\});$', re.MULTILINE)
_VOID = {"area", "br", "col", "hr", "img", "input", "link", "meta", "source", "wbr"}
_HEADINGS = {"h1", "h2", "h3", "h4", "h5", "h6"}
_THESIS = re.compile(r"(Figures? [\w.]+?)(?: of the thesis)?\. ")
_SKIPPED = {"headerlink", "caption-number", "cell_input", "sig-object", "tl-under-figure"}
_LONGEST = {"name": 300}  # letters of one entry: a name's signature and returns stand on its page


@dataclass
class Entry:
    """One thing that can be looked for."""

    kind: str  #: section, figure, equation, name, term, source, claim or thesis
    places: list[str]  #: Anchors on its page, the first of them its own
    title: str = ""
    text: str = ""
    picture: str = ""  #: Of a figure, from the page's place
    said: list[str] = field(default_factory=list, repr=False)  #: Parts of the text so far


def of_page(html: str) -> list[Entry]:
    """What a page holds, in its order; the first entry is the page itself.

    Examples
    --------
    >>> page = '<section id="a"><h1>A page</h1><p>Some words.</p></section>'
    >>> [one] = of_page(f'<article class="bd-article">{page}</article>')
    >>> one.kind, one.places, one.title, one.text
    ('section', ['a'], 'A page', 'Some words.')
    """
    article = _ARTICLE.search(html)
    if article is None:
        return []
    reader, tab = _Reader(), _TAB.search(html)
    reader.feed(_ASIDE.sub("", article[1]))
    for entry in reader.found:
        entry.text = " ".join("".join(entry.said).split())[: _LONGEST.get(entry.kind, 2000)]
        entry.said.clear()
        entry.title = _TITLES.get(entry.kind, _written)(entry)
    if tab and reader.found:
        reader.found[0].title = unescape(tab[1])  # as no other page is called
    return [*reader.found, *_claims(html)]


def _written(entry: Entry) -> str:
    return " ".join(entry.title.split())


def _figure(entry: Entry) -> str:
    """Its number in the thesis, or the first sentence below it."""
    name = _THESIS.match(entry.text)
    return name[1] if name else entry.text.partition(". ")[0].rstrip(".")


_TITLES = {
    "figure": _figure,
    "equation": lambda entry: f"Equation {_written(entry)}",
    "name": lambda entry: entry.places[0].removeprefix("thesis_lib."),
}


def _claims(html: str) -> Iterator[Entry]:
    """The rows of the ledger, which its page keeps as data."""
    for data in _CLAIMS.findall(html):
        for row in json.loads(data)["data"]["rows"]:
            words = f"{row['what']}. The thesis: {row['stated']}; here: {row['got']}"
            text = f"{row['place']}: {words} ({row['verdict']})."
            yield Entry("claim", [f"claim-{row['id']}"], f"Claim {row['id']}", text)


def script(pages: Mapping[str, list[Entry]]) -> str:
    """The entries of all pages as a script that sets a variable.

    Parameters
    ----------
    pages : mapping
        Entries by address of the page, such as ``executed/claims.html``.
    """
    rows = [(page, entry) for page, entries in sorted(pages.items()) for entry in entries]
    rows += _of_thesis(pages)
    texts = [[page, e.kind, e.places, e.title, e.text, e.picture] for page, e in rows]
    return f"window.thesisEntries={json.dumps(texts, ensure_ascii=False, separators=(',', ':'))};\n"


def _of_thesis(pages: Mapping[str, list[Entry]]) -> Iterator[tuple[str, Entry]]:
    """What of the thesis's figures, tables and equations has no entry of its own name."""
    index = "thesis-index.html"
    named = {entry.title for entries in pages.values() for entry in entries}
    for one in read_index() if index in pages else ():
        title = one.item.capitalize()
        if title in named:
            continue
        name, _, anchor = one.page.partition("#")
        page = f"{name}.html" if f"{name}.html" in pages else index
        places = {place for entry in pages[page] for place in entry.places}
        place = [one for one in (anchor, f"equation-{anchor}") if one in places]
        yield (
            page,
            Entry("thesis", place, title, f"In the thesis: {one.what}. {one.reason}".strip()),
        )


class _Reader(HTMLParser):
    """Entries of an article: text belongs to the innermost one that is open."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[Entry] = []
        self._open: list[str] = []  # elements
        self._at: list[tuple[int, Entry]] = []  # entries, with the depth at which they end
        self._silent = 0  # depth of what is left out
        self._title = 0  # depth of a title

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Open an element, and what can be looked for if it is that."""
        given = {name: value or "" for name, value in attributes}
        kinds, anchor = set(given.get("class", "").split()), given.get("id", "")
        if tag == "img":
            self._picture(given)
        if tag == "span" and anchor and self._at:  # a second name
            self._at[-1][1].places.append(anchor)
        if tag in _VOID:
            return
        if self._at and tag in {"td", "th"}:  # which need not be closed
            self._at[-1][1].said.append(" ")
        self._open.append(tag)
        depth = len(self._open)
        term = tag == "dt" and anchor.startswith("term-")
        if tag in {"section", "figure"} and anchor:
            self._begin(tag, anchor, depth)
        elif anchor.startswith("equation-"):
            self._begin("equation", anchor, depth)
        elif "citation" in kinds:
            self._begin("source", anchor, depth)
        elif term or "sig-object" in kinds:  # until its list ends: what explains it follows
            while self._at and self._at[-1][0] == depth - 1:
                self._at.pop()
            self._begin("term" if term else "name", anchor, depth - 1)
        if self._at and (term or tag in _HEADINGS or kinds & {"eqno", "label"}):
            self._title = self._title or depth
        elif kinds & _SKIPPED:
            self._silent = self._silent or depth

    def handle_endtag(self, tag: str) -> None:
        """Close an element, and what ends with it."""
        if tag in _VOID or tag not in self._open:
            return
        while self._open and self._open.pop() != tag:
            pass
        depth = len(self._open)
        self._title *= self._title <= depth
        self._silent *= self._silent <= depth
        while self._at and self._at[-1][0] > depth:
            self._at.pop()
        if self._at and tag in {"p", "li", "dd", "td", "th", "dt", "pre", "div"}:
            self._at[-1][1].said.append(" ")

    def handle_data(self, data: str) -> None:
        """Take words into the title or the text of what is open."""
        if self._silent or not self._at:
            return
        if self._title:
            self._at[-1][1].title += data
        else:
            self._at[-1][1].said.append(data)

    def _begin(self, kind: str, anchor: str, depth: int) -> None:
        entry = Entry(kind, [anchor])
        self.found.append(entry)
        self._at.append((depth, entry))

    def _picture(self, given: Mapping[str, str]) -> None:
        if self._at and self._at[-1][1].kind == "figure":
            self._at[-1][1].picture = given.get("src", "")
