"""What a page says of itself to those who cite it or point at it: edition, description, card."""

from __future__ import annotations

import json
import re
from html import escape, unescape
from urllib.parse import quote

import yaml

from thesis_lib.files import project_root
from thesis_lib.studies import attributes

FILE = "_static/edition.js"
_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
_FIRST = re.compile(r'<article class="bd-article">.*?<h1>.*?</h1>.*?<p>(.*?)</p>', re.DOTALL)
_MARKUP = re.compile(r"<[^>]*>|\\[()]")
_NAME = re.compile(r'<details class="tl-provenance" id="provenance-([\w-]+)"')
_BUTTONS = re.compile(r'<div class="article-header-buttons">')
_BINDER = "https://mybinder.org/v2"
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


def launched(html: str) -> str:
    """The same page with a button that runs its notebook on Binder.

    Only where ``_config.yml`` names a repository, and only on pages of figure sets.
    """
    file, name = project_root() / "_config.yml", _NAME.search(html)
    configured = yaml.safe_load(file.read_text(encoding="utf-8")) if file.is_file() else {}
    repository = configured.get("repository") or {}
    address = str(repository.get("url") or "").rstrip("/").removesuffix(".git")
    if not address or name is None:
        return html
    branch = repository.get("branch") or "main"
    _, github, place = address.partition("https://github.com/")
    where = f"gh/{place}" if github else f"git/{quote(address, safe='')}"
    href = f"{_BINDER}/{where}/{branch}?urlpath=lab/tree/notebooks/{name[1]}.ipynb"
    button = (
        f'<a class="btn btn-sm pst-navbar-icon tl-binder" href="{escape(href)}" '
        'aria-label="Run on Binder" title="Run on Binder">'
        '<i class="fa-solid fa-rocket" aria-hidden="true"></i></a>'
    )
    return _BUTTONS.sub(lambda found: found[0] + button, html, count=1)


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
