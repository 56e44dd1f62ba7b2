"""Pictures of the rendered book: loaded when they come near the screen, and no larger than needed.

A page with many figures is so painted at once, and does not move while they arrive, since their
sizes are known before.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain, count, product
from pathlib import Path
from string import ascii_letters
from urllib.parse import unquote

from PIL import Image

from thesis_lib.book.panels import panels

_IMAGE = re.compile(r'<img (?P<rest>[^>]*?src="(?P<source>[^":]+)"[^>]*?)(?P<end>\s*/?>)')
_INLINE = re.compile(r'src="data:image/svg\+xml;base64,(?P<drawing>[A-Za-z0-9+/=\s]{20000,})"')
_SVG = re.compile(r"<svg\b[^>]*>")
_LENGTH = re.compile(r'\s(width|height)="([\d.]+)(pt|px|)"')
_PX = {"pt": 4 / 3, "px": 1.0, "": 1.0}
_PLACES = re.compile(r'(\s(?:d|x|y|x1|x2|y1|y2|points)=")([^"]*)"')
_MOVED = re.compile(r"(?<=translate\()[\d. -]+(?=\))")
_LONG = re.compile(r"-?\d+\.\d{3,}(?![\de])")
_STYLE = re.compile(r'(?<=\sstyle=")[^"]*')
_MARK = r'<use href="[^"]+" x="[^"]+" y="[^"]+"'
_MARKS = re.compile(rf'{_MARK} style="(?P<style>[^"]*)"/>(?:{_MARK} style="(?P=style)"/>)+')
_FAMILY = re.compile(r"(?:;\s*)?font-family:\s*'DejaVu Sans'[^;\"]*")
_UPRIGHT = re.compile(r' transform="rotate\(-0 [^"]*"')
_FONT = "'DejaVu Sans',Verdana,sans-serif"  # on most systems one of them, as wide as drawn
_COLOUR = re.compile(
    r'(?<=[\s";{])((?:fill|stroke|stop-color)(?::\s*|="))(#[0-9a-fA-F]{6}|#[0-9a-fA-F]{3})\b'
)
_GROUND, _INK = (18, 18, 18), (222, 226, 230)  # of the book's pages in the dark
_IDLE = re.compile(
    r"(?P<words><text\b(?:(?!</text>).)*</text>)"
    r"|<metadata>.*?</metadata>|<!--.*?-->|(?<=>)\s*\n\s*(?=<)",
    re.DOTALL,
)
_BEFORE = re.compile(r"\s+(?=<tspan x=)|(?<=</tspan>)\s+(?=</text>)")
_GROUP = re.compile(r"(<g(?: [^>]*)?/?>|</g>)")
_XLINK = re.compile(r'xlink:(?=href)|\sxmlns:xlink="[^"]*"')
_ID = re.compile(r'\sid="([^"]*)"')
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')
_PATH = re.compile(r'(?<=\sd=")[MLQCz\d\s.-]+(?=")')
_STEP = re.compile(r"([MLQCz])([^MLQCz]*)")
_WORN = re.compile(r'\sstyle="([^"]*)"')


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
        told += _panels(folder / unquote(match["source"]))
        return f'<img {match["rest"]}{told} loading="lazy"{match["end"]}'

    return _IMAGE.sub(mend, html)


def _panels(picture: Path) -> str:
    """Where a drawing's panels are, as an attribute of its image."""
    if picture.suffix != ".svg":
        return ""
    found = panels(picture.read_text(encoding="utf-8"))
    return f' data-panels="{found}"' if found else ""


def size_px(picture: Path) -> tuple[int, int] | None:
    """Width and height of a drawing or photograph in CSS pixels, or None if it tells none."""
    if not picture.is_file():
        return None
    if picture.suffix != ".svg":
        with Image.open(picture) as photograph:
            return photograph.size
    with picture.open("rb") as stream:
        tag = _SVG.search(stream.read(4096).decode("utf-8", errors="replace"))
    found = _LENGTH.findall(tag[0]) if tag else []
    sides = {name: round(float(value) * _PX[unit]) for name, value, unit in found}
    return (sides["width"], sides["height"]) if len(sides) == 2 else None


def squeeze(svg: str) -> str:
    r"""The same drawing in fewer letters: short names and places, nothing idle or twice.

    Places are rounded to a hundredth of their unit. Words keep their spaces.

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

    def idle(match: re.Match[str]) -> str:
        return _BEFORE.sub("", match["words"] or "")  # what stands at a place of its own

    spare = _XLINK.sub("", svg)  # SVG 2 needs no such names
    used, there = Counter(match[2] for match in _REFERENCE.finditer(spare)), {*_ID.findall(spare)}
    often = [one for one, _ in used.most_common() if one in there]
    names = dict(zip(often, map("".join, _short_names()), strict=False))
    spare = _ID.sub(lambda match: f' id="{names[match[1]]}"' if match[1] in names else "", spare)
    spare = _REFERENCE.sub(lambda match: match[1] + names.get(match[2], match[2]), spare)
    spare = _STYLE.sub(lambda match: re.sub(r"\s*([:;])\s*", r"\1", match[0]), spare)
    spare = _MOVED.sub(lambda match: _LONG.sub(short, match[0]), spare)
    return _MARKS.sub(together, _ungrouped(_PLACES.sub(places, _IDLE.sub(idle, spare))))


def _short_names() -> Iterator[tuple[str, ...]]:
    """Of letters alone, one and then two and more: what is used most is named first."""
    return chain.from_iterable(product(ascii_letters, repeat=n) for n in count(1))


def _ungrouped(svg: str) -> str:
    """The same drawing without groups that say nothing of what they hold."""
    parts, plain = [], []
    for part in _GROUP.split(svg):
        if part.startswith("<g") and not part.endswith("/>"):
            plain.append(part == "<g>")
        idle = part in ("<g>", "<g/>") or (part == "</g>" and plain.pop())
        parts.append("" if idle else part)
    return "".join(parts)


def relative(svg: str) -> str:
    """The same drawing with paths whose points are told from the point before, in fewer digits.

    Points have two places at most, so that sums of steps are exact.

    Examples
    --------
    >>> relative('<path d="M10 20.5L10.25 20.5Q11 21 9 19z"/>')
    '<path d="M10 20.5l.25 0q.75 .5-1.25-1.5z"/>'
    """

    def number(hundredths: int) -> str:
        text = f"{abs(hundredths) / 100:.2f}".rstrip("0").rstrip(".").removeprefix("0") or "0"
        return f"-{text}" if hundredths < 0 else text

    def row(values: Sequence[int]) -> str:
        return " ".join(map(number, values)).replace(" -", "-")

    def path(match: re.Match[str]) -> str:
        steps, x, y, start = [], 0, 0, (0, 0)
        for name, told in _STEP.findall(match[0]):
            points = [round(100 * float(value)) for value in told.split()]
            size = {"M": 2, "L": 2, "Q": 4, "C": 6, "z": 1}[name]
            if name == "z":
                steps.append("z")
                x, y = start
            for i in range(0, len(points), size):
                part = points[i : i + size]
                away = [one - (y if k % 2 else x) for k, one in enumerate(part)]
                steps.append(f"M{row(part)}" if name == "M" else name.lower() + row(away))
                x, y = part[-2:]
                start = (x, y) if name == "M" else start
        return "".join(steps)

    return _PATH.sub(path, svg)


def worded(svg: str) -> str:
    """The same drawing with the font of its words told once."""
    style = f"<style>svg{{font-family:{_FONT}}}</style>"
    short, found = _FAMILY.subn("", _UPRIGHT.sub("", svg))
    return _SVG.sub(lambda tag: tag[0] + style, short, count=1) if found else svg


def classed(svg: str) -> str:
    """The same drawing with each style that stands there more than once told at its head.

    Examples
    --------
    >>> classed('<svg><g style="fill:red"/><g style="fill:red"/></svg>')
    '<svg><style>.s0{fill:red}</style><g class="s0"/><g class="s0"/></svg>'
    """
    often = [style for style, n in Counter(_WORN.findall(svg)).items() if n > 1]
    if not often or "class=" in svg:
        return svg
    names = {style: f"s{n}" for n, style in enumerate(often)}
    rules = "".join(f".{name}{{{style}}}" for style, name in names.items())
    worn = _WORN.sub(lambda m: f' class="{names[m[1]]}"' if m[1] in names else m[0], svg)
    return _SVG.sub(lambda tag: f"{tag[0]}<style>{rules}</style>", worn, count=1)


def themed(svg: str) -> str:
    """The same drawing in colours that follow the page: variables, with other values in the dark.

    White is the page's ground there, black its ink, greys lie between, and colours are as much
    lighter as they need to be seen.
    """
    colours = sorted({_long(match[2]) for match in _COLOUR.finditer(svg)} | {"#000000"})
    named = _COLOUR.sub(lambda match: f"{match[1]}var(--c{_long(match[2])[1:]})", svg)
    light = "".join(f"--c{one[1:]}:{one};" for one in colours)
    dark = "".join(f"--c{one[1:]}:{in_the_dark(one)};" for one in colours)
    style = f"svg{{{light}fill:var(--c000000)}}@media (prefers-color-scheme:dark){{svg{{{dark}}}}}"
    return _SVG.sub(lambda tag: f"{tag[0]}<style>{style}</style>", named, count=1)


def in_the_dark(colour: str) -> str:
    """The colour that stands for another, ``#rrggbb``, on the dark ground.

    Examples
    --------
    >>> in_the_dark("#ffffff"), in_the_dark("#000000"), in_the_dark("#e69f00")
    ('#121212', '#dee2e6', '#e69f00')
    """
    rgb = tuple(int(colour[i : i + 2], 16) for i in (1, 3, 5))
    if max(rgb) - min(rgb) < 16:
        share = sum(rgb) / 765
        return _hex(
            tuple(ink + share * (ground - ink) for ink, ground in zip(_INK, _GROUND, strict=True))
        )
    for step in range(101):
        lighter = tuple(one + (255 - one) * step / 100 for one in rgb)
        if (luminance(lighter) + 0.05) / (luminance(_GROUND) + 0.05) >= 4.5:
            break
    return _hex(lighter)


def luminance(rgb: Sequence[float]) -> float:
    """How light a colour with parts from 0 to 255 is, from 0 to 1 (WCAG)."""
    parts = [one / 255 for one in rgb]
    linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _hex(rgb: Sequence[float]) -> str:
    return "#" + "".join(f"{round(one):02x}" for one in rgb)


def _long(colour: str) -> str:
    """``#rrggbb`` for ``#rgb``."""
    digits = colour[1:].lower()
    return "#" + (digits if len(digits) == 6 else "".join(2 * one for one in digits))
