"""The ledger: every claim of the thesis beside what the cubes say, recomputed each time.

Stated values, trends and stray numbers become :class:`Entry` each, with a verdict by the rules of
``verdicts.py`` and ``trends.py``. What cannot be judged is *undefined*, with the reason; a cube
that is missing, or of other parameters or another state of the library, is such a reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.facts import claims, setups, trends
from thesis_lib.facts.claims import Claim
from thesis_lib.facts.numbers import StatedNumber, read_numbers
from thesis_lib.facts.trends import Trend
from thesis_lib.ledger import series as ledger_series
from thesis_lib.ledger import trends as ledger_trends
from thesis_lib.ledger import verdicts
from thesis_lib.ledger.trends import Finding, Series
from thesis_lib.ledger.verdicts import VERDICTS, Check
from thesis_lib.studies import cubes
from thesis_lib.studies.commands import command
from thesis_lib.studies.request import Study

Opener = Callable[[Study], "xr.Dataset | str"]
CHAPTERS = (1, 2, 3, 4, 5, 6, 7)
RENDERED = ("experiment", "lab")  # judged by recordings that were rendered, not filmed
NAN = float("nan")
NUMBERS = (
    "least", "most", "literal", "median", "low", "high",
    "confidence", "single", "effect", "largest_effect",
)  # fmt: skip
QUANTITIES = {
    "mean_error": "mean error",
    "max_point_error": "largest marker error",
    "second_point_error": "largest marker error but one",
    "plane_error_xz": "error on plane XZ",
    "plane_error_yz": "error on plane YZ",
}


@dataclass(frozen=True)
class Entry:
    """One line of the ledger."""

    id: str  #: Its name
    kind: str  #: ``figure``, ``trend`` or ``number``
    chapter: int  #: Chapter of the thesis
    place: str  #: Where it stands
    case: str  #: Of which case it speaks
    modes: tuple[int, ...]  #: Modes that it speaks of
    what: str  #: What it is about, in a few words
    stated: str  #: What is stated, in a few words
    got: str  #: What we get, in a few words
    verdict: str  #: One of ``verdicts.VERDICTS``
    note: str  #: The reason, or a remark
    ratio: float | None  #: What we get over what is stated, where both are numbers
    #: Whether the totals count it: not if it is judged by rendered recordings, nor if it is
    #: bookkeeping
    counted: bool
    href: str  #: The page with its figure
    command: str  #: The commands that make what it is judged by, line by line
    #: What is stated, with NaN at the open end of a bound
    least: float = NAN
    most: float = NAN
    #: What we get: the literal run (or the value), and median and 5–95 % band of the trials
    literal: float = NAN
    median: float = NAN
    low: float = NAN
    high: float = NAN
    #: Of a trend, see :class:`thesis_lib.ledger.trends.Finding`
    confidence: float = NAN
    single: float = NAN
    effect: float = NAN
    largest_effect: float = NAN
    step_back: str = ""  #: Of a trend that is not monotonic
    note_href: str = ""  #: The page that tells more of the reason

    @property
    def row(self) -> dict[str, object]:
        """The line as the table of the page has it."""
        row = {name: value for name, value in vars(self).items() if name not in NUMBERS}
        return row | {"modes": list(self.modes)}

    @property
    def record(self) -> dict[str, object]:
        """The line as JSON values, with its numbers; None where there is none."""
        numbers = {name: getattr(self, name) for name in NUMBERS}
        given = {name: value if np.isfinite(value) else None for name, value in numbers.items()}
        return self.row | given


def entries(
    open_cube: Opener,
    own: Mapping[str, Sequence[Series]],
    studies: Mapping[str, type[Study]],
    commands: Mapping[str, Sequence[str]],
) -> list[Entry]:
    """The whole ledger, in the order of the thesis.

    Parameters
    ----------
    open_cube : callable
        Gives the cube of a study, or in one line why there is none.
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
            series[name] = cube if isinstance(cube, str) else ledger_series.series_of(cube)
        return series[name]

    found = [
        _figure(claim, cube_of(claim.figure_set), studies[claim.figure_set].varied)
        for claim in claims.read_claims()
    ]
    for trend in trends.read_trends():
        made = [command for name in trend.source for command in commands.get(name, [])]
        sets = [name for name in trend.source if name in studies]
        made += [command(studies[name]()) for name in sets]
        found.append(_trend(trend, [series_of(name) for name in trend.source], sets, made))
    found += [_number(number) for number in read_numbers()]
    order = {"figure": 0, "trend": 1, "number": 2}
    return sorted(found, key=lambda entry: (entry.chapter, order[entry.kind]))


def _figure(claim: Claim, cube: xr.Dataset | str, varied: str) -> Entry:
    """A stated value beside a cube, in which a parameter is varied."""
    subject, _, study = claim.figure_set.partition("-")
    found = cube if isinstance(cube, str) else verdicts.judge(cube, claim)
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
        what=f"{QUANTITIES[claim.quantity]}{excepted}, {setting}",
        stated=claim.stated,
        got=f"{text(check.literal)} · {cubes.band_text(check.median, check.low, check.high)}"
        if check
        else "",
        verdict=check.verdict if check else "undefined",
        note=note,
        ratio=check.ratio if check else None,
        counted=subject not in RENDERED,
        href=f"{claim.figure_set}.html#fig-{number.replace('.', '-')}",
        command=f"thesis run {claim.figure_set}",
        least=NAN if claim.ends[0] is None else claim.ends[0],
        most=NAN if claim.ends[1] is None else claim.ends[1],
        **_numbers(check, "literal", "median", "low", "high"),
    )


def _numbers(found: Check | Finding | None, *names: str) -> dict[str, Any]:
    return {} if found is None else {name: getattr(found, name) for name in names}


def _setting_words(claim: Claim, varied: str) -> str:
    """The settings that a claim speaks of, such as ``d = 500 mm`` or ``all settings``."""
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
    """A stated trend beside the errors of the figure sets and own runs that it speaks of."""
    reasons = [part for part in found if isinstance(part, str)]
    every = [one for part in found if not isinstance(part, str) for one in part]
    finding = None if reasons else ledger_trends.judge(trend, every)
    first = next(iter(sets), "")
    subject, _, study = first.partition("-")
    number = ""
    if trend.cases and first:
        number = setups.figure_number(subject, study, trend.cases[0], trend.modes[0])
    link = f"{first}.html" + (f"#fig-{number.replace('.', '-')}" if number else "")
    rendered = any(name.partition("-")[0] in RENDERED for name in trend.source)
    return Entry(
        id=trend.id,
        kind="trend",
        chapter=trend.chapter,
        place=f"section {trend.section}" if trend.section[0].isdigit() else trend.section,
        case=", ".join(trend.cases),
        modes=trend.modes,
        what=trend.words,
        stated=trend.test.partition(" ")[0].replace("_", " "),
        got=_found(finding) if finding else "",
        verdict=finding.verdict if finding else "undefined",
        note="; ".join(dict.fromkeys(reasons)) or ("" if finding else "nothing to judge it by"),
        ratio=None,
        counted=not rendered,
        href=link if first else "",
        command="\n".join(commands),
        step_back=finding.step_back if finding else "",
        **_numbers(finding, "confidence", "single", "effect", "largest_effect"),
    )


def _found(finding: Finding) -> str:
    """What is found of a trend, in a few words."""
    ends = [f"{one:.2f}" for one in (finding.effect, finding.largest_effect) if np.isfinite(one)]
    effect = f"×{'–'.join(sorted(set(ends)))}, " if ends else ""
    back = f"not monotonic ({finding.step_back}), " if finding.step_back else ""
    return f"{effect}{back}confidence {finding.confidence:.0%}, single runs {finding.single:.0%}"


def _number(number: StatedNumber) -> Entry:
    """A stray number beside its computation."""
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
        note="",
        ratio=1.0 if inside else value / middle if middle else None,
        counted=not number.is_bookkeeping,
        href="",
        command="",
        least=number.low,
        most=number.high,
        literal=value,
    )


def totals(found: Iterable[Entry], **where: object) -> dict[str, int]:
    """Number of entries by verdict, of those whose attributes are as given.

    Examples
    --------
    >>> totals([], chapter=3)
    {'agrees': 0, 'within scatter': 0, 'differs': 0, 'undefined': 0}
    """
    chosen = [e for e in found if all(getattr(e, name) == value for name, value in where.items())]
    counts = Counter(entry.verdict for entry in chosen)
    return {verdict: counts[verdict] for verdict in VERDICTS}
