"""Pictures of the rendered book: loaded when they come near the screen, and no larger than needed.

A page with many figures is so painted at once, and does not move while they arrive, since their
sizes are known before.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
import struct
from pathlib import Path
from urllib.parse import unquote

_IMAGE = re.compile(r'<img (?P<rest>[^>]*?src="(?P<source>[^":]+)"[^>]*?)(?P<end>\s*/?>)')
_INLINE = re.compile(r'src="data:image/svg\+xml;base64,(?P<drawing>[A-Za-z0-9+/=\s]{20000,})"')
_SVG = re.compile(r"<svg\b[^>]*>")
_LENGTH = re.compile(r'\s(width|height)="([\d.]+)(pt|px|)"')
_PX = {"pt": 4 / 3, "px": 1.0, "": 1.0}
_PLACES = re.compile(r'(\s(?:d|x|y|x1|x2|y1|y2|points)=")([^"]*)"')
_LONG = re.compile(r"-?\d+\.\d{3,}(?![\de])")
_STYLE = re.compile(r'(?<=\sstyle=")[^"]*')
_MARK = r'<use href="[^"]+" x="[^"]+" y="[^"]+"'
_MARKS = re.compile(rf'{_MARK} style="(?P<style>[^"]*)"/>(?:{_MARK} style="(?P=style)"/>)+')
_SHIFTED = re.compile(r'(<use href="[^"]+") transform="translate\(([\d.-]+)(?: 0)?\)"(?=/>)')
_IDLE = re.compile(r"<metadata>.*?</metadata>|<!--.*?-->|(?<=>)\s*\n\s*(?=<)", re.DOTALL)
_XLINK = re.compile(r'xlink:(?=href)|\sxmlns:xlink="[^"]*"')
_ID = re.compile(r'\sid="([^"]*)"')
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')
_PNG = b"\x89PNG\r\n\x1a\n"


def in_files(html: str, folder: Path, images: Path) -> str:
    """The same page, standing in `folder`, with its long inline drawings as files of `images`.

    They are named by their content, and read only when seen.
    """

    def take_out(match: re.Match[str]) -> str:
        drawing = base64.b64decode(match["drawing"])
        file = images / f"{hashlib.sha256(drawing).hexdigest()}.svg"
        file.write_bytes(drawing)
        return f'src="{Path(os.path.relpath(file, folder)).as_posix()}"'

    return _INLINE.sub(take_out, html)


def lazy(html: str, folder: Path) -> str:
    """The same page, standing in `folder`, with its local pictures loaded when needed.

    A picture that is not there, or whose size is not told by its file, stays as it is.
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


def squeeze(svg: str) -> str:
    r"""The same drawing in fewer letters: short names and places, nothing idle or twice.

    Places are rounded to a hundredth of their unit.

    Examples
    --------
    >>> squeeze('<svg>\n <!-- a -->\n <path d="M 1.23456 -0.00012 L 20 3e-05"/>\n</svg>')
    '<svg><path d="M1.23 0L20 3e-05"/></svg>'
    """

    def short(match: re.Match[str]) -> str:
        text = f"{float(match[0]):.2f}".rstrip("0").rstrip(".")
        return "0" if text == "-0" else text

    def places(match: re.Match[str]) -> str:
        values = re.sub(r"\s*([A-Za-z\s])\s*", r"\1", match[2].strip())
        return f'{match[1]}{_LONG.sub(short, values)}"'

    def together(match: re.Match[str]) -> str:
        style = f' style="{match["style"]}"'
        return f"<g{style}>{match[0].replace(style, '')}</g>"

    if "<text" in svg:
        return svg
    spare = _XLINK.sub("", svg)  # SVG 2 needs no such names
    used = {match[2] for match in _REFERENCE.finditer(spare)}
    names = {one: f"a{n}" for n, one in enumerate(one for one in _ID.findall(spare) if one in used)}
    spare = _ID.sub(lambda match: f' id="{names[match[1]]}"' if match[1] in names else "", spare)
    spare = _REFERENCE.sub(lambda match: match[1] + names.get(match[2], match[2]), spare)
    spare = _STYLE.sub(lambda match: re.sub(r"\s*([:;])\s*", r"\1", match[0]), spare)
    spare = _SHIFTED.sub(r'\1 x="\2"', spare)  # a letter of a word
    return _MARKS.sub(together, _PLACES.sub(places, _IDLE.sub("", spare)))
