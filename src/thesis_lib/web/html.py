"""HTML pages from Jinja templates, and fragments with a widget's program and data.

A page loads nothing, which its content security policy enforces. A fragment contains its
JavaScript, and so runs in a page without a kernel, a server or a network.
"""

import base64
import hashlib
import html
import json
import math
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup, escape
from pygments.formatters import HtmlFormatter  # type: ignore[import-untyped, unused-ignore]

Picture = tuple[str, bytes]  # kind of file and content
_TEMPLATE_ROOT = Path(__file__).parents[1]


def render_html(template: str, **values: object) -> str:
    """Render a template, named by its path in the package; inserted plain text is escaped.

    Pages extend ``web/templates/page.html.j2`` and are given a `title`.
    """
    return _build_environment().get_template(template).render(values)


def render_lines(template: str, **values: object) -> list[str]:
    """Render a template of plain text, whose paragraphs become one line each."""
    text = _build_environment().get_template(template).render(values)
    return [" ".join(one.split()) for one in re.split(r"\n\s*\n", text) if one.strip()]


def build_environment(folder: Path, **options: Any) -> jinja2.Environment:
    """Return an environment for templates in a folder; an undefined value is an error."""
    options |= {"loader": jinja2.FileSystemLoader(folder), "undefined": jinja2.StrictUndefined}
    return jinja2.Environment(trim_blocks=True, lstrip_blocks=True, **options)


@cache
def _build_environment() -> jinja2.Environment:
    autoescape = jinja2.select_autoescape(["html.j2"])
    made = build_environment(_TEMPLATE_ROOT, autoescape=autoescape)
    made.filters |= {
        "number": format_number,
        "frame": lambda frame: Markup(frame.to_html(index=False, border=0, na_rep="—")),
        "coded": format_code,
        "address": data_address,
        # Wide blocks of text can be scrolled, also by keyboard.
        "scrolled": lambda body: Markup(str(body).replace("<pre>", '<pre tabindex="0">')),
    }
    light, dark = (  # colours of program text
        HtmlFormatter(style=style, nobackground=True).get_style_defs(".highlight")
        for style in ("xcode", "github-dark")
    )
    code_css = f"{light}\n@media (prefers-color-scheme: dark) {{\n{dark}\n}}"
    made.globals |= {"page_css": read_asset("page.css") + code_css, "zip": zip}
    return made


def format_number(value: Any, spec: str = ".0f", missing: str = "—", *, scale: float = 1.0) -> str:
    """Format a number, or an array of one value, times a scale; `missing` stands for NaN.

    Examples
    --------
    >>> format_number(np.array(0.00123), ".3g", scale=1e3), format_number(np.nan, ".2f")
    ('1.23', '—')
    """
    number = scale * float(value)
    return missing if np.isnan(number) else format(int(number) if spec == "d" else number, spec)


def format_code(text: str) -> Markup:
    """Format names between backticks as code, and escape the text.

    Examples
    --------
    >>> format_code("Give `steady_interval_s` & wait.")
    Markup('Give <code>steady_interval_s</code> &amp; wait.')
    """
    return Markup(re.sub(r"`(.*?)`", r"<code>\1</code>", str(escape(text))))


def data_address(picture: Picture) -> str:
    """Return an image as a data URL."""
    kind, content = picture
    mime = "image/svg+xml" if kind == "svg" else f"image/{kind}"
    return f"data:{mime};base64,{base64.b64encode(content).decode()}"


def write_pictures(folder: Path, pictures: Iterable[tuple[str, Picture]]) -> None:
    """Write named images into the subfolder ``figures`` of a folder."""
    (folder / "figures").mkdir(exist_ok=True)
    for name, (kind, content) in pictures:
        (folder / "figures" / f"{name}.{kind}").write_bytes(content)


ASSETS_FOLDER = Path(__file__).parent / "assets"
VIEWER_KINDS = ("beam", "plate", "sound")
_IMPORT_PATTERN = re.compile(
    r'^import (?:(?:(\w+)|\{[^}]*\}) from )?"\./(\w+)\.js";\n', re.MULTILINE
)


def read_asset(name: str) -> str:
    """Return the text of a front-end file."""
    return (ASSETS_FOLDER / name).read_text(encoding="utf-8")


COLOURS_CSS = read_asset("colours.css")
VIEWER_CSS = COLOURS_CSS + read_asset("viewer.css")
_INDENT_PATTERN = re.compile(r"^[ \t]+(?://.*\n)?|^//.*\n", re.MULTILINE)  # and comment lines
NO_SCRIPT_TEXT = "This viewer needs JavaScript; the figures below show the same results."


def join_modules(front: str, *kinds: str) -> str:
    """Bundle a front end and its imports as one module, without the panels of other kinds."""
    modules = {kind: "" for kind in VIEWER_KINDS if kind not in kinds}

    def add_module(name: str, wanted: str = "") -> None:
        if name in modules:
            return
        modules[name] = ""  # a module follows its imports, also if these are circular
        text = read_asset(f"{name}.js")
        for default, needed in _IMPORT_PATTERN.findall(text):
            add_module(needed, default)
        del modules[name]
        text = re.sub(r"^export (?!default )", "", _IMPORT_PATTERN.sub("", text), flags=re.M)
        modules[name] = (
            text.replace("\nexport default ", f"\nconst {wanted} = ") if wanted else text
        )

    add_module(front)
    return "".join(modules.values())


def copy_plain(value: object) -> Any:
    """Copy JSON data: floats to 6 significant digits, NaN and infinities to None."""
    if isinstance(value, Mapping):
        return {str(key): copy_plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [copy_plain(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


def static_html(
    esm: str,
    css: str,
    state: Mapping[str, object],
    without: str = NO_SCRIPT_TEXT,
    prints: bool = False,
) -> str:
    """Write a widget as a self-contained HTML fragment that needs no kernel, server or network.

    `esm` is its front end, an ES module whose one ``export default`` has `render`, and `state` the
    traits it reads: floats are written with 6 digits, NaN and infinities as null. `without` is the
    text without JavaScript; with `prints`, the printed book shows the initial state. The fragment
    depends on the arguments alone and may occur on a page more than once.
    """
    body = re.sub(r"^export default ", "const widget = ", esm, flags=re.MULTILINE)
    text = json.dumps(copy_plain(state), allow_nan=False, separators=(",", ":"))  # ASCII only
    text = re.sub("[<>&]", lambda match: f"\\u{ord(match[0]):04x}", text)  # no tag can begin or end
    key = hashlib.sha256("\0".join((esm, css, text)).encode()).hexdigest()[:16]
    css, body = (_INDENT_PATTERN.sub("", part).strip() for part in (css, body))
    return read_asset("fragment.html") % {
        "id": key,
        "css": css,
        "esm": body,
        "state": text,
        "without": html.escape(without),
        "prints": " data-tl-print" if prints else "",
    }
