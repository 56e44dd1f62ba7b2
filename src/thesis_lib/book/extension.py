"""What Sphinx does otherwise for this book; ``_config.yml`` names this module."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import toctree

from thesis_lib.book import writing
from thesis_lib.book.shown_code import ShownCode
from thesis_lib.files import digest_of

_BAR = re.compile(r"(?P<skip>``.*?``|`[^`]*`)|(?P<before>^|[\s'\"(\[{<\-/:=])\|(?=\S)")

_NUMBERED = (
    toctree, nodes.section, nodes.figure, nodes.table, nodes.container, nodes.literal_block,
    nodes.math_block,
)  # fmt: skip


def setup(app: Any) -> dict[str, bool]:
    """Connect all of it."""
    app.add_directive("computed-by", ShownCode)
    app.connect("env-get-outdated", _edited)
    app.connect("env-before-read-docs", _two_at_a_time)
    app.connect("doctree-read", _keep_bones)
    app.connect("env-get-updated", partial(_number_by, whole=False), priority=0)
    app.connect("env-get-updated", partial(_number_by, whole=True), priority=900)
    app.connect("env-updated", _remember)
    app.connect("write-started", _shorten_margin)
    app.connect("html-page-context", _tell_apart)
    app.connect("autodoc-process-docstring", _keep_bars)
    app.connect("autodoc-process-signature", _keep_readable)
    return writing.setup(app)


def _edited(_app: Any, env: Any, _added: Any, changed: set[str], removed: set[str]) -> list[str]:
    """Pages that do not hold what they held when they were read: contents count, not dates."""
    known: dict[str, str] = getattr(env, "thesis_contents", {})
    there = known.keys() - removed
    same = {page for page in there if known[page] == _contents(env, page)}
    changed -= same - env.reread_always  # nor those of files that were written alike
    return sorted(there - same)


def _two_at_a_time(app: Any, _env: Any, _pages: list[str]) -> None:
    """Let pages be read so: this extension does not say that it numbers sections afterwards."""
    app.extensions["sphinx_multitoc_numbering"].parallel_read_safe = True


def _remember(_app: Any, env: Any) -> list[str]:
    env.thesis_contents = {page: _contents(env, page) for page in env.all_docs}
    return []


def _contents(env: Any, page: str) -> str:
    """Digest of a page and of all files that went into it."""
    into = [env.doc2path(page), *(Path(env.srcdir, one) for one in env.dependencies.get(page, ()))]
    return digest_of(sorted(set(map(Path, into))))


def _keep_bones(app: Any, tree: nodes.document) -> None:
    """Keep of a page what can be numbered in the book, which counts through all pages."""
    app.env.metadata[app.env.docname]["thesis_bones"] = nodes.Element("", *_bones(tree))


def _bones(node: nodes.Element) -> list[nodes.Element]:
    """What in a node can be numbered; copies would hold the whole page."""
    found: list[nodes.Element] = []
    for part in node:
        if isinstance(part, nodes.caption | nodes.title):
            found.append(type(part)("", part.astext()))
        elif isinstance(part, nodes.Element):
            inside, own = _bones(part), isinstance(part, _NUMBERED)
            if inside or own:
                bone = type(part)(**part.attributes) if own else nodes.Element()
                bone += inside
                found.append(bone)
    return found


def _number_by(_app: Any, env: Any, *, whole: bool) -> list[str]:
    """Let Sphinx number figures and equations by the bones of pages: reading all takes seconds."""
    if whole:
        del env.get_doctree
    else:
        env.get_doctree = lambda page: env.metadata[page]["thesis_bones"]
    return []


def _shorten_margin(app: Any, _builder: Any) -> None:
    """Make the contents in the margin from titles alone.

    The theme drops headings there, but only after each page has copied those of all pages.
    """
    env = app.env
    titles = {page: _without_headings(contents) for page, contents in env.tocs.items()}

    def shorten(_app: Any, _page: str, _template: str, context: Any, _tree: Any) -> None:
        whole = context["toctree"]

        def margin(**options: Any) -> str:
            env.tocs, kept = titles, env.tocs
            try:
                return str(whole(**options))
            finally:
                env.tocs = kept

        context["toctree"] = margin

    app.connect("html-page-context", shorten, priority=0)


def _tell_apart(app: Any, page: str, _template: str, context: Any, _tree: Any) -> None:
    """Call a page whose title others have, too, after the page above it: *The beam: distance*."""
    env = app.env

    def title(name: str) -> str:
        own = {one: env.titles[one].astext() for one in env.titles}
        above = next((one for one, below in env.toctree_includes.items() if name in below), "")
        if list(own.values()).count(own[name]) < 2 or above in ("", env.config.root_doc):
            return own[name]
        return f"{own[above]}: {own[name][0].lower()}{own[name][1:]}"

    if page in env.titles:
        context["title"] = title(page)
        files = {app.builder.get_relative_uri(page, name): name for name in env.titles}
        for way in ("prev", "next"):
            if context.get(way):
                context[way]["title"] = title(files[context[way]["link"]])


def _without_headings(contents: nodes.bullet_list) -> nodes.bullet_list:
    """A page's own contents cut to its title and the pages below it."""
    short = contents.copy()
    for item in contents:
        title = item.copy()
        title += [part.deepcopy() for part in item if not isinstance(part, nodes.bullet_list)]
        if pages := [tree.deepcopy() for tree in item.findall(toctree)]:
            title += nodes.bullet_list("", *pages)
        short += title
    return short


def _keep_bars(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: Any) -> None:
    """Read ``|w|`` in a docstring as an absolute value: substitutions are not used there."""
    lines[:] = [_BAR.sub(lambda m: m["skip"] or f"{m['before']}\\|", line) for line in lines]


def _keep_readable(*event: Any) -> tuple[str, str]:
    """Write a default that is no expression, like ``<function f>``, as dots."""
    *_, signature, returns = event
    return re.sub(r"<(?:[^<>]|<\w+>)*>", "...", signature or ""), returns
