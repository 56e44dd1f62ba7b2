"""Where the panels of a drawing are, so that a phone can show one below the other.

A drawing of several panels side by side is too small there to be read. Matplotlib writes each panel
as a group; its box is that of what is drawn in it, labels included.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Iterator
from html import unescape
from itertools import pairwise

from thesis_lib.plotting.style import BELOW

Box = tuple[float, float, float, float]  # left, top, right, bottom

_TOLD = re.compile(r'<svg\b[^>]* data-panels="([^"]*)"')
_VIEW = re.compile(r'<svg\b[^>]* viewBox="0 0 ([\d.]+) ([\d.]+)"')
_DEFS = re.compile(r"<defs>.*?</defs>", re.DOTALL)
_CLIP = re.compile(
    r'<clipPath id="([^"]+)">\s*<rect x="(\S+)" y="(\S+)" width="(\S+)" height="(\S+)"'
)
_TOKEN = re.compile(r"<(/?)(g|path|text|tspan)\b([^>]*?)(/?)>([^<]*)", re.DOTALL)
_ATTRIBUTE = re.compile(r'(\S+?)="([^"]*)"', re.DOTALL)
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
_PLACED = re.compile(r"translate\(([-\d.]+)[ ,]([-\d.]+)\)( rotate\(-90\))?")
_TURNED = re.compile(r"rotate\(-90 ([-\d.]+) ([-\d.]+)\)")
_SIZE = re.compile(r"font-size:\s*([\d.]+)")
_ANCHOR = {"text-anchor: middle": 0.5, "text-anchor: end": 1.0}
_ABOVE, _BELOW = 0.76, 0.22  # of a text, in parts of its size
_MARGIN = 3.0
_NARROW = 0.13  # of the drawing's width


def panels(svg: str) -> str:
    """The boxes of a drawing's panels, ``left top width height`` in % of it, from top to bottom.

    Empty if it has but one column of them, or is not of Matplotlib.
    """
    told, view = _TOLD.search(svg), _VIEW.search(svg)
    if told or not view:
        return told[1] if told else ""
    width, height = float(view[1]), float(view[2])
    boxes = _columns(_joined(_boxes(svg, width, height)), width)
    if not any(_abreast(*two) for two in pairwise(boxes)):
        return ""
    return ";".join(
        f"{100 * left / width:.1f} {100 * top / height:.1f} "
        f"{100 * (right - left) / width:.1f} {100 * (bottom - top) / height:.1f}"
        for left, top, right, bottom in boxes
    )


def with_panels(svg: str) -> str:
    """The drawing, saying itself where its panels are."""
    found = panels(svg)
    return svg.replace("<svg ", f'<svg data-panels="{found}" ', 1) if found else svg


def _joined(boxes: Iterable[tuple[Box, bool]]) -> list[Box]:
    """Boxes, of which one that goes with the one above it is part of that."""
    found: list[Box] = []
    for box, goes in boxes:
        above = [
            one for one in found if one[0] < (box[0] + box[2]) / 2 < one[2] and one[1] < box[1]
        ]
        if goes and above:
            over = found.index(max(above, key=lambda one: one[1]))
            left, top, right, bottom = zip(found[over], box, strict=True)
            found[over] = min(left), min(top), max(right), max(bottom)
        else:
            found.append(box)
    return found


def _boxes(svg: str, width: float, height: float) -> Iterator[tuple[Box, bool]]:
    """The box of each panel and of what stands beside them, and if it goes with the one above."""
    clips = {
        name: (x, y, x + w, y + h)
        for name, *told in _CLIP.findall(svg)
        for x, y, w, h in [map(float, told)]
    }
    panel: list[Box] = []
    depth, begun, goes, moved = 0, 0, False, (0.0, 0.0, False)
    for ends, tag, attributes, alone, words in _TOKEN.findall(_DEFS.sub("", svg)):
        given = dict(_ATTRIBUTE.findall(attributes))
        if tag == "g" and ends:
            if begun and depth == begun:
                yield from [(_around(panel, width, height), goes)] if panel else []
                panel, begun = [], 0
            depth -= 1
        elif tag == "g" and not alone:
            depth += 1
            if depth == 2 and not given.get("id", "").startswith("patch_"):
                begun, goes = depth, given.get("id", "").startswith(BELOW)
            moved = _axes(given)
        elif begun and words.strip() and (size := _SIZE.search(given.get("style", ""))):
            axes = _axes(given) if tag == "text" else moved
            panel.append(_text(given, unescape(words), float(size[1]), axes))
        elif begun and tag == "path" and given.get("d") != "none":
            numbers = [float(one) for one in _NUMBER.findall(given.get("d", ""))]
            clip = clips.get(given.get("clip-path", "")[5:-1], (0.0, 0.0, width, height))
            if len(numbers) >= 4:
                panel.append(_within(numbers, clip))


def _axes(given: dict[str, str]) -> tuple[float, float, bool]:
    """Where a text's own axes begin, and whether they are turned by a quarter."""
    transform = given.get("transform", "")
    if turned := _TURNED.match(transform):  # about a place that is told in the drawing's axes
        x, y = float(turned[1]), float(turned[2])
        return x - y, y + x, True
    placed = _PLACED.match(transform)
    return (float(placed[1]), float(placed[2]), bool(placed[3])) if placed else (0.0, 0.0, False)


def _text(given: dict[str, str], words: str, size: float, axes: tuple[float, float, bool]) -> Box:
    """The box of words that begin, end or have their middle at a place of their own axes."""
    long, above, below = size * sum(map(_advance, words)), _ABOVE * size, _BELOW * size
    style, (left, top, turned) = given.get("style", ""), axes
    before = long * next((part for anchor, part in _ANCHOR.items() if anchor in style), 0.0)
    x, y = float(given.get("x", 0)) - before, float(given.get("y", 0))
    if turned:
        return left + y - above, top - x - long, left + y + below, top - x
    return left + x, top + y - above, left + x + long, top + y + below


@functools.cache
def _advance(letter: str) -> float:
    """Width of a letter in parts of its size."""
    from matplotlib.font_manager import findfont, get_font
    from matplotlib.ft2font import LoadFlags

    font = get_font(findfont("DejaVu Sans"))
    glyph = font.load_char(ord(letter), flags=LoadFlags.NO_SCALE)
    return float(glyph.horiAdvance / font.units_per_EM)


def _within(numbers: list[float], clip: Box) -> Box:
    xs, ys = numbers[::2], numbers[1::2]
    return (
        max(min(xs), clip[0]), max(min(ys), clip[1]), min(max(xs), clip[2]), min(max(ys), clip[3])
    )  # fmt: skip


def _around(boxes: list[Box], width: float, height: float) -> Box:
    kept = [one for one in boxes if one[0] <= one[2] and one[1] <= one[3]]
    left, top = (min(one[i] for one in kept) - _MARGIN for i in (0, 1))
    right, bottom = (max(one[i] for one in kept) + _MARGIN for i in (2, 3))
    return max(left, 0.0), max(top, 0.0), min(right, width), min(bottom, height)


def _columns(boxes: list[Box], width: float) -> list[Box]:
    """The boxes in the order of reading; a narrow one is the scale of the one on its left."""
    wide = [one for one in boxes if one[2] - one[0] > _NARROW * width]
    for narrow in (one for one in boxes if one not in wide):
        beside = [one for one in wide if one[0] < narrow[0] and _abreast(one, narrow)]
        if beside:
            left = max(beside)
            wide[wide.index(left)] = _around([left, narrow], narrow[2], max(left[3], narrow[3]))
        else:
            wide.append(narrow)
    rows: list[list[Box]] = []
    for one in sorted(wide, key=lambda one: one[1]):
        if rows and _abreast(rows[-1][0], one):
            rows[-1].append(one)
        else:
            rows.append([one])
    return [one for row in rows for one in sorted(row)]


def _abreast(one: Box, other: Box) -> bool:
    """Whether one is beside the other by more than half of the lower one's height."""
    common = min(one[3], other[3]) - max(one[1], other[1])
    return common > 0.5 * min(one[3] - one[1], other[3] - other[1])
