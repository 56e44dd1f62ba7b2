"""Names and roles that the theme and its extensions leave out of the rendered pages, put in.

What is said here of a page's own markup is checked in a browser by
``tests/book/test_accessibility.py``.
"""

from __future__ import annotations

import re

_MENDS = [
    # The arrow that folds a part of the contents has no name: it is called after its page.
    (
        r'(<a class="[^"]*\binternal"[^>]*>\s*([^<]*?)\s*</a><details[^>]*><summary)>',
        r'\1 aria-label="Pages below: \2">',
    ),
    # These have a text of their own, which another name hides from who speaks to the browser.
    (r'(<button class="btn search-button-field[^>]*?) aria-label="Search"', r"\1"),
    (r'<summary aria-label="Toggle hidden content">', "<summary>"),
    # The search has no page of its own.
    (r'(<form class="bd-search[^>]*?)\s+action="[^"]*"\s+method="get"', r"\1"),
    # The icons' titles would be a text beside the button's name.
    (r'(<i class="theme-switch [^>]*?)\s+title="[^"]*"', r"\1"),
    # The side bar holds the book's title and the search beside its contents.
    (
        r'(<div id="pst-primary-sidebar") (class=)',
        r'\1 role="region" aria-label="Title and contents" \2',
    ),
    # A head without words is no head.
    (r"<th\b([^>]*)>(?:<p>)?\s*(?:</p>)?</th>", r"<td\1></td>"),
    # A list holds items. Their own role, of bibliographies, is no longer used.
    (r'(<div class="citation"[^>]*) role="doc-biblioentry"', r'\1 role="listitem"'),
]
_COMPILED = [(re.compile(pattern), replacement) for pattern, replacement in _MENDS]


def mend(html: str) -> str:
    """The same page with names and roles where its markup lacks them.

    Examples
    --------
    >>> mend('<summary aria-label="Toggle hidden content"><p>Show the source</p></summary>')
    '<summary><p>Show the source</p></summary>'
    """
    for pattern, replacement in _COMPILED:
        html = pattern.sub(replacement, html)
    return html
