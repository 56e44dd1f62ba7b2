"""HTML pages from Jinja templates; a page loads nothing, which its own policy enforces."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup, escape
from pygments.formatters import HtmlFormatter  # type: ignore[import-untyped, unused-ignore]

from thesis_lib.web.fragment import read_asset

Picture = tuple[str, bytes]  # kind of file and content
_TEMPLATE_ROOT = Path(__file__).parents[1]


def render_html(template: str, **values: object) -> str:
    """Render a template, named by its path in the package; plain texts put in are escaped.

    Pages extend ``web/templates/page.html.j2`` and are given a `title`.
    """
    return _build_environment().get_template(template).render(values)


def render_lines(template: str, **values: object) -> list[str]:
    """Render a template of plain text, whose paragraphs become one line each."""
    text = _build_environment().get_template(template).render(values)
    return [" ".join(one.split()) for one in re.split(r"\n\s*\n", text) if one.strip()]


@cache
def _build_environment() -> jinja2.Environment:
    made = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATE_ROOT),
        autoescape=jinja2.select_autoescape(["html.j2"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"number": format_number, "frame": format_frame, "coded": format_code}
    made.filters |= {"address": data_address, "scrolled": _let_scroll}
    made.globals |= {"page_css": read_asset("page.css") + code_css(), "zip": zip}
    return made


def code_css() -> str:
    """Return the colours of program text, in light and dark pages."""
    light = HtmlFormatter(style="xcode", nobackground=True).get_style_defs(".highlight")
    dark = HtmlFormatter(style="github-dark", nobackground=True).get_style_defs(".highlight")
    return f"{light}\n@media (prefers-color-scheme: dark) {{\n{dark}\n}}"


def format_number(value: Any, form: str, scale: float = 1.0) -> str:
    """Return a number, times a scale, in a format; a dash for NaN.

    Examples
    --------
    >>> format_number(0.00123, ".3g", 1e3), format_number(float("nan"), ".3g")
    ('1.23', '—')
    """
    number = scale * float(value)
    return "—" if np.isnan(number) else format(number, form)


def format_frame(frame: Any) -> Markup:
    """Return a table of pandas."""
    return Markup(frame.to_html(index=False, border=0, na_rep="—"))


def format_code(text: str) -> Markup:
    """Return words in which names between backticks are code.

    Examples
    --------
    >>> format_code("Give `steady_interval_s` & wait.")
    Markup('Give <code>steady_interval_s</code> &amp; wait.')
    """
    return Markup(re.sub(r"`(.*?)`", r"<code>\1</code>", str(escape(text))))


def data_address(picture: Picture) -> str:
    """Return an image as an address that holds its content."""
    kind, content = picture
    mime = "image/svg+xml" if kind == "svg" else f"image/{kind}"
    return f"data:{mime};base64,{base64.b64encode(content).decode()}"


def _let_scroll(body: str) -> Markup:
    """Let wide blocks of text scroll, also by keyboard."""
    return Markup(str(body).replace("<pre>", '<pre tabindex="0">'))


def write_pictures(folder: Path, pictures: Iterable[tuple[str, Picture]]) -> None:
    """Write named images into the subfolder ``figures`` of a folder."""
    (folder / "figures").mkdir(exist_ok=True)
    for name, (kind, content) in pictures:
        (folder / "figures" / f"{name}.{kind}").write_bytes(content)
