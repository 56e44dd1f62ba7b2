"""Pictures that a page loads only when they come near the screen, with their sizes known before.

A page with many figures is so painted at once, and does not move while they arrive.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path
from urllib.parse import unquote

_IMAGE = re.compile(r'<img (?P<rest>[^>]*?src="(?P<source>[^":]+)"[^>]*?)(?P<end>\s*/?>)')
_SVG = re.compile(r"<svg\b[^>]*>")
_LENGTH = re.compile(r'\s(width|height)="([\d.]+)(pt|px|)"')
_PX = {"pt": 4 / 3, "px": 1.0, "": 1.0}
_PNG = b"\x89PNG\r\n\x1a\n"


def lazy(html: str, folder: Path) -> str:
    """The same page with its local pictures loaded when needed.

    Parameters
    ----------
    html : str
        A page.
    folder : pathlib.Path
        Where it stands; addresses of pictures are relative to it. A picture that is not there, or
        whose size is not told by its file, stays as it is.
    """

    def mend(match: re.Match[str]) -> str:
        size = size_px(folder / unquote(match["source"]))
        if size is None or "loading=" in match["rest"]:
            return match[0]
        told = "" if "width=" in match["rest"] else f' width="{size[0]}" height="{size[1]}"'
        return f'<img {match["rest"]}{told} loading="lazy"{match["end"]}'

    return _IMAGE.sub(mend, html)


def size_px(picture: Path) -> tuple[int, int] | None:
    """Width and height of an SVG or PNG file in CSS pixels, or None if it does not tell them."""
    if not picture.is_file():
        return None
    with picture.open("rb") as stream:
        head = stream.read(4096)
    if head.startswith(_PNG):
        width, height = struct.unpack(">II", head[16:24])
        return width, height
    tag = _SVG.search(head.decode("utf-8", errors="replace"))
    found = _LENGTH.findall(tag[0]) if tag else []
    sides = {name: round(float(value) * _PX[unit]) for name, value, unit in found}
    return (sides["width"], sides["height"]) if len(sides) == 2 else None
