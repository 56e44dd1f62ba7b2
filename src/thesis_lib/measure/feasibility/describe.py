"""An assessment in words, for a terminal."""

from __future__ import annotations

import textwrap

import numpy as np

from thesis_lib.measure.feasibility.limits import Assessment
from thesis_lib.measure.feasibility.outlook import CameraOutlook

COLUMNS = 100
HEAD = "camera,mm/px,size px,gap px,motion px,blur px,lost,sharp mm,depths mm,view,spacings"


def describe(assessment: Assessment) -> list[str]:
    """Lines to print: tables, then warnings, then what was not checked; 100 columns."""
    rows = [tuple(HEAD.split(","))] + [_row(one) for one in assessment.table]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    widths[0] = min(widths[0], max(6, COLUMNS - sum(widths[1:]) - 2 * len(widths[1:])))
    lines = [
        "  ".join([_cut(row[0], widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows
    ]
    rig = assessment.rig
    lines += ["", f"{'standard error of the deflection, mm':<52}{'rms':>10}{'worst':>10}"]
    for what, values in (
        (f"one frame, centres that scatter {rig.noise_px:g} px", rig.one_frame),
        (f"harmonic fit of {rig.steady_s:g} s, {rig.frames} frames", rig.fit),
        ("whole-pixel centres, one frame near a maximum", rig.rounding),
    ):
        lines.append(f"  {what:<50}{_number(values[0]):>10}{_number(values[1]):>10}")
    lines.append(
        f"{'smallest deflection, noise of centres alone, mm':<62}{_number(rig.smallest_mm):>10}"
    )
    alike: dict[tuple[str, ...], list[str]] = {}
    for one in assessment.warnings:
        alike.setdefault((one.code, one.text, one.where.split("]")[-1]), []).append(one.where)
    notes = []
    for (code, text, _), where in alike.items():
        more = f" and {len(where) - 1} more" if len(where) > 1 else ""
        notes.append(f"warning: {where[0]}{more}: {text} [{code}]")
    notes += [f"not checked: {line}" for line in assessment.unknown]
    for note in notes:
        lines += textwrap.wrap(note, COLUMNS, subsequent_indent="  ", break_on_hyphens=False)
    return lines


def _cut(text: str, width: int) -> str:
    return text.ljust(width) if len(text) <= width else text[: width - 1] + "…"


def _row(one: CameraOutlook) -> tuple[str, ...]:
    return (
        one.name,
        _number(one.ground_sample_mm),
        _pair(one.along_px, one.across_px, "x", 1),
        _number(one.gap_px),
        _number(one.motion_px),
        _number(one.blur_px),
        _share(one.lost, 1),
        _pair(one.near_mm, one.far_mm),
        _pair(one.nearest_mm, one.farthest_mm),
        _share(one.in_view),
        _number(one.move_spacings),
    )


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3g}"


def _pair(low: float, high: float, between: str = "-", digits: int = 0) -> str:
    known = [f"{v:.{digits}f}" for v in (low, high) if not np.isnan(v)]
    return between.join(known) or "-"


def _share(value: float, digits: int = 0) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}%}"
