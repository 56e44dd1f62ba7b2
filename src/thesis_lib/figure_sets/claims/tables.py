"""What the page of the ledger shows, from its cube: totals, tables, pictures."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import xarray as xr
from IPython.display import Markdown
from scipy.stats import binomtest

from thesis_lib.facts.readings import READINGS
from thesis_lib.figure_sets.claims import power, readings
from thesis_lib.figure_sets.claims.widget import LedgerTable
from thesis_lib.ledger import entries as ledger
from thesis_lib.ledger import trend_tests
from thesis_lib.ledger.cube import from_cube
from thesis_lib.ledger.trends import CONFIDENT, RESAMPLES
from thesis_lib.ledger.verdicts import UNCHANGED, VERDICTS, WIDER, WIDER_BELOW_10
from thesis_lib.web.markdown import markdown_table, table

KINDS = {"figure": "stated values", "trend": "trends", "number": "stray numbers"}
_IMPORTANCE = ("differs", "undefined", UNCHANGED, "within scatter", "agrees")


def totals_table(cube: xr.Dataset) -> Markdown:
    """Verdicts by chapter and kind; rendered recordings and bookkeeping stand apart."""
    found = from_cube(cube)
    rows = []
    for chapter in ledger.CHAPTERS:
        for kind, words in KINDS.items():
            for counted in (True, False):
                part = [
                    e for e in found if (e.chapter, e.kind, e.counted) == (chapter, kind, counted)
                ]
                if part:
                    mark = "" if counted else " †"
                    numbers = [str(n) for n in ledger.totals(part).values()]
                    rows.append([str(chapter), words + mark, str(len(part)), *numbers])
    counted_ = [entry for entry in found if entry.counted]
    numbers = [f"**{n}**" for n in ledger.totals(counted_).values()]
    rows.append(["**all**", "without †", f"**{len(counted_)}**", *numbers])
    note = (
        "† not in the totals: judged by recordings that were rendered, not filmed; or, of numbers, "
        "bookkeeping, arithmetic on printed numbers and counts of printed rows."
    )
    return markdown_table(["chapter", "", "claims", *VERDICTS], rows, note, plain=False)


def power_table(cube: xr.Dataset) -> Markdown:
    """What the stated values could have told."""
    return Markdown(power.powers(cube))


def rules() -> Markdown:
    """The tolerances, which are the same for all claims."""
    points, low_points = f"{WIDER:g} point", f"{WIDER_BELOW_10:g} below 10 %"
    effect = f"{trend_tests.MATERIAL:.0%}"
    rows = [
        [
            "a stated value *agrees*",
            "literal run in the stated value or interval, ± half a unit "
            "of the last printed digit; of a claim on all settings, in each",
        ],
        ["… as a strict bound, *less than*", "without rounding"],
        [
            "… is *within scatter*",
            f"else, the 5–95 % band of the trials, widened by {points} ({low_points}), reaches it",
        ],
        ["… *differs*", "neither; the ratio is that of the median to the nearest stated value"],
        [
            "a trend *agrees*",
            f"true of the expected errors in at least {CONFIDENT:.0%} of {RESAMPLES} resamples of "
            "the trials (its *confidence*)",
        ],
        [
            "… is *within scatter*",
            f"else, true in more than {1 - CONFIDENT:.0%} of the single runs or of the resamples",
        ],
        [
            "falls (rises)",
            f"last below first (above) by more than {effect}, and most pairs of settings in this "
            "order, in every mode and error named",
        ],
        [
            "*not monotonic*, beside a verdict",
            f"a step between neighbours goes the other way by more than {effect}",
        ],
        [
            f"a rise or fall is *{UNCHANGED}*",
            f"no expected error named changes by more than {effect} from first to last",
        ],
        [
            "within an interval",
            f"every expected error in it, its ends give or take {effect}",
        ],
        [
            "flat, no significant variation",
            f"least and largest within {effect}; of a single run, in the interval that the thesis "
            f"prints, else within a factor of {trend_tests.ONE_RUN_FLAT:g}",
        ],
        [
            "alike, similar",
            f"geometric means within a factor of {trend_tests.ALIKE:g}: the "
            "thesis calls modes within 10–15 % alike",
        ],
        ["no trend", "neither falls nor rises, or flat"],
        ["a stray number *agrees*", "within half a unit of its last printed digit"],
    ]
    return Markdown("\n".join(f"* **{term}**: {meaning}." for term, meaning in rows))


def differing(cube: xr.Dataset) -> Markdown:
    """The counted claims that differ, by what they have in common; bookkeeping is folded away."""
    found = [e for e in from_cube(cube) if e.verdict in ("differs", "undefined")]
    texts = []
    for words, belongs in _GROUPS.items():
        part = [entry for entry in found if entry.counted and belongs(entry)]
        if part:
            texts.append(f"**{len(part)}: {words}**\n\n{_rows(part)}")
        found = [entry for entry in found if entry not in part]
    for words, kinds in _APART.items():
        part = [entry for entry in found if entry.kind in kinds]
        if part:
            fold = f"<details><summary>{len(part)}: {words}, not in the totals</summary>"
            texts.append(f"{fold}\n\n{_rows(part)}\n</details>\n")
    return Markdown("\n".join(texts))


def _rows(part: list[ledger.Entry]) -> str:
    rows = []
    for entry in part:
        ratio = "" if entry.ratio is None else f"{entry.ratio:.2f}"
        of = " · ".join(filter(None, [entry.case, ", ".join(map(str, entry.modes))]))
        rows.append([entry.place, of, entry.what, entry.stated, entry.got, ratio, entry.note])
    return table(["place", "case · mode", "what", "stated", "got", "ratio", "why"], rows)


def _is_mean(entry: ledger.Entry) -> bool:
    return entry.kind == "figure" and entry.what.startswith("mean")


_GROUPS: dict[str, Callable[[ledger.Entry], bool]] = {
    "mean errors that are larger here": lambda e: _is_mean(e) and (e.ratio or 0) > 1,
    "mean errors that are smaller here": _is_mean,
    "largest errors of a marker, which the thesis reads off a bar of a figure": lambda e: (
        e.kind == "figure" and "marker" in e.what
    ),
    "errors of the sound, one draw each": lambda e: e.kind == "figure",
    "trends of the sound, seen or missed in one draw": lambda e: (
        e.kind == "trend" and e.chapter == 6
    ),
    "other trends": lambda e: e.kind == "trend",
    "numbers at odds with the thesis's own formulas, tables or text": lambda e: e.kind == "number",
}
"""What claims that differ have in common; the first that holds counts."""

_APART = {
    "values of chapter 5, judged by rendered recordings": ("figure", "trend"),
    "bookkeeping: counts of printed rows, arithmetic on printed numbers": ("number",),
}


def ledger_table(cube: xr.Dataset) -> LedgerTable:
    """All claims, to filter and search: what differs first, conclusions first of that."""
    found = sorted(from_cube(cube), key=_importance)
    folded = sum(entry.kind == "number" and not entry.counted for entry in found)
    return LedgerTable(data={"rows": [entry.row for entry in found], "folded": folded})


def _importance(entry: ledger.Entry) -> tuple[bool, int, bool, int, float]:
    """Bookkeeping behind, by verdict, conclusions first, by kind, and by how far we are off."""
    last = entry.kind == "number" and not entry.counted
    ratio = 1.0 if entry.ratio is None else entry.ratio
    apart = abs(math.log(ratio)) if ratio > 0 else math.inf
    concluded = entry.kind == "trend" and "-concluding-" in entry.id
    kind = ("trend", "figure", "number").index(entry.kind)
    return last, _IMPORTANCE.index(entry.verdict), not concluded, kind, -apart


def readings_table(cube: xr.Dataset) -> Markdown:
    """Agreement under each reading, beside the adopted one."""
    totals = cube["reading_claims"].sum("outcome")
    rows = []
    for name in cube["reading"].values.tolist():
        part = cube.sel(reading=name)
        inside, of = part["reading_inside"].values, totals.sel(reading=name).values
        gained, lost = int(part["gained"]), int(part["lost"])
        chance = binomtest(gained, gained + lost).pvalue if gained + lost else 1.0
        rows.append(
            [
                name,
                *(f"{met} of {n}" for met, n in zip(inside, of, strict=True)),
                f"{inside.sum()}",
                f"+{gained} −{lost}",
                f"{chance:.2g}",
                " / ".join(f"{r:.2f}" for r in part["log_residual"].values),
            ]
        )
    header = [
        "reading",
        *(f"ch. {c}" for c in cube["chapter"].values),
        "all",
        "gained, lost",
        "p",
        "rms log ratio",
    ]
    note = (
        "Stated values that the band of the trials meets. "
        "*Gained, lost*: against the adopted reading; *p*: how likely a difference so large is if "
        "each changed claim fell either way by chance. *rms log ratio*: of median to stated value, "
        "chapters 3 / 4 / 6."
    )
    return markdown_table(header, rows, note)


def readings_commands(cube: xr.Dataset) -> Markdown:
    """The command that runs chapter 3 under each reading."""
    names = cube["reading"].values.tolist()
    lines = [f"{readings.run_it(READINGS[name])}   # {name}" for name in names]
    return Markdown("```bash\n" + "\n".join(lines) + "\n```")


def best_reading(cube: xr.Dataset) -> Markdown:
    """Whether any reading agrees better than the adopted one, beyond chance, in one sentence."""
    met = cube["reading_inside"].sum("chapter").values
    p = [
        binomtest(int(g), int(g + n)).pvalue if g + n else 1.0
        for g, n in zip(cube["gained"].values, cube["lost"].values, strict=True)
    ]
    names = cube["reading"].values.tolist()
    best = int(np.argmax(met))
    better = [n for n, m, q in zip(names, met, p, strict=True) if m > met[0] and q < 0.05]
    text = (
        f"The adopted reading meets {met[0]} stated values; the most are met by *{names[best]}*, "
        f"{met[best]} (p = {p[best]:.2g}). "
    )
    if better:
        text += f"Better beyond chance (p < 0.05): {', '.join(better)}."
    else:
        text += "None is better than the adopted one beyond chance (p < 0.05)."
    return Markdown(text)
