"""The ledger: every claim of the thesis held against the cubes, recomputed each time.

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
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.facts import claims, setups
from thesis_lib.facts.claims import Claim, StatedNumber, Trend, read_numbers, read_reasons
from thesis_lib.ledger import trends as ledger_trends
from thesis_lib.ledger import verdicts
from thesis_lib.ledger.verdicts import VERDICTS, Check, Series
from thesis_lib.studies import cubes, schema
from thesis_lib.studies.request import Study, study_command

Opener = Callable[[Study], "xr.Dataset | str"]
THESIS_CHAPTERS = (1, 2, 3, 4, 5, 6, 7)
RENDERED_SETS = ("experiment", "lab")  # judged by recordings that were rendered, not filmed
NAN = float("nan")
NUMBER_FIELDS = (
    "least", "most", "literal", "median", "low", "high",
    "confidence", "single", "effect", "largest_effect",
)  # fmt: skip
QUANTITY_WORDS = {
    "mean_error": "mean error",
    "max_point_error": "largest marker error",
    "second_point_error": "largest marker error but one",
    "plane_error_xz": "error on plane XZ",
    "plane_error_yz": "error on plane YZ",
}


@dataclass(frozen=True)
class Entry:
    """One line of the ledger; ``variables.toml`` has the meanings of its fields.

    The numbers are NaN where a claim has none, or at the open end of a bound; those of a trend are
    of its :class:`thesis_lib.ledger.trends.Finding`.
    """

    id: str
    kind: str
    chapter: int
    place: str
    case: str
    modes: tuple[int, ...]
    what: str
    stated: str
    got: str
    verdict: str
    counted: bool  # not if bookkeeping or rendered
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
    def record(self) -> dict[str, object]:
        """Return all fields as JSON values: None where there is no number."""
        values = vars(self) | {"modes": list(self.modes)}
        none = {n: None for n, v in values.items() if isinstance(v, float) and not np.isfinite(v)}
        return values | none

    @property
    def row(self) -> dict[str, object]:
        """The fields that the table of the page shows."""
        return {name: value for name, value in self.record.items() if name not in NUMBER_FIELDS}


_COLUMN_NAMES = {"id": "claim", "chapter": "claim_chapter"}  # else those of the fields
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
    studies: Mapping[str, type[Study]],
    commands: Mapping[str, Sequence[str]],
) -> list[Entry]:
    """Return the whole ledger, in the order of the thesis.

    Parameters
    ----------
    open_cube : callable
        Returns the cube of a study, or in one line why there is none.
    own : mapping
        Series of the ledger's own runs, by name.
    studies : mapping
        All figure sets, by name.
    commands : mapping
        The commands that make the own runs, by name.
    """
    opened: dict[str, xr.Dataset | str] = {}

    def cube_of(name: str) -> xr.Dataset | str:
        if name not in opened:
            opened[name] = open_cube(studies[name]())
        return opened[name]

    series: dict[str, Sequence[Series] | str] = dict(own)

    def series_of(name: str) -> Sequence[Series] | str:
        if name not in series:
            if name not in studies:
                return f"run {name} of the ledger is missing: run `thesis book`"
            cube = cube_of(name)
            series[name] = cube if isinstance(cube, str) else verdicts.series_of(cube)
        return series[name]

    found = [
        _figure(claim, cube_of(claim.figure_set), studies[claim.figure_set].varied)
        for claim in claims.read_claims()
    ]
    for trend in claims.read_trends():
        made = [command for name in trend.source for command in commands.get(name, [])]
        sets = [name for name in trend.source if name in studies]
        made += [study_command(studies[name]()) for name in sets]
        found.append(_trend(trend, [series_of(name) for name in trend.source], sets, made))
    found += [_number(number) for number in read_numbers()]
    order = {"figure": 0, "trend": 1, "number": 2}
    return sorted(found, key=lambda entry: (entry.chapter, order[entry.kind]))


def _figure(claim: Claim, cube: xr.Dataset | str, varied: str) -> Entry:
    """Judge a claimed value by a cube in which a parameter is varied."""
    subject, _, study = claim.figure_set.partition("-")
    found = cube if isinstance(cube, str) else verdicts.judge_claim(cube, claim)
    check = None if isinstance(found, str) else found
    setting = _setting_words(claim, varied)
    excepted = " but one" if claim.excepted else ""
    note = found if isinstance(found, str) else ""
    if claim.conflicts:
        others = ", ".join(claim.conflicts)
        note = f"{note + '; ' if note else ''}excluded by {others}: {claim.conflict_why}"
    text = cubes.percent_text
    number = claim.figure or setups.figure_number(subject, study, claim.case, claim.mode)
    return Entry(
        id=claim.id,
        kind="figure",
        chapter=claim.chapter,
        place=f"figure {number}",
        case=claim.case,
        modes=(claim.mode,),
        what=f"{QUANTITY_WORDS[claim.quantity]}{excepted}, {setting}",
        stated=claim.stated,
        got=f"{text(check.literal)} · {cubes.band_text(check.median, check.low, check.high)}"
        if check
        else "",
        verdict=check.verdict if check else "undefined",
        note=note,
        counted=subject not in RENDERED_SETS,
        href=f"{claim.figure_set}.html#fig-{number.replace('.', '-')}",
        command=f"thesis run {claim.figure_set}",
        least=NAN if claim.ends[0] is None else claim.ends[0],
        most=NAN if claim.ends[1] is None else claim.ends[1],
        **_numbers(check, "ratio", "literal", "median", "low", "high"),
    )


def _numbers(found: Check | ledger_trends.Finding | None, *names: str) -> dict[str, Any]:
    return {} if found is None else {name: getattr(found, name) for name in names}


def _setting_words(claim: Claim, varied: str) -> str:
    """Name the settings that a claim speaks of, such as ``d = 500 mm`` or ``all settings``."""
    unit = {
        "distance_mm": "d = {:g} mm",
        "aperture_deg": "α = {:g}°",
        "width_px": "{:g} px wide",
        "n_cameras": "{:g} cameras",
    }[varied]
    order = f", pairs {claim.pair_order}" if claim.pair_order else ""
    return (", ".join(unit.format(value) for value in claim.values) or "all settings") + order


def _trend(
    trend: Trend, found: Sequence[Sequence[Series] | str], sets: list[str], commands: list[str]
) -> Entry:
    """Judge a stated trend by the errors of the figure sets and own runs that it speaks of."""
    reasons = [part for part in found if isinstance(part, str)]
    every = [one for part in found if not isinstance(part, str) for one in part]
    finding = None if reasons else ledger_trends.judge_trend(trend, every)
    first = next(iter(sets), "")
    subject, _, study = first.partition("-")
    number = ""
    if trend.cases and first:
        number = setups.figure_number(subject, study, trend.cases[0], trend.modes[0])
    link = f"{first}.html" + (f"#fig-{number.replace('.', '-')}" if number else "")
    rendered = any(name.partition("-")[0] in RENDERED_SETS for name in trend.source)
    return Entry(
        id=trend.id,
        kind="trend",
        chapter=trend.chapter,
        place=f"section {trend.section}" if trend.section[0].isdigit() else trend.section,
        case=", ".join(trend.cases),
        modes=trend.modes,
        what=trend.words,
        stated=trend.test.partition(" ")[0].replace("_", " "),
        got=_describe_finding(finding) if finding else "",
        verdict=finding.verdict if finding else "undefined",
        note="; ".join(dict.fromkeys(reasons)) or ("" if finding else "nothing to judge it by"),
        counted=not rendered,
        href=link if first else "",
        command="\n".join(commands),
        step_back=finding.step_back if finding else "",
        **_numbers(finding, "confidence", "single", "effect", "largest_effect"),
    )


def _describe_finding(finding: ledger_trends.Finding) -> str:
    """Describe the finding on a trend in a few words."""
    ends = [f"{one:.2f}" for one in (finding.effect, finding.largest_effect) if np.isfinite(one)]
    effect = f"×{'–'.join(sorted(set(ends)))}, " if ends else ""
    back = f"not monotonic ({finding.step_back}), " if finding.step_back else ""
    return f"{effect}{back}confidence {finding.confidence:.0%}, single runs {finding.single:.0%}"


def _number(number: StatedNumber) -> Entry:
    """Judge a stray number by its computation."""
    value = number.value
    inside = number.low <= value <= number.high
    middle = (number.low + number.high) / 2
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
        least=number.low,
        most=number.high,
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


EXCLUSION_LINK = "../errata.html#errata-a9"  # on stated numbers that exclude each other
INTERPRETATIONS_LINK = "claims.html#other-readings"
_DIFFERING_HEAD = "differs: place, what: stated → computed  ×computed over nearest stated; reason"
NOT_FOUND = "No explanation was found."


def explain_differences(found: Iterable[Entry], readings: xr.Dataset) -> list[Entry]:
    """Give each claim that differs its reason; other claims stay as they are.

    Parameters
    ----------
    found : iterable of Entry
        The ledger.
    readings : xarray.Dataset
        Which stated values each interpretation meets, the adopted one first:
        ``reading_meets(reading, value)``, ``reading_inside(reading, chapter)``.
    """
    known = {one.id: (one.reason, _link(one.page)) for one in read_reasons().values()}
    values = set(readings["value"].values.tolist())
    made = []
    for entry in found:
        if entry.verdict != "differs":
            made.append(entry)
            continue
        if entry.id in known:
            note, link = known[entry.id]
        elif entry.note:
            note, link = entry.note, EXCLUSION_LINK
        elif entry.id in values:
            note, link = _by_interpretation(entry.id, readings), INTERPRETATIONS_LINK
        else:
            note, link = NOT_FOUND, INTERPRETATIONS_LINK
        made.append(replace(entry, note=note, note_href=link))
    return made


def _by_interpretation(name: str, readings: xr.Dataset) -> str:
    """Say which other interpretation meets a stated value, if any, and what it meets in all."""
    names = readings["reading"].values.tolist()
    met = readings["reading_inside"].sum("chapter").values
    meets = readings["reading_meets"].sel(value=name).values.astype(bool)
    others = _simplest([at for at in range(1, len(names)) if meets[at]], names)
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


def _simplest(chosen: list[int], names: Sequence[str]) -> list[int]:
    """Leave out interpretations that change all that another one changes, and more."""
    changes = {at: setups.READINGS[names[at]].values.items() for at in chosen}
    return [at for at in chosen if not any(other < changes[at] for other in changes.values())]


def _link(page: str) -> str:
    """Return a document of the book as the ledger's page links to it."""
    document, _, anchor = page.partition("#")
    folder, _, name = document.rpartition("/")
    target = f"{name}.html" if folder == "executed" else f"../{document}.html"
    return target + (f"#{anchor}" if anchor else "")


KIND_WORDS = {"figure": "stated values", "trend": "trends", "number": "stray numbers"}


def format_report(found: Sequence[Entry]) -> str:
    """Format the ledger as text: counts by chapter, then entries that differ or are undefined."""
    lines = []
    for chapter in THESIS_CHAPTERS:
        of_chapter = [entry for entry in found if entry.chapter == chapter]
        lines.append(f"chapter {chapter}")
        for kind, words in KIND_WORDS.items():
            part = [entry for entry in of_chapter if entry.kind == kind]
            if part:
                counts = ", ".join(
                    f"{n} {verdict}" for verdict, n in count_verdicts(part).items() if n
                )
                apart = sum(not entry.counted for entry in part)
                why = "bookkeeping" if kind == "number" else "by rendered recordings"
                mark = f"   ({apart} {why})" if apart else ""
                words = words if len(part) > 1 else words[:-1]
                lines.append(f"  {len(part):3} {words:13}  {counts}{mark}")
    counted = [entry for entry in found if entry.counted]
    counts = ", ".join(f"{n} {verdict}" for verdict, n in count_verdicts(counted).items())
    lines.append(f"in all, without rendered recordings and bookkeeping: {counts}")
    differing = [entry for entry in found if entry.verdict == "differs"]
    lines += [f"\n{_DIFFERING_HEAD}"] if differing else []
    for entry in differing:
        ratio = f"  ×{entry.ratio:.2f}" if np.isfinite(entry.ratio) else ""
        modes = f" mode {', '.join(map(str, entry.modes))}" if entry.modes else ""
        case = f"case {entry.case}{modes}: " if entry.case else ""
        what = f"{entry.what.rstrip('.')}: {entry.stated} → {entry.got}{ratio}"
        lines.append(f"  {entry.place}, {case}{what}; {entry.note}")
    reasons = Counter(entry.note for entry in found if entry.verdict == "undefined")
    lines += ["\nundefined:"] if reasons else []
    lines += [f"  {number:3} × {reason}" for reason, number in reasons.items()]
    return "\n".join(lines)
