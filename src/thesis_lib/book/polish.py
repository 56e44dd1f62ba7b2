"""What Sphinx has written, made smaller and more accessible, file by file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any
from urllib.parse import quote

from thesis_lib.book import viewers
from thesis_lib.book.accessible import mend
from thesis_lib.book.contents import fold
from thesis_lib.book.drawings import paletted, rowed
from thesis_lib.book.edition import described, launched
from thesis_lib.book.images import classed, in_files, lazy, relative, squeeze, themed, worded
from thesis_lib.book.intervals import drawn
from thesis_lib.book.panels import with_panels

# nor icons of firms, nor those drawn by a script, nor Sphinx's search
_UNUSED = ("fa-brands-*", "fontawesome.js", "searchtools.js", "language_data.js")
_SPARE = re.compile(
    r'<script type="application/vnd\.jupyter\.widget-state\+json">.*?</script>\s*'
    r'|<script defer src="[^"]*/fontawesome\.js[^"]*"></script>\s*'
    r'|<script src="[^"]*(?:searchtools|language_data|searchindex)\.js"></script>\s*'
    r'|(?<=<div id="jb-print-toc">).*?(?=</div>\s*</div>\s*</div>\s*<div id="searchbox">)'
    r'|<span class="(?:[nopw]|nn|nb|bp|[vf]m|m[ifo]|s[ai]|kc)">(?P<p><span class="pre">)?'
    r"(?P<text>[^<]*)</span>(?(p)</span>)",
    re.DOTALL,
)  # what widgets and style sheets repeat, contents on paper, marks of words that need no colour
_ALIKE = re.compile(r'<span class="(s2|sd|c1)">[^<]*(?:</span>\s+<span class="\1">[^<]*)+</span>')
_AGAIN = re.compile(r'</span>(\s+)<span class="\w+">')
_WHOLE = re.compile(
    r"(<(?:pre|script|style|textarea)\b.*?</(?:pre|script|style|textarea)>)", re.DOTALL
)
_BETWEEN = re.compile(
    r"<!--.*?-->|(?<=\n)\s+|[ \t]+(?=\n)", re.DOTALL
)  # comments, indents, empty lines
_VIEWPORT = re.compile(r'<meta (?:content="[^"]*" )?name="viewport"[^>]*>\s*')
_HEAD = re.compile(r"(?<=<head>).*?(?=</head>)", re.DOTALL)
_SHOWN = re.compile(rb"(_(?:images|viewers)/[^\"]+)")
# What theme and extensions write into the console of every page.
_CHATTER = re.compile(
    r"""console\.(?:log|info|debug)\(\s*(?:"\[PST\][^"]*"|`\[(?:PST|togglebutton)\][^`]*`),?\s*\)"""
)


def polish(book: Path, files: Iterable[Path]) -> None:
    """Polish some pages, drawings or notebooks of a book.

    A page's long drawings become files of their own, which are still to be polished.
    """
    for file in files:
        text = file.read_text(encoding="utf-8")
        if file.suffix == ".html":
            text = in_files(_SPARE.sub(r"\g<text>", text), file.parent, book / "_images")
            text = _ALIKE.sub(lambda match: _AGAIN.sub(r"\1", match[0]), text)
            text = viewers.shared(text, file.parent, book)
            text = _plain(lazy(drawn(mend(fold(text))), file.parent))
            text = described(launched(text), "../" * (len(file.relative_to(book).parts) - 1))
        else:
            text = _drawing(text) if file.suffix == ".svg" else _slim(text)
        file.write_text(text, encoding="utf-8")


def _drawing(text: str) -> str:
    """A drawing in fewer letters, in colours that follow the page."""
    return themed(classed(relative(rowed(paletted(squeeze(worded(with_panels(text.strip()))))))))


def _plain(text: str) -> str:
    """A page without its indents and comments, and with one viewport."""
    parts = _WHOLE.split(_HEAD.sub(_one_viewport, text, count=1))  # in turns between, and whole
    return "".join(part if i % 2 else _BETWEEN.sub("", part) for i, part in enumerate(parts))


def _one_viewport(head: re.Match[str]) -> str:
    first, *_ = [*_VIEWPORT.findall(head[0]), ""]
    return first + _VIEWPORT.sub("", head[0])


def _slim(text: str) -> str:
    """A notebook without what its page shows: pictures and widgets."""
    notebook: dict[str, Any] = json.loads(text)
    notebook["metadata"].pop("widgets", None)
    for cell in notebook["cells"]:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            for kind in [kind for kind in data if not kind.startswith("text/")]:
                del data[kind]
                output["metadata"].pop(kind, None)  # its words, which the cell has, too
            if len(data) > 1:  # what a widget or a table is in a page
                data.pop("text/html", None)
    return json.dumps(notebook, ensure_ascii=False, indent=1)


def tidy(book: Path) -> None:
    """Remove what no page needs: sources of styles, pictures no longer shown, idle messages."""
    _once(book)
    shown = {name for page in book.rglob("*.html") for name in _SHOWN.findall(page.read_bytes())}
    files = chain(book.glob("_images/*"), book.glob("_viewers/*"))
    idle = [one for one in files if quote(one.relative_to(book).as_posix()).encode() not in shown]
    unread = [
        book.glob(f"_static/**/{name}")
        for name in ("*.map", "*.ttf", "*.[mp]o", *_UNUSED, "overview.svg")
    ]
    for file in chain(idle, *unread):
        file.unlink()
    for name in ("scripts/pydata-sphinx-theme.js", "togglebutton.js"):
        script = book / "_static" / name
        script.write_text(_CHATTER.sub("0", script.read_text(encoding="utf-8")), encoding="utf-8")


def _once(book: Path) -> None:
    """Let pages that show the same drawing share one file."""
    drawings = {file.name: file.read_bytes() for file in sorted(book.glob("_images/*.svg"))}
    first: dict[bytes, str] = {}
    kept = {name: first.setdefault(drawing, name) for name, drawing in drawings.items()}
    other = {quote(name): quote(one) for name, one in kept.items() if name != one}
    if not other:
        return
    named = re.compile(rf'(?<=_images/)(?:{"|".join(map(re.escape, other))})(?=")')
    for page in book.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        shorter = named.sub(lambda match: other[match[0]], text)
        if shorter != text:
            page.write_text(shorter, encoding="utf-8")
