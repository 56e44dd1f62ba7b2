"""The interactive viewer of a parametric study, with or without a kernel.

`Viewer` is an anywidget for live notebooks. Beside its widget view it offers `static_html`, which
carries the same JavaScript and the data, and so runs in a page without a server or a network.
"""

import hashlib
import html
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ASSETS_FOLDER = Path(__file__).parent / "assets"
VIEWER_KINDS = ("beam", "plate", "sound")
_IMPORT_PATTERN = re.compile(
    r'^import (?:(?:(\w+)|\{[^}]*\}) from )?"\./(\w+)\.js";\n', re.MULTILINE
)


def read_asset(name: str) -> str:
    """Return the text of a file of the front ends."""
    return (ASSETS_FOLDER / name).read_text(encoding="utf-8")


COLOURS_CSS = read_asset("colours.css")
VIEWER_CSS = COLOURS_CSS + read_asset("viewer.css")
_INDENT_PATTERN = re.compile(r"^[ \t]+(?://.*\n)?|^//.*\n", re.MULTILINE)  # and lines of comment
NO_SCRIPT_TEXT = "This viewer needs JavaScript; the figures below show the same results."


def join_modules(front: str, *kinds: str) -> str:
    """Write a front end and what it imports as one module, without the panels of other kinds.

    What is called a worker is written as text: a page opened from a folder may load no other file,
    but can start one from what it holds.
    """
    modules = {kind: "" for kind in VIEWER_KINDS if kind not in kinds}

    def add_module(name: str, wanted: str = "") -> None:
        if name in modules:
            return
        if name.endswith("_worker") and wanted:
            program = _INDENT_PATTERN.sub("", join_modules(name))
            modules[name] = f"const {wanted} = {json.dumps(program)};\n"
            return
        modules[name] = ""  # a part stands behind those it needs, also if they need each other
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
    traits it reads: floats are written with 6 digits, NaN and infinities as null. `without` is said
    where there is no JavaScript; the printed book shows what `prints` as it first stands. The text
    is a function of the arguments alone and may stand on a page more than once.

    Raises
    ------
    ValueError
        If `esm` has not one ``export default``, or if `esm` or `css` would end its element.
    """
    body, exports = re.subn(r"^export default ", "const widget = ", esm, flags=re.MULTILINE)
    if exports != 1:
        raise ValueError(f"esm: {exports} lines start with 'export default', 1 expected")
    if re.search(r"</?script|<!--", esm, re.I) or re.search(r"</style", css, re.I):
        raise ValueError("esm or css: holds a tag or comment that would break out of its element")
    text = json.dumps(copy_plain(state), allow_nan=False, separators=(",", ":"))  # ASCII only
    text = re.sub("[<>&]", lambda match: f"\\u{ord(match[0]):04x}", text)  # no tag can begin or end
    key = hashlib.sha256("\0".join((esm, css, text)).encode()).hexdigest()[:16]
    css, body = (_INDENT_PATTERN.sub("", part).strip() for part in (css, body))
    parts = {"id": key, "css": css, "esm": body, "state": text}
    printed = " data-tl-print" if prints else ""
    return read_asset("fragment.html") % {
        **parts,
        "without": html.escape(without),
        "prints": printed,
    }
