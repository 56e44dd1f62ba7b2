"""Reader of force tables from any program: detects the columns of time and force, and their units.

It accepts decimal points and commas; tabs, semicolons, commas, bars, spaces and quotes; UTF-8,
UTF-16 and Latin-1; comments, headers of any number of lines and a line of units. Columns are
identified by their names and units, else by their values. Ambiguous tables are refused.
"""

import codecs
import csv
import datetime as dt
import re
import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.templates import join_words

MIN_SAMPLES = 100
MAX_BYTES = 1 << 30  # of a table
SAMPLED_LINES = 400  # lines from which separator, decimal mark and number of columns are determined
MAX_UNSTATED_STEP_S = 0.03  # above this step, times without a unit may be ms or sample numbers
#: Largest step over the 90 % quantile of all: times rounded to few digits step by one or two units,
#: one lost sample is interpolated well, and of tables sampled unevenly many steps are long
MAX_STEP_RATIO = 2.5
EXAMPLE_TEXT = 'allowed: a time and a force in each line, as "time_s,force_N", "0.001,12.5"'

COMMENT_PATTERN = re.compile(r"\s*(#|%|//|!)+\s*")
UNIT_FORMS = (r"(.*?)\s*[\[(]([^\])]*)[\])]\s*$", r"(.*?)\s+in\s+(\S+)$",
              r"(.*?)\s*[/,]\s*(\S+)$", r"(.*?)[_.-]+([^\s_.-]+)$", r"(.*?)\s+(\S+)$")  # fmt: skip
_WORDS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
#: Factors to s and N by unit in lower case, except MN, since "mn" are millinewtons
SI_UNITS: dict[str, dict[str, float]] = {
    kind: {unit.lower(): factor for alike, factor in table.items() for unit in alike.split()}
    for kind, table in _WORDS["units"].items()
}
SI_NAMES = {"time": "s", "force": "N"}
NAMES = {kind: frozenset(_WORDS[f"{kind}_names"]) for kind in ("time", "force", "index")}


class ForceError(ValueError):
    """A force that cannot be used; the message is one line."""


def _ambiguity(path: Path, problem: str) -> ForceError:
    """Return the error for a table that is unreadable or ambiguous."""
    return ForceError(f"{path}: {problem}, {EXAMPLE_TEXT}")


@dataclass(frozen=True)
class _Form:
    """Format of numbers in lines."""

    separator: str  #: A character, or a space for any number of spaces and tabs
    decimal: str
    day: int = 0  #: Ordinal of the day from which dates are counted

    def cells(self, line: str) -> list[str]:
        """Split a line into cells."""
        if self.separator == " ":
            return line.split()
        return [cell.strip() for cell in next(csv.reader([line], delimiter=self.separator), [])]

    def number(self, cell: str) -> float | None:
        """Return the number in a cell, or its date and time of day in seconds; else None."""
        thousands, grouped, plain = NUMBER_PATTERNS[self.decimal]
        if grouped.fullmatch(cell):
            cell = cell.replace(thousands, "")
        if plain.fullmatch(cell):
            return float(cell.replace(self.decimal, "."))
        match = CLOCK_PATTERN.fullmatch(cell)
        if match is None:
            return None
        year, month, day, hours, minutes, seconds = match.groups()
        days = dt.date(int(year), int(month), int(day)).toordinal() - self.day if year else 0
        whole = 86400.0 * days + 3600 * int(hours) + 60 * int(minutes)
        return whole + float(seconds.replace(",", "."))

    def is_plain(self, lines: Sequence[str]) -> bool:
        """Return whether each column has a decimal mark in all lines or in none, and no others."""
        thousands, *_ = NUMBER_PATTERNS[self.decimal]
        columns = zip(*map(self.cells, lines), strict=False)
        marks = [{(self.decimal in cell, thousands in cell) for cell in row} for row in columns]
        return all(found in ({(True, False)}, {(False, False)}) for found in marks)

    def parse(self, line: str) -> tuple[list[float | None], bool]:
        """Return the numbers of a line, None for cells without one, and whether it is data.

        A line is data if two or more cells and the first non-empty one are numbers. Empty cells at
        the end are ignored.
        """
        cells = self.cells(line.rstrip(f" {self.separator}"))
        row = [self.number(cell) for cell in cells]
        filled = [number for cell, number in zip(cells, row, strict=True) if cell]
        return row, sum(one is not None for one in filled) >= 2 and filled[0] is not None


CLOCK_PATTERN = re.compile(
    r"(?:(\d{4})-(\d\d)-(\d\d)[T ]\s*)?(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)(?:Z|[+-]\d\d:\d\d)?"
)
#: By decimal mark: the thousands separator, numbers with it, and numbers without it
NUMBER_PATTERNS = {
    mark: (
        thousands,
        re.compile(rf"[+-]?[1-9]\d{{0,2}}(\{thousands}\d{{3}})+(\{mark}\d+)?"),
        re.compile(rf"[+-]?(\d+\{mark}?\d*|\{mark}\d+)([eE][+-]?\d+)?"),
    )
    for mark, thousands in ((".", ","), (",", "."))
}
TABLE_FORMS = [_Form(s, d) for s in ("\t", ";", ",", "|", " ") for d in (".", ",") if s != d]
QUOTED_FORM = _Form(",", ",")  # decimal commas in quoted cells


def read_force_table(path: Path) -> tuple[Array, Array, str]:
    """Read times in s and forces in N; also return a text on their columns and units.

    Raises
    ------
    ForceError
        If the table is unreadable or ambiguous.
    """
    if path.stat().st_size > MAX_BYTES:
        raise ForceError(f"{path}: {path.stat().st_size} bytes, allowed: {MAX_BYTES} for a table")
    filled = [pair for pair in enumerate(_text_of(path).splitlines(), 1) if pair[1].strip()]
    # Excel's line that states the separator is no header.
    if filled and re.fullmatch(r"\"?sep=.?\"?", filled[0][1].strip(), re.IGNORECASE):
        filled = filled[1:]
    numbered = [pair for pair in filled if not COMMENT_PATTERN.match(pair[1])]
    if not numbered:
        raise _ambiguity(path, "empty")
    form, begin = _form_of(path, [line for _, line in numbered])
    body = numbered[begin:]
    width = Counter(len(form.cells(line)) for _, line in body[:SAMPLED_LINES]).most_common(1)[0][0]
    first = form.cells(body[0][1])[:width]
    clocks = [k for k, cell in enumerate(first) if CLOCK_PATTERN.fullmatch(cell)]
    # Seconds since the year 1 would be rounded to 8 µs.
    days = [int((form.number(first[k]) or 0) // 86400) for k in clocks]
    form = replace(form, day=max(days, default=0))
    values = np.full((len(body), width), np.nan)  # NaN stays where a cell is empty or text
    for own, (number, line) in zip(values, body, strict=True):
        row, good = form.parse(line)
        if not good:
            raise _ambiguity(
                path, f"line {number}: {line.strip()[:40]!r} is not a time and a force"
            )
        own[: len(row)] = row[:width]
    values[:, clocks] -= values[0, clocks]  # times of day are relative to the first
    header = []
    for _, line in filled[: filled.index(body[0])]:
        cells = form.cells(COMMENT_PATTERN.sub("", line, count=1))
        if not COMMENT_PATTERN.match(line) or (len(cells) >= width and _names_columns(cells)):
            header.append(cells)
    if form.separator == "," and header and 2 * len(header[-1]) == width > 2:
        raise _ambiguity(path, "its commas part columns and mark decimals")
    names, units = _header(header, width)
    labels = [f"{k} ({name})" if name else f"{k}" for k, name in enumerate(names, 1)]
    scaled, told = [], []
    found = _choose_columns(names, units, values)
    for kind, columns in found.items():
        if len(columns) != 1:
            pairs = zip(labels, units, strict=True)
            shown = ", ".join(f"{label} in {unit}" if unit else label for label, unit in pairs)
            which = "several columns may be" if columns else "no column is clearly"
            raise _ambiguity(path, f"{which} the {kind}, of columns {shown}")
        (k,) = columns
        for bad in np.flatnonzero(~np.isfinite(values[:, k])):
            where = f"line {body[bad][0]} has no number in column {labels[k]}"
            raise _ambiguity(path, f"{where}, the {kind}")
        if k in clocks:  # regardless of its name, such as "Time (UTC)" or "Time (h:m:s)"
            units[k] = "s"
        unit = units[k] or _unknown_unit(names[k])
        factor = 1e6 if unit == "MN" else SI_UNITS[kind].get((unit or SI_NAMES[kind]).lower())
        if factor is None:
            known = join_words([alike.split()[0] for alike in _WORDS["units"][kind]], "or")
            where = f"column {labels[k]}, the {kind}"
            raise ForceError(f"{path}: {where}, is in {unit}, allowed: {known}")
        scaled.append(values[:, k] * factor)
        told.append(f"{kind} from column {labels[k]} in {unit or SI_NAMES[kind]}")
    times, newtons = scaled
    steps = np.diff(times)
    for k in np.flatnonzero(steps <= 0)[:1] + 1:
        where = f"line {body[k][0]}: {times[k]:g} s"
        raise ForceError(f"{path}: {where}, allowed: after the line before")
    if len(times) < MIN_SAMPLES:
        raise ForceError(f"{path}: {len(times)} samples, allowed: {MIN_SAMPLES} or more")
    longest = MAX_STEP_RATIO * float(np.quantile(steps, 0.9))
    for k in np.flatnonzero(steps > longest)[:1]:
        where = f"line {body[k + 1][0]}: {steps[k]:g} s after the line before"
        raise ForceError(f"{path}: {where}, allowed: {longest:g} s; the force between is unknown")
    step, stated = float(np.median(steps)), units[found["time"][0]]
    if not stated and step > MAX_UNSTATED_STEP_S:
        raise _ambiguity(path, f"its times step by {step:g} and have no unit")
    return times, newtons, ", ".join(told)


def _text_of(path: Path) -> str:
    """Decode a file by its byte order mark, else as UTF-8, else as Windows-1252."""
    data = path.read_bytes()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")  # also reads UTF-8 without a mark
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _form_of(path: Path, lines: Sequence[str]) -> tuple[_Form, int]:
    """Find the separator, the decimal mark and the first line of numbers.

    A :class:`ForceError` is raised if no form fits, or if two forms give different numbers.
    """
    end = lines[-SAMPLED_LINES:]
    quoted = [QUOTED_FORM] if any('"' in line for line in end) else []
    parsed = {form: [form.parse(line) for line in end] for form in [*TABLE_FORMS, *quoted]}
    counts = {form: sum(good for _, good in rows) for form, rows in parsed.items()}
    most = max(counts.values())
    if most <= len(end) / 2:
        raise _ambiguity(path, f"{lines[len(lines) // 2].strip()[:40]!r} is not a time and a force")
    least = max(0.98 * most, len(end) / 2)
    best = [form for form, count in counts.items() if count > least]
    data = [k for k in range(len(end)) if all(parsed[form][k][1] for form in best)]
    numbers = {form: [parsed[form][k][0] for k in data] for form in best}
    best = [form for form in best if all(None not in row for row in numbers[form])] or best
    if any(numbers[best[0]] != numbers[other] for other in best):
        best = [form for form in best if form.is_plain([end[k] for k in data])] or best
    form = best[0]
    if any(numbers[form] != numbers[other] for other in best):
        marks = " or ".join(f"{one.separator!r} and {one.decimal!r}" for one in best)
        raise _ambiguity(
            path, f"its numbers can be read in two ways, by separator and mark {marks}"
        )
    usual = Counter(len(form.cells(end[k])) for k in data).most_common(1)[0][0]
    begin = next(
        k
        for k, line in enumerate(lines)
        if form.parse(line)[1]
        and (
            len(form.cells(line)) == usual  # a bad line after it belongs to the table
            or all(form.parse(after)[1] for after in lines[k : k + 5])
        )
    )
    return form, begin


def _header(rows: Sequence[Sequence[str]], width: int) -> tuple[list[str], list[str]]:
    """Return the name and unit of each column, empty where not given."""
    names, units = [""] * width, [""] * width
    for row in [row for row in rows if 1 < len(row) <= width + 1][-4:]:
        cells = [*row[:width], *[""] * (width - len(row))]
        alone, split = [cell.strip("[](). ,;") for cell in cells], [_split(cell) for cell in cells]
        known = [_is_unit(one) for one in alone]
        filled = [one.lower() for one in alone if one]
        both = all(table.keys() & filled for table in SI_UNITS.values())
        unnamed = both and sum(known) == len(filled)
        if unnamed or (any(names) and sum(known) >= max(1, len(filled) / 2)):
            units = [
                new if _is_unit(new) or (not old and _is_word(new)) else old
                for new, old in zip(alone, units, strict=True)
            ]
        elif not any(names) or any(_kinds(name) for name, _ in split):
            above = [""] * width if any(names) else units
            names = [name for name, _ in split]
            units = [unit or old for (_, unit), old in zip(split, above, strict=True)]
    return names, units


def _names_columns(cells: Sequence[str]) -> bool:
    """Return whether one cell of a comment names a time, another a force, or their units.

    Quantities, such as `step 1 ms, range 2 kN`, are no names.
    """
    if any(re.search(r"(?<![^\s:=])[\d.]+(?!\S)", cell) for cell in cells):
        return False
    names, units = _header([cells], len(cells))
    times, forces = (
        {k for k, name in enumerate(names) if kind in _kinds(name) or units[k].lower() in table}
        for kind, table in SI_UNITS.items()
    )
    return min(len(times), len(forces), len(times | forces) - 1) > 0


def _is_unit(text: str) -> bool:
    return any(text.lower() in table for table in (*SI_UNITS.values(), _WORDS["other_units"]))


def _split(cell: str) -> tuple[str, str]:
    """Split a header's cell into name and unit: `Kraft [N]`, `time_ms`, `F in kN`, `t/s`."""
    cell = cell.strip(" \"',;.")
    for form in UNIT_FORMS:
        match = re.fullmatch(form, cell)
        name, unit = (part.strip(" .") for part in match.groups()) if match else ("", "")
        direction = unit.lower() in ("h", "d") and "force" in _kinds(name)  # such as F_h
        if name and _is_unit(unit) and not direction:
            return name, unit
    return cell, ""


def _kinds(name: str) -> set[str]:
    """Return the possible kinds of a column by its name: time, force, index."""
    low = re.sub(r"[\s_]+", " ", name.lower()).strip()
    words = {low, *re.split(r"[ .:;/\\-]", low)}
    fits = {
        "time": words & NAMES["time"] or low.startswith(("time", "zeit")),
        "force": words & NAMES["force"] - {"f"} or low == "f" or "kraft" in low or "force" in low,
        "index": low in NAMES["index"] or low.startswith("unnamed"),
    }
    return {kind for kind, fit in fits.items() if fit}


def _choose_columns(names: list[str], units: list[str], values: Array) -> dict[str, list[int]]:
    """Return the columns that may be time and force, by name or unit, else from two by values."""
    every = range(values.shape[1])
    kinds = [_kinds(name) for name in names]
    in_s, in_n = ([k for k in every if units[k].lower() in table] for table in SI_UNITS.values())
    times = [k for k in every if "time" in kinds[k] and k not in in_n] or in_s
    forces = [k for k in every if "force" in kinds[k] and k not in times]
    forces = [k for k in forces if k in in_n] or forces or in_n
    if len(times) > 1:  # such as a date, and a time since the start
        times = [k for k in times if (np.diff(values[:, k]) > 0).all()]
        times = [k for k in times if k in in_s] or times
    free = [k for k in every if np.isfinite(values[:, k]).all()]
    counts = [k for k in free if set(np.diff(values[:, k])) == {1.0}]
    free = [k for k in free if kinds[k] != {"index"} or k not in counts]
    if len(free) == 2:
        rising = [k for k in free if k not in forces and (np.diff(values[:, k]) > 0).all()]
        times = times or rising[:1]
        forces = forces or [k for k in free if k not in times and k not in counts]
    return {"time": times, "force": forces}


def _unknown_unit(name: str) -> str:
    """Return the text in brackets at a name's end if it may be a unit, else an empty text."""
    end = re.fullmatch(r".*[\[(]([^\])]*)[\])]", name)
    return end[1].strip() if end and _is_word(end[1]) else ""


def _is_word(text: str) -> bool:
    """Return whether a text may be an unknown unit: not a number, channel or column name."""
    channel = re.match(r"ch(annel)?([\W\d_]|$)", text.lower())
    return bool(re.search(r"[^\W\d_]", text)) and not channel and not _kinds(text)
