"""What people and files say, as text: nothing in it is hidden, and messages are one short line."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

HIDDEN = {"Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"}  # Unicode's categories of what has no glyph
# Letters and marks that are drawn as nothing: joiners, fillers, selectors, Braille without a dot.
_BLANK = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0"
    "\U000e0100-\U000e01ef]"
)
LONGEST = 400  # characters of a message


def hidden(text: str) -> str:
    """The first character that a reader would not see, by number and name, or empty.

    Examples
    --------
    >>> hidden("plain"), hidden("a" + chr(0x202E) + "b"), hidden("a" + chr(0) + "b")
    ('', 'U+202E (RIGHT-TO-LEFT OVERRIDE)', 'U+0000 (a control character)')
    """
    for one in text:
        kind = unicodedata.category(one)
        if kind in HIDDEN or _BLANK.match(one):
            other = {
                "Cc": "a control character",
                "Cs": "half of a character",
                "Co": "a private character",
            }.get(kind, "no character")
            return f"U+{ord(one):04X} ({unicodedata.name(one, other)})"
    return ""


def strings(value: Any, place: str = "") -> Iterator[tuple[str, str]]:
    """Every text in plain values, keys of objects included, with its place such as ``a.b[2]``."""
    left = [(place, value)]
    while left:  # no recursion: values may be nested without measure
        place, value = left.pop()
        if isinstance(value, str):
            yield place, value
        elif isinstance(value, Mapping):
            for key, inside in reversed(list(value.items())):
                yield place or "a field's name", str(key)
                shown = key if str(key).isidentifier() else one_line(repr(key))
                left.append((f"{place[:80]}.{shown}".lstrip("."), inside))
        elif isinstance(value, list | tuple):
            left += reversed([(f"{place[:80]}[{i}]", inside) for i, inside in enumerate(value)])


def first_hidden(value: Any, place: str = "") -> str:
    """What is wrong with the first text in plain values that hides something, or empty."""
    for where, text in strings(value, place):
        if found := hidden(text):
            given = f"given {one_line(repr(text))} with {found}"
            return f"{one_line(where)}: {given}, allowed: visible text"
    return ""


def visible(text: str) -> str:
    """The text with every character that could act on a screen written out."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str, longest: int = 60) -> str:
    """At most so many characters of a text, on one line."""
    text = visible(text)
    return text if len(text) <= longest else text[: longest - 3] + "..."


def duration(seconds: float) -> str:
    """A time in words, as exact as one plans with it.

    Examples
    --------
    >>> duration(0.2), duration(7.4), duration(89), duration(170), duration(7300)
    ('1 s', '7 s', '1 min', '3 min', '122 min')
    """
    minutes = seconds >= 60
    return f"{max(round(seconds / 60 if minutes else seconds), 1)} {'min' if minutes else 's'}"


def listed(names: Iterable[str], command: str) -> str:
    """All names there are, or the command that shows them where a message has no room for them."""
    all_ = ", ".join(names)
    return f"there are {all_}" if len(all_) <= LONGEST - 100 else f"`{command}` names them all"


def message(text: str) -> str:
    """A message as one line of at most :data:`LONGEST` characters; the end says how to go on."""
    text = visible(text.strip())
    if len(text) <= LONGEST:
        return text
    half = (LONGEST - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"


def of_error(error: BaseException) -> str:
    """An error that nobody foresaw, in words: its kind comes first, its text may be anything.

    The system's errors are told by their file and what is wrong with it.

    Examples
    --------
    >>> of_error(OSError(28, "No space left on device", "cubes/a.nc"))
    'cubes/a.nc: No space left on device'
    >>> of_error(KeyError("case"))
    "KeyError: 'case'"
    """
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def damaged(path: Path, line: int, problem: str) -> str:
    """What is said of a published file that is not as it was."""
    mend = f"`git checkout {path}`, or installing the library anew, restores it"
    return f"{path}: damaged: line {line} {problem}; {mend}"
