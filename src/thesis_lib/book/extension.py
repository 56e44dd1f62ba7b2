"""The Sphinx extension of the book: a directive, page titles and descriptions, two docstring fixes.

``_config.yml`` names this module among the extensions.
"""

import ast
import gc
import inspect
import re
from collections import Counter
from collections.abc import Callable
from html import unescape
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.transforms import SphinxTransform
from sphinx.util.docutils import SphinxDirective

from thesis_lib.book import find_figure_names
from thesis_lib.web.html import render_html

MAX_DESCRIPTION_LENGTH = 200
_BAR_PATTERN = re.compile(r"(?P<skip>``.*?``|`[^`]*`)|(?P<before>^|[\s'\"(\[{<\-/:=])\|(?=\S)")
_NO_EXPRESSION = re.compile(r"<(?:[^<>]|<\w+>)*>")


def setup(app: Any) -> dict[str, bool]:
    """Connect the directive and the event handlers to Sphinx."""
    gc.set_threshold(1_000_000, 50, 1000)  # all document trees stay: saves a third of the time
    app.add_directive("computed-by", ComputedBy)
    app.add_transform(LinkShownFigures)
    app.connect("builder-inited", _set_builder)
    app.connect("env-get-outdated", _find_outdated_pages)
    app.connect("env-before-read-docs", _clear_pages)
    app.connect("html-page-context", _describe_page)
    app.connect("autodoc-process-docstring", _escape_bars)
    app.connect("autodoc-process-signature", _shorten_defaults)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


class ComputedBy(SphinxDirective):
    """Show the source of a function, folded: ``{computed-by} vision.rounding.estimate``."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Parse the Markdown of the folded source text."""
        full = f"thesis_lib.{self.arguments[0]}"
        function, name = resolve_name(full), full.rpartition(".")[2]
        self.env.note_dependency(str(Path(inspect.getfile(function)).resolve()))
        return self.parse_text_to_nodes(
            f"::::{{dropdown}} In code: `{name}`\n:class-container: tl-code\n\n"
            f"{{py:func}}`{full}`, without its description:\n\n"
            f"```python\n{read_source(function)}\n```\n::::\n"
        )


class LinkShownFigures(SphinxTransform):
    """Replace figures on a notebook's page by links to the chapter that also shows them."""

    default_priority = 800  # before Sphinx collects the labels

    def apply(self, **_: Any) -> None:
        """Keep each figure's anchor, without its label, which belongs to the chapter's figure."""
        if not self.env.docname.startswith("executed/"):
            return
        for figure in [*self.document.findall(nodes.figure)]:
            for name in {*figure["names"]} & self.env.tl_shown:  # type: ignore[attr-defined]
                anchor = self.document.nameids.pop(name)
                del self.document.nametypes[name]
                caption = next(figure.findall(nodes.caption)).astext()
                words = " ".join(caption.partition(". ")[0].split()).rstrip(".")
                link = addnodes.pending_xref(
                    "", nodes.inline("", words), refdomain="std", reftype="ref", reftarget=name,
                    refexplicit=True, refwarn=True, refdoc=self.env.docname,
                )  # fmt: skip
                text = nodes.paragraph("", "", link, nodes.Text(" stands in the chapter."))
                text["ids"] = [anchor]
                self.document.ids[anchor] = text
                figure.replace_self(text)


def _find_outdated_pages(
    app: Any, env: Any, _added: set[str], _changed: set[str], removed: set[str]
) -> list[str]:
    """Find the figures that chapters show; if they changed, return the notebooks' pages.

    Pages of earlier builds whose sources no longer exist, which Sphinx keeps, are deleted.
    """
    for name in removed:
        for file in (f"{name}.html", f"_sources/{name}.*"):
            for path in Path(app.outdir).glob(file):
                path.unlink()
    before = getattr(env, "tl_shown", None)  # in the last build
    if before is None:  # all is read again: some pages may have no source any more
        for path in Path(app.outdir).rglob("*.html"):
            path.unlink()
    env.tl_shown = {*find_figure_names(Path(env.srcdir).glob("*.md"))}
    if before == env.tl_shown:
        return []
    return [name for name in env.found_docs if name.startswith("executed/")]


def _clear_pages(_app: Any, env: Any, pages: list[str]) -> None:
    """Clear all pages that are read again: a figure's label may move from one to another."""
    for name in pages:
        env.clear_doc(name)


def read_source(function: Callable[..., Any]) -> str:
    """Return the source text of a function without its docstring."""
    source = inspect.getsource(function)
    first, *rest = ast.parse(source).body[0].body  # type: ignore[attr-defined]
    lines = source.splitlines()
    if rest and isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
        del lines[first.lineno - 1 : first.end_lineno]
    return "\n".join(line for line in lines if line.strip()).strip()


def _set_builder(app: Any) -> None:
    """Disable Sphinx's search; load MathJax where Sphinx does not detect that it is needed."""
    app.builder.search = False
    if app.builder.name == "singlehtml":
        app.set_html_assets_policy("always")


def _describe_page(app: Any, page: str, _template: str, context: Any, tree: Any) -> None:
    """Give a page a unique title, a description and a preview card for sharing.

    Pages with the same title get that of their parent page in front: *The beam: distance*.
    """
    env = app.env
    titles = {name: title.astext() for name, title in env.titles.items()}
    count = Counter(titles.values())

    def name_page(name: str) -> str:
        above = next((one for one, below in env.toctree_includes.items() if name in below), "")
        title = titles[name]
        if count[title] < 2 or above in ("", env.config.root_doc):
            return title
        return f"{titles[above]}: {title[0].lower()}{title[1:]}"

    if page in titles:
        context["title"] = name_page(page)
        files = {app.builder.get_relative_uri(page, name): name for name in titles}
        for near in filter(None, map(context.get, ("prev", "next"))):
            near["title"] = name_page(files[near["link"]])
    title = unescape(context.get("title") or app.config.project)  # the general index has none here
    paragraphs = tree.findall(nodes.paragraph) if tree else ()
    first = next((one.astext() for one in paragraphs if one.astext().strip()), "")
    description = " ".join(first.split()) or title
    if len(description) > MAX_DESCRIPTION_LENGTH:
        description = description[:MAX_DESCRIPTION_LENGTH].rpartition(" ")[0] + " …"
    values = {"title": title, "description": description, "root": "../" * page.count("/")}
    tags = render_html("book/templates/metatags.html.j2", **values)
    context["metatags"] = f"{context.get('metatags', '')}\n{tags}"


def _escape_bars(*event: Any) -> None:
    """Escape ``|w|`` in a docstring: it is an absolute value, not a substitution."""
    *_, lines = event
    lines[:] = [
        _BAR_PATTERN.sub(lambda m: m["skip"] or f"{m['before']}\\|", line) for line in lines
    ]


def _shorten_defaults(*event: Any) -> tuple[str, str]:
    """Write a default that is no expression, such as ``<function f>``, as dots."""
    *_, signature, returns = event
    return _NO_EXPRESSION.sub("...", signature or ""), returns
