"""Self-contained pages: an executed notebook, or a list of links, as one HTML file.

They are for single runs; the book is rendered by :mod:`thesis_lib.book.rendering`.
"""

import re
import threading
from collections.abc import Mapping, Sequence
from functools import cache, partial
from html import escape
from pathlib import Path
from typing import Any

import nbformat
from markdown_it import MarkdownIt
from markupsafe import Markup
from mdit_py_plugins.dollarmath import dollarmath_plugin

from thesis_lib.files import workplace
from thesis_lib.web.html import render_html

MATHJAX_PATH = "mathjax/tex-svg-full.js"
"""Path of MathJax inside ``build/assets``: one file, drawing with SVG, without fonts to load."""
NPM_PACKAGES = {
    "mathjax": ("es5/tex-svg-full.js", "LICENSE"),
    "minisearch": ("dist/umd/index.js", "LICENSE.txt"),
}
"""Files that pages need from each package; they are in the folder of the package's name."""

_MIME_ORDER = [
    "text/html", "image/svg+xml", "image/png", "image/jpeg", "image/gif", "text/markdown",
    "text/latex", "text/plain",
]  # fmt: skip
_TEMPLATE_FOLDER = Path(__file__).with_name("templates")
_RENDERING = threading.Lock()  # mdurl fills a cache that other threads read before it is full
_BOOK_LINK = re.compile(r'<a href="(?![\w+.-]+:|#|[^"]*\.html)[^"]*">(.*?)</a>', re.DOTALL)


def export_notebook(notebook: Path, title: str) -> str:
    """Return an executed notebook as one self-contained HTML page.

    Its cells may carry the tags ``hide-input``, ``remove-input``, ``remove-output`` and
    ``remove-cell``, and ``mystnb`` metadata: ``figure.name``, ``figure.caption`` and ``image.alt``.
    The page holds MathJax if the notebook has equations and the assets are installed in
    ``build/assets`` of the project; otherwise equations stay as TeX.
    """
    from nbconvert import HTMLExporter  # takes a second to import
    from traitlets.config import Config

    executed = nbformat.read(notebook, as_version=4)
    exporter = HTMLExporter(
        template_name="notebook",
        extra_template_basedirs=[str(_TEMPLATE_FOLDER)],
        filters={
            "markdown": partial(_render_markdown, html=True),
            "output_markdown": partial(_render_markdown, html=False),
        },
        config=Config({"NbConvertBase": {"display_data_priority": _MIME_ORDER}}),
    )
    body, _ = exporter.from_notebook_node(executed)
    mathjax = mathjax_path()
    script = ""
    if 'class="math ' in body and mathjax.is_file():
        script = mathjax.read_text(encoding="utf-8").replace("</script", "<\\/script")
    return _frame_page(title, body, script)


def _frame_page(title: str, body: str, mathjax: str = "") -> str:
    page = "web/templates/page.html.j2"
    return render_html(page, title=title, body=Markup(body), mathjax=Markup(mathjax))


def mathjax_path() -> Path:
    """Return the path of MathJax, which exists once a book was rendered."""
    return workplace() / "build" / "assets" / MATHJAX_PATH


def index_page(title: str, entries: Sequence[tuple[str, str]]) -> str:
    """Return a small self-contained page of links, each with its label and relative address."""
    items = "".join(
        f'<li><a href="{escape(href)}">{escape(label)}</a></li>\n' for label, href in entries
    )
    return _frame_page(title, f"<h1>{escape(title)}</h1>\n<ul>\n{items}</ul>\n")


@cache
def _build_parser(html: bool) -> MarkdownIt:
    parser = (
        MarkdownIt("commonmark", {"html": html})
        .enable("table")
        .use(dollarmath_plugin, renderer=_format_equation, double_inline=True)
    )
    rules: dict[str, Any] = parser.renderer.rules  # type: ignore[attr-defined]
    rules["table_open"] = lambda *_: '<div class="scroll" tabindex="0"><table>\n'
    rules["table_close"] = lambda *_: "</table></div>\n"
    return parser


def _render_markdown(source: str, html: bool) -> str:
    """Render Markdown; a link into the book, which is not there, becomes plain text.

    `html` allows HTML in the source: in the notebook's own cells, but not in the output of
    programs, which may contain user text.
    """
    with _RENDERING:
        text = str(_build_parser(html).render(source))
    return _BOOK_LINK.sub(r"\1", text)


def _format_equation(tex: str, options: Mapping[str, Any]) -> str:
    """Return one equation in the delimiters of MathJax."""
    if not options.get("display_mode"):
        return f'<span class="math inline">\\({escape(tex.strip())}\\)</span>'
    return f'<div class="math block">\\[{escape(tex.strip())}\\]</div>\n'
