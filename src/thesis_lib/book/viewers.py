"""Front ends of viewers as files that pages share; what a page shows in them stays in the page."""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path

FOLDER = "_viewers"
_FRONT = re.compile(
    r'<style>(?P<css>(?:(?!</style).)*)</style>\s*<script type="module">\n'
    r"(?P<esm>(?:(?!</script).)*?)\n(?=const state = [^\n]*\nfunction createModel)",
    re.DOTALL,
)
_FRONTS = "window.thesisFronts"
_ALONE = (  # said where a page was copied without the book
    "this.insertAdjacentText('beforebegin', 'The viewer that stands here needs the whole book.')"
)


def shared(html: str, folder: Path, book: Path) -> str:
    """The same page, standing in `folder`, with the programs and styles of viewers in files.

    They are named by their content. A page opened from a folder may load no module, but a script,
    whose function gives the front end; both run when the page is read, in their order.
    """

    def take_out(match: re.Match[str]) -> str:
        name = _name(match["esm"])
        js = f"({_FRONTS} ??= {{}})['{name}'] = () => {{\n{match['esm']}\nreturn widget;\n}};\n"
        style, script = f"{_name(match['css'])}.css", f"{name}.js"
        (book / FOLDER).mkdir(exist_ok=True)
        (book / FOLDER / style).write_text(match["css"], encoding="utf-8")
        (book / FOLDER / script).write_text(js, encoding="utf-8")
        place = Path(os.path.relpath(book / FOLDER, folder)).as_posix()
        return (
            f'<link rel="stylesheet" href="{place}/{style}">\n'
            f'<script defer src="{place}/{script}" onerror="{_ALONE}"></script>\n'
            '<script type="module">\n'
            f"const widget = {_FRONTS}['{name}']();\n"
        )

    return _FRONT.sub(take_out, html)


def _name(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]
