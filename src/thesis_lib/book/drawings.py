"""Drawings of the book in fewer bytes: the same picture, told more shortly.

What :mod:`thesis_lib.book.images` leaves of a drawing is mostly letters, marks and small maps.
"""

from __future__ import annotations

import base64
import io
import re

import numpy as np

_MAP = re.compile(r'(?<=href="data:image/png;base64,)[^"]+(?=")')
_ROW = re.compile(
    r'<g style="(?P<style>[^"]*)">(?P<row>'
    r'<use href="#(?P<mark>\w+)" x="[\d.-]+" y="[\d.-]+"/>'
    r'(?:<use href="#(?P=mark)" x="[\d.-]+" y="[\d.-]+"/>){2,})</g>'
)
_PLACE = re.compile(r' x="([\d.-]+)" y="([\d.-]+)"')
_COLOURS = 256  # of a palette


def paletted(svg: str) -> str:
    """The same drawing with its maps of few colours as indices into a palette, pixel by pixel."""
    from PIL import Image

    def packed(match: re.Match[str]) -> str:
        picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(match[0]))).convert("RGBA"))
        colours, index = np.unique(picture.reshape(-1, 4), axis=0, return_inverse=True)
        if len(colours) > _COLOURS or np.any(colours[:, 3] < 255):
            return match[0]
        small = Image.fromarray(index.reshape(picture.shape[:2]).astype(np.uint8))
        small.putpalette(colours[:, :3].tobytes())
        image = io.BytesIO()
        small.save(image, "PNG", optimize=True)
        shorter = base64.b64encode(image.getvalue()).decode()
        return min(shorter, match[0], key=len)

    return _MAP.sub(packed, svg)


def rowed(svg: str) -> str:
    r"""The same drawing with each row of equal marks as one path that has the mark at its points.

    Examples
    --------
    >>> mark = '<use href="#a" x="1" y="2"/>'
    >>> print(rowed(f'<g style="fill:red">{3 * mark}</g>').replace("><", ">\n<"))
    <marker id="m0" overflow="visible" markerUnits="userSpaceOnUse" style="fill:red">
    <use href="#a"/>
    </marker>
    <path d="M1 2L1 2L1 2" style="fill:none;stroke:none;marker:url(#m0)"/>
    """
    known: dict[tuple[str, str], str] = {}

    def row(match: re.Match[str]) -> str:
        kind = match["style"], match["mark"]
        new = kind not in known
        name = known.setdefault(kind, f"m{len(known)}")
        marker = (
            f'<marker id="{name}" overflow="visible" markerUnits="userSpaceOnUse" '
            f'style="{kind[0]}"><use href="#{kind[1]}"/></marker>'
        )
        points = "L".join(f"{x} {y}" for x, y in _PLACE.findall(match["row"]))
        path = f'<path d="M{points}" style="fill:none;stroke:none;marker:url(#{name})"/>'
        return marker * new + path

    return _ROW.sub(row, svg)
