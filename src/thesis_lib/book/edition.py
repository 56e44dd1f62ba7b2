"""What a page says of itself to those who cite it or point at it: edition, description, card."""

from __future__ import annotations

import json
import re
from html import escape, unescape

import yaml

from thesis_lib.files import project_root
from thesis_lib.studies import attributes

FILE = "_static/edition.js"
_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
_FIRST = re.compile(r'<article class="bd-article">.*?<h1>.*?</h1>.*?<p>(.*?)</p>', re.DOTALL)
_MARKUP = re.compile(r"<[^>]*>|\\[()]")
_KEY = {"og:": "property"}
_LONGEST = 200  # letters that are shown


def script() -> str:
    """The edition as a script that sets a variable: ``CITATION.cff``, the commit and its date."""
    file = project_root() / "CITATION.cff"
    cited = yaml.safe_load(file.read_text(encoding="utf-8")) if file.is_file() else {}
    edition = {
        "title": str(cited.get("title", "")),
        "authors": ", ".join(str(one["name"]) for one in cited.get("authors", ())),
        "version": str(cited.get("version", "")),
        "date": str(cited.get("date-released", "")),
        "commit": attributes._commit(),
    }
    return f"window.thesisEdition={json.dumps(edition, ensure_ascii=False)};\n"


def described(html: str, root: str) -> str:
    """The same page with a description, its first paragraph, and a card for where it is shared.

    Parameters
    ----------
    html : str
    root : str
        The book's folder from the page's place, such as ``../``.
    """
    title, first = _TITLE.search(html), _FIRST.search(html)
    if title is None or 'name="description"' in html:
        return html
    words = " ".join(unescape(_MARKUP.sub("", first[1])).split()) if first else ""
    if len(words) > _LONGEST:
        words = words[:_LONGEST].rpartition(" ")[0] + " …"
    name = unescape(title[1]).partition(" — ")[0]
    told = {
        "description": words or name,
        "og:type": "article",
        "og:title": name,
        "og:description": words or name,
        "og:image": f"{root}_static/card.png",
        "twitter:card": "summary_large_image",
    }
    metas = "".join(
        f'<meta {_KEY.get(key[:3], "name")}="{key}" content="{escape(text)}"/>\n'
        for key, text in told.items()
    )
    return html.replace(title[0], f"{title[0]}\n{metas}", 1)
