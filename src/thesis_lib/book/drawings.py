"""Drawings of the book: their size, and colours that follow the page in the dark."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from lxml import etree
from PIL import Image

DARK_GROUND, DARK_INK = (18, 18, 18), (222, 226, 230)  # of the book's pages in the dark
MIN_CONTRAST = 4.5  # WCAG 2 AA
MAX_GREY_SPREAD = 16  # largest difference of the parts of a colour that counts as grey
PX_PER_UNIT = {"pt": 4 / 3, "px": 1.0, "": 1.0}
_COLOUR_PATTERN = re.compile(r"#[0-9a-fA-F]{6}\b|#[0-9a-fA-F]{3}\b")
_LENGTH_PATTERN = re.compile(r"([\d.]+)(pt|px|)")
_COLOUR_ATTRIBUTES = ("style", "fill", "stroke", "stop-color")


def measure_image(path: Path) -> dict[str, str]:
    """Return width and height in CSS pixels and the panels of an image, as attributes of HTML."""
    if not path.is_file():
        return {}
    if path.suffix != ".svg":
        with Image.open(path) as photograph:
            width, height = photograph.size
        return {"width": str(width), "height": str(height)}
    _, root = next(etree.iterparse(path, events=("start",)))
    sides = [(side, _LENGTH_PATTERN.fullmatch(root.get(side, ""))) for side in ("width", "height")]
    found = {side: str(round(float(m[1]) * PX_PER_UNIT[m[2]])) for side, m in sides if m}
    if panels := root.get("data-panels"):
        found["data-panels"] = panels
    return found


def theme_drawing(path: Path) -> None:
    """Rewrite a drawing with colours that follow the page: other values in the dark.

    White becomes the page's ground there, black its ink, greys lie between, and colours are
    lightened until they have the contrast that text needs.
    """
    tree = etree.parse(path, etree.XMLParser(remove_comments=True, huge_tree=True))
    root = tree.getroot()
    colours = {"#000000"}

    def name_variable(match: re.Match[str]) -> str:
        colours.add(colour := lengthen_colour(match[0]))
        return f"var(--c{colour[1:]})"

    for element in root.iter(etree.Element):
        for name in _COLOUR_ATTRIBUTES:
            if value := element.get(name):
                element.set(name, _COLOUR_PATTERN.sub(name_variable, value))
    light = "".join(f"--c{one[1:]}:{one};" for one in sorted(colours))
    dark = "".join(f"--c{one[1:]}:{find_dark_colour(one)};" for one in sorted(colours))
    style = etree.Element("{http://www.w3.org/2000/svg}style")
    style.text = (
        f"svg{{{light}fill:var(--c000000)}}@media (prefers-color-scheme:dark){{svg{{{dark}}}}}"
    )
    root.insert(0, style)
    tree.write(path, encoding="utf-8")


def lengthen_colour(colour: str) -> str:
    """Return ``#rrggbb`` for ``#rgb``."""
    digits = colour[1:].lower()
    return "#" + (digits if len(digits) == 6 else "".join(2 * one for one in digits))


def find_dark_colour(colour: str) -> str:
    """Return the colour that replaces another, ``#rrggbb``, on the dark ground.

    Examples
    --------
    >>> find_dark_colour("#ffffff"), find_dark_colour("#000000"), find_dark_colour("#e69f00")
    ('#121212', '#dee2e6', '#e69f00')
    """
    rgb = tuple(int(colour[i : i + 2], 16) for i in (1, 3, 5))
    if max(rgb) - min(rgb) < MAX_GREY_SPREAD:
        share = sum(rgb) / 765
        pairs = zip(DARK_INK, DARK_GROUND, strict=True)
        return _format_colour([ink + share * (ground - ink) for ink, ground in pairs])
    ground = compute_luminance(DARK_GROUND) + 0.05
    for step in range(101):
        lighter = [one + (255 - one) * step / 100 for one in rgb]
        if compute_luminance(lighter) + 0.05 >= MIN_CONTRAST * ground:
            break
    return _format_colour(lighter)


def compute_luminance(rgb: Sequence[float]) -> float:
    """Return the relative luminance, from 0 to 1, of a colour with parts from 0 to 255 (WCAG)."""
    parts = [one / 255 for one in rgb]
    linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _format_colour(rgb: Sequence[float]) -> str:
    return "#" + "".join(f"{round(one):02x}" for one in rgb)
