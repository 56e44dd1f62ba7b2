"""An extension of Sphinx for the book of one chapter: what points elsewhere stays as words."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.transforms.post_transforms import SphinxPostTransform

_TOLD = "in another chapter of the book"
_LINK = re.compile(r'<a href="([^":?#]*)\.html[^>]*>(.*?)</a>', re.DOTALL)


class Elsewhere(SphinxPostTransform):
    """Makes words of references to pages that are not there, before these are warned of."""

    default_priority = 8  # MyST's own has 9

    def run(self, **_: Any) -> None:
        """Replace all such references of a page."""
        domains = self.env.domains
        known = {*self.env.found_docs, *domains["math"].equations}
        known.update(domains["std"].labels, domains["std"].anonlabels)
        for node in list(self.document.findall(pending_xref)):
            if node["refdomain"] not in ("doc", "cite") and node["reftarget"] not in known:
                words = "an equation" if node["reftype"] == "eq" else node.astext()
                node.replace_self(nodes.abbreviation("", words, explanation=_TOLD))


def _words(app: Any, _page: str, source: list[str]) -> None:
    """Do the same to what a page points at by an address."""

    def told(link: re.Match[str]) -> str:
        there = link[1] in app.env.found_docs
        return link[0] if there else f'<abbr title="{_TOLD}">{link[2]}</abbr>'

    source[0] = _LINK.sub(told, source[0])


def setup(app: Any) -> dict[str, bool]:
    """Have Sphinx use this; the project of a chapter's book names it."""
    app.connect("source-read", _words)
    app.add_post_transform(Elsewhere)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
