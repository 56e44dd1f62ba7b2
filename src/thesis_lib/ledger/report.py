"""The ledger's verdicts as lines of text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from thesis_lib.ledger.entries import CHAPTERS, Entry, totals


def report(found: Sequence[Entry]) -> str:
    """The ledger as text: counts by chapter, then the entries that differ or are undefined."""
    lines = []
    for chapter in CHAPTERS:
        of_chapter = [entry for entry in found if entry.chapter == chapter]
        lines.append(f"chapter {chapter}")
        for kind in ("figure", "trend", "number"):
            part = [entry for entry in of_chapter if entry.kind == kind]
            if part:
                counts = ", ".join(f"{n} {verdict}" for verdict, n in totals(part).items() if n)
                apart = sum(not entry.counted for entry in part)
                why = "bookkeeping" if kind == "number" else "by rendered recordings"
                mark = f"   ({apart} {why})" if apart else ""
                lines.append(f"  {len(part):3} {kind + 's':8} {counts}{mark}")
    counted = [entry for entry in found if entry.counted]
    counts = ", ".join(f"{n} {verdict}" for verdict, n in totals(counted).items())
    lines.append(f"in all, without rendered recordings and bookkeeping: {counts}")
    differing = [entry for entry in found if entry.verdict == "differs"]
    lines += ["\ndiffers:"] if differing else []
    for entry in differing:
        ratio = f"  ×{entry.ratio:.2f}" if entry.ratio is not None else ""
        modes = f" mode {', '.join(map(str, entry.modes))}" if entry.modes else ""
        case = f"case {entry.case}{modes}: " if entry.case else ""
        what = f"{entry.what.rstrip('.')}: {entry.stated} → {entry.got}{ratio}"
        lines.append(f"  {entry.place}, {case}{what}; {entry.note}")
    reasons = Counter(entry.note for entry in found if entry.verdict == "undefined")
    lines += ["\nundefined:"] if reasons else []
    lines += [f"  {number:3} × {reason}" for reason, number in reasons.items()]
    return "\n".join(lines)
