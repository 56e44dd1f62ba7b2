"""The contents in the margin: the parts of the book, of which the one that is read lies open."""

from __future__ import annotations

import re

_PART = re.compile(
    r'<p aria-level="2" class="caption" role="heading"><span class="caption-text">(?P<name>.*?)'
    r'</span></p>\s*(?P<pages><ul class="(?P<here>current )?nav bd-sidenav">.*?</ul>)'
    r"(?=\s*(?:<p aria-level|</div>))",
    re.DOTALL,
)


def fold(html: str) -> str:
    """The same page with the parts of its contents folded, but for its own.

    A part of one page is that page.
    """
    return _PART.sub(_folded, html)


def _folded(part: re.Match[str]) -> str:
    name, pages, here = part["name"], part["pages"], " open" if part["here"] else ""
    if pages.count("<li ") == 1:
        return pages
    summary = f'<summary class="caption"><span class="caption-text">{name}</span></summary>'
    return f'<details class="tl-part"{here}>{summary}{pages}</details>'
