"""Boxes of a figure's panels, so that a phone can show one below the other."""

from __future__ import annotations

from itertools import pairwise

from matplotlib.figure import Figure

Box = tuple[float, float, float, float]  # left, top, right, bottom in fractions of the figure

BELOW_PANEL = "below"
"""Prefix of the name of a panel that belongs to the one above it, also on a phone."""
MARGIN_PT = 3.0
MAX_SCALE_WIDTH = 0.13  # fraction of the figure's width: what is narrower is a colour scale


def find_panels(figure: Figure) -> str:
    """Return the boxes of a figure's panels, ``left top width height`` in %, in reading order.

    The text is empty if the panels stand in one column. The figure has been laid out.
    """
    boxes: list[Box] = []
    for artist in (*figure.axes, *figure.legends, *figure.texts):
        extent = artist.get_tightbbox()
        if extent is None or not artist.get_visible():
            continue
        extent = extent.padded(MARGIN_PT * figure.dpi / 72).transformed(
            figure.transFigure.inverted()
        )
        box = (max(extent.x0, 0), max(1 - extent.y1, 0), min(extent.x1, 1), min(1 - extent.y0, 1))
        middle = (box[0] + box[2]) / 2
        above = [one for one in boxes if one[0] < middle < one[2] and one[1] < box[1]]
        if above and str(artist.get_gid() or "").startswith(BELOW_PANEL):
            upper = max(above, key=lambda one: one[1])
            boxes[boxes.index(upper)] = _join(upper, box)
        else:
            boxes.append(box)
    boxes = _sort_for_reading(_join_scales(boxes))
    if not any(_abreast(*two) for two in pairwise(boxes)):
        return ""
    return ";".join(
        f"{100 * left:.1f} {100 * top:.1f} {100 * (right - left):.1f} {100 * (bottom - top):.1f}"
        for left, top, right, bottom in boxes
    )


def _join_scales(boxes: list[Box]) -> list[Box]:
    """Join each narrow box, a colour scale, with the panel on its left."""
    panels = [one for one in boxes if one[2] - one[0] > MAX_SCALE_WIDTH]
    for scale in (one for one in boxes if one not in panels):
        left = [one for one in panels if one[0] < scale[0] and _abreast(one, scale)]
        if left:
            panels[panels.index(max(left))] = _join(max(left), scale)
        else:
            panels.append(scale)
    return panels


def _sort_for_reading(boxes: list[Box]) -> list[Box]:
    """Sort boxes by row, and from left to right in each row."""
    rows: list[list[Box]] = []
    for box in sorted(boxes, key=lambda one: one[1]):
        if rows and _abreast(rows[-1][0], box):
            rows[-1].append(box)
        else:
            rows.append([box])
    return [box for row in rows for box in sorted(row)]


def _join(one: Box, other: Box) -> Box:
    """Return the box around two boxes."""
    return (*map(min, one[:2], other[:2]), *map(max, one[2:], other[2:]))  # type: ignore[return-value]


def _abreast(one: Box, other: Box) -> bool:
    """Return whether two boxes overlap vertically by more than half of the lower one's height."""
    common = min(one[3], other[3]) - max(one[1], other[1])
    return common > 0.5 * min(one[3] - one[1], other[3] - other[1])
