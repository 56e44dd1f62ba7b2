"""The ledger: every claim of the thesis compared with the cubes, recomputed each time.

Claimed values, trends and stray numbers become one :class:`Entry` each, with a verdict by the rules
of ``verdicts.py`` and ``trends.py``. A claim that cannot be judged is *undefined*, with the reason;
a cube that is missing or outdated is such a reason.

A claim that differs gets a reason: an erratum or an assumption of ``data/thesis/reasons.csv``,
numbers that exclude each other, or another interpretation of the thesis that meets the value. Else
no explanation was found.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib import templates
from thesis_lib.facts import claims, setups
from thesis_lib.facts.claims import Claim, PrintedNumber, Trend, read_numbers, read_reasons
from thesis_lib.ledger import trends as ledger_trends, verdicts
from thesis_lib.ledger.verdicts import VERDICTS, Series
from thesis_lib.studies import cubes, request, schema

Opener = Callable[[request.Study], "xr.Dataset | str"]
THESIS_CHAPTERS = (1, 2, 3, 4, 5, 6, 7)
RENDERED_SETS = ("experiment", "lab")  # judged by recordings that were rendered, not filmed
NAN = float("nan")
SETTING_WORDS = {
    "distance_mm": "d = {:g} mm",
    "aperture_deg": "α = {:g}°",
    "width_px": "{:g} px wide",
    "n_cameras": "{:g} cameras",
}
QUANTITY_WORDS = {
    "mean_error": "mean error",
    "max_point_error": "largest marker error",
    "second_point_error": "largest marker error but one",
    "plane_error_xz": "error on plane XZ",
    "plane_error_yz": "error on plane YZ",
}


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One line of the ledger; ``variables.toml`` explains its fields.

    The numbers are NaN where a claim has none, or at the open end of a bound; those of a trend come
    from its :class:`thesis_lib.ledger.trends.Finding`.
    """

    id: str
    kind: str
    chapter: int
    place: str
    case: str
    modes: tuple[int, ...]
    what: str
    stated: str
    got: str = ""
    verdict: str = "undefined"
    counted: bool  # False for bookkeeping and for rendered sets
    note: str = ""
    note_href: str = ""
    href: str = ""
    command: str = ""
    ratio: float = NAN
    least: float = NAN
    most: float = NAN
    literal: float = NAN
    median: float = NAN
    low: float = NAN
    high: float = NAN
    confidence: float = NAN
    single: float = NAN
    effect: float = NAN
    largest_effect: float = NAN
    step_back: str = ""

    @property
    def json_values(self) -> dict[str, object]:
        """Return all fields as JSON values: None where there is no number."""
        values = vars(self) | {"modes": list(self.modes)}
        none = {n: None for n, v in values.items() if isinstance(v, float) and not np.isfinite(v)}
        return values | none

    @property
    def row(self) -> dict[str, object]:
        """Return the fields in the table of the page: all but the numbers other than the ratio."""
        hidden = {n for n, v in vars(self).items() if isinstance(v, float)} - {"ratio"}
        return {name: value for name, value in self.json_values.items() if name not in hidden}


_COLUMN_NAMES = {"id": "claim", "chapter": "claim_chapter"}  # others are named like their fields
LEDGER_COLUMNS = schema.read_variables(__file__, "entries")


def as_cube(found: Sequence[Entry], interpretations: xr.Dataset) -> xr.Dataset:
    """Return the ledger as a cube: a variable for each field, and those of `interpretations`."""
    values: dict[str, list[Any]] = {
        field: [getattr(entry, field) for entry in found] for field in LEDGER_COLUMNS
    }
    values["modes"] = [";".join(map(str, modes)) for modes in values["modes"]]
    values["counted"] = [int(counted) for counted in values["counted"]]
    columns: dict[str, Any] = {
        _COLUMN_NAMES.get(field, field): variable
        for field, variable in schema.label_values(values, LEDGER_COLUMNS).items()
    }
    names = {"claim": columns.pop("claim")}
    return interpretations.drop_attrs(deep=False).assign_coords(names).assign(columns)


def from_cube(cube: xr.Dataset) -> list[Entry]:
    """Return the entries that a cube of :func:`as_cube` holds."""
    columns = {
        field: cube[_COLUMN_NAMES.get(field, field)].values.tolist() for field in LEDGER_COLUMNS
    }
    columns["modes"] = [tuple(map(int, filter(None, m.split(";")))) for m in columns["modes"]]
    columns["counted"] = [bool(counted) for counted in columns["counted"]]
    rows = zip(*columns.values(), strict=True)
    return [Entry(**dict(zip(columns, row, strict=True))) for row in rows]


def list_entries(
    open_cube: Opener,
    own: Mapping[str, Sequence[Series]],
    studies: Mapping[str, type[request.Study]],
    commands: Mapping[str, Sequence[str]],
) -> list[Entry]:
    """Return the whole ledger, in the order of the thesis.

    `open_cube` returns the cube of a study, or the reason in one line if there is none. The others
    are by name: `own` has the series of the ledger's own runs, `commands` the commands that produce
    them, `studies` all figure sets.
    """

    @cache
    def cube_of(name: str) -> xr.Dataset | str:
        return open_cube(studies[name]())

    @cache
    def series_of(name: str) -> Sequence[Series] | str:
        if name in own:
            return own[name]
        if name not in studies:
            return f"run {name} of the ledger is missing: run `thesis book`"
        cube = cube_of(name)
        return cube if isinstance(cube, str) else verdicts.series_of(cube)

    found = [
        _figure(claim, cube_of(claim.figure_set), studies[claim.figure_set].varied)
        for claim in claims.read_claims()
    ]
    for trend in claims.read_trends():
        made = [command for name in trend.source for command in commands.get(name, [])]
        sets = [name for name in trend.source if name in studies]
        made += [request.study_command(studies[name]()) for name in sets]
        found.append(_trend(trend, [series_of(name) for name in trend.source], sets, made))
    found += [_number(number) for number in read_numbers()]
    return sorted(found, key=lambda entry: entry.chapter)


def _figure(claim: Claim, cube: xr.Dataset | str, varied: str) -> Entry:
    """Judge a claimed value by a cube in which a parameter is varied."""
    check = cube if isinstance(cube, str) else verdicts.judge_claim(cube, claim)
    notes, judged = [], dict[str, Any]()
    if isinstance(check, str):
        notes.append(check)
    else:
        band = cubes.band_text(check.median, check.low, check.high)
        same = "ratio", "literal", "median", "low", "high", "verdict"
        judged = {name: getattr(check, name) for name in same}
        judged["got"] = f"{cubes.percent_text(check.literal)} · {band}"
    if claim.conflicts:
        notes.append(f"excluded by {', '.join(claim.conflicts)}: {claim.conflict_why}")
    excepted = " but one" if claim.excepted else ""
    settings = ", ".join(map(SETTING_WORDS[varied].format, claim.values)) or "all settings"
    order = f", pairs {claim.pair_order}" if claim.pair_order else ""
    least, most = (NAN if end is None else end for end in claim.ends)
    return Entry(
        id=claim.id,
        kind="figure",
        chapter=claim.chapter,
        place=f"figure {claim.figure}",
        case=claim.case,
        modes=(claim.mode,),
        what=f"{QUANTITY_WORDS[claim.quantity]}{excepted}, {settings}{order}",
        stated=claim.stated,
        note="; ".join(notes),
        counted=claim.figure_set.partition("-")[0] not in RENDERED_SETS,
        href=f"{claim.figure_set}.html#fig-{claim.figure.replace('.', '-')}",
        command=f"thesis run {claim.figure_set}",
        least=least,
        most=most,
        **judged,
    )


def _trend(
    trend: Trend, found: Sequence[Sequence[Series] | str], sets: list[str], commands: list[str]
) -> Entry:
    """Judge a claimed trend by the errors of its figure sets and of the ledger's own runs."""
    reasons = [part for part in found if isinstance(part, str)]
    every = [one for part in found if not isinstance(part, str) for one in part]
    finding = None if reasons else ledger_trends.judge_trend(trend, every)
    judged: dict[str, Any] = {"note": "; ".join(dict.fromkeys(reasons)) or "nothing to judge it by"}
    if finding:
        ends = finding.effect, finding.largest_effect
        texts = sorted({f"{one:.2f}" for one in ends if np.isfinite(one)})
        effect = f"×{'–'.join(texts)}, " if texts else ""
        back = f"not monotonic ({finding.step_back}), " if finding.step_back else ""
        shares = f"confidence {finding.confidence:.0%}, single runs {finding.single:.0%}"
        judged = {"got": f"{effect}{back}{shares}", "verdict": finding.verdict, **vars(finding)}
    link = number = ""
    if sets:
        subject, _, study = sets[0].partition("-")
        if trend.cases:
            number = setups.figure_number(subject, study, trend.cases[0], trend.modes[0])
        link = f"{sets[0]}.html" + (f"#fig-{number.replace('.', '-')}" if number else "")
    return Entry(
        id=trend.id,
        kind="trend",
        chapter=trend.chapter,
        place=f"section {trend.section}" if trend.section[0].isdigit() else trend.section,
        case=", ".join(trend.cases),
        modes=trend.modes,
        what=trend.words,
        stated=trend.test.partition(" ")[0].replace("_", " "),
        counted=not any(name.partition("-")[0] in RENDERED_SETS for name in trend.source),
        href=link,
        command="\n".join(commands),
        **judged,
    )


def _number(number: PrintedNumber) -> Entry:
    """Judge a stray number by its recomputed value."""
    value, (least, most) = number.value, number.ends
    inside = least <= value <= most
    middle = (least + most) / 2
    unit = f" {number.unit}" if number.unit else ""
    return Entry(
        id=number.id,
        kind="number",
        chapter=number.chapter,
        place=number.place,
        case="",
        modes=(),
        what=number.words,
        stated=f"{number.stated}{unit}",
        got=f"{value:.6g}{unit}",
        verdict="agrees" if inside else "differs",
        ratio=1.0 if inside else value / middle if middle else NAN,
        counted=not number.is_bookkeeping,
        least=least,
        most=most,
        literal=value,
    )


def count_verdicts(found: Iterable[Entry]) -> dict[str, int]:
    """Count the entries by verdict.

    Examples
    --------
    >>> count_verdicts([])
    {'agrees': 0, 'within scatter': 0, 'differs': 0, 'no material change': 0, 'undefined': 0}
    """
    counts = Counter(entry.verdict for entry in found)
    return {verdict: counts[verdict] for verdict in VERDICTS}


EXCLUSION_LINK = "../errata.html#errata-a9"  # on claims that exclude each other
INTERPRETATIONS_LINK = "claims.html#other-readings"
NOT_FOUND = "No explanation was found."


def explain_differences(found: Iterable[Entry], readings: xr.Dataset) -> list[Entry]:
    """Give each claim that differs its reason; other claims stay as they are.

    `readings` contains which claimed values each interpretation meets, the adopted one first:
    ``reading_meets(reading, value)``, ``reading_inside(reading, chapter)``.
    """
    known, values = read_reasons(), set(readings["value"].values.tolist())

    def explain(entry: Entry) -> Entry:
        if entry.verdict != "differs":
            return entry
        if entry.id in known:
            reason = known[entry.id]
            document, mark, anchor = reason.page.partition("#")  # of the book
            folder, _, name = document.rpartition("/")
            target = f"{name}.html" if folder == "executed" else f"../{document}.html"
            return replace(entry, note=reason.reason, note_href=f"{target}{mark}{anchor}")
        if entry.note:
            return replace(entry, note_href=EXCLUSION_LINK)
        note = _by_interpretation(entry.id, readings) if entry.id in values else NOT_FOUND
        return replace(entry, note=note, note_href=INTERPRETATIONS_LINK)

    return [explain(entry) for entry in found]


def _by_interpretation(name: str, readings: xr.Dataset) -> str:
    """Describe the other interpretation that meets a value, if any, and how many it meets."""
    names = readings["reading"].values.tolist()
    met = readings["reading_inside"].sum("chapter").values
    meets = readings["reading_meets"].sel(value=name).values.astype(bool)
    changes = {at: setups.READINGS[names[at]].items() for at in np.flatnonzero(meets) if at}
    # without those whose changes include all changes of another one, and more
    others = [at for at, own in changes.items() if not any(one < own for one in changes.values())]
    if not others:
        return f"{NOT_FOUND[:-1]}: none of {len(names) - 1} other interpretations meets this value."
    best = max(others, key=lambda at: met[at])
    adopted = f"the adopted one meets {met[0]}."
    if met[best] > met[0]:
        return (
            f"Another interpretation, “{names[best]}”, meets this value, and {met[best]} values "
            f"in all; {adopted}"
        )
    return (
        f"No explanation was found that fits the other values: “{names[best]}” meets this one, "
        f"but only {met[best]} in all; {adopted}"
    )


KIND_WORDS = {"figure": "claimed values", "trend": "trends", "number": "stray numbers"}


def format_report(found: Sequence[Entry]) -> str:
    """Format the ledger as text: counts by chapter, then entries that differ or are undefined."""
    text = templates.render(
        __file__,
        "report.txt.j2",
        found=found,
        chapters=THESIS_CHAPTERS,
        kinds=KIND_WORDS,
        count=count_verdicts,
        undefined=Counter(entry.note for entry in found if entry.verdict == "undefined"),
    )
    return text.removesuffix("\n")
