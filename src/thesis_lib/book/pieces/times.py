"""Where the minutes go, as a table of the page of benchmarks."""

from __future__ import annotations

from thesis_lib.studies import times
from thesis_lib.text import duration
from thesis_lib.web.markdown import table

MOST = 20
NOT_YET = "Nothing was timed yet.\n"
SAID = {"book": "step of `thesis book`", "tests": "file of tests, `make test-all`"}


def piece() -> str:
    """The longest of the published times of each kind, and the sum of all."""
    known = times.read(times.published_path())
    parts = []
    if not any(known.values()):
        return NOT_YET
    for kind, words in SAID.items():
        taken = known[kind]
        rows = [
            [f"`{name}`", f"{seconds:.1f}", f"{seconds / loop:.0f}"]
            for name, (seconds, loop) in list(taken.items())[:MOST]
        ]
        total = sum(seconds for seconds, _ in taken.values())
        rest = f"The longest {len(rows)} of {len(taken)}; all of them take {duration(total)}"
        parts.append(table([words, "seconds", "loops"], rows) + f"\n{rest} of one core or two.\n")
    return "\n".join(parts)
