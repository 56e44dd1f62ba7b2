"""Validate user text, and print the output of commands: lines, status messages, JSON.

Texts have no hidden characters, and messages are one short line. Lines and JSON go to standard
output, status messages to standard error; none of them changes a result.
"""

import json
import os
import re
import sys
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

# Unicode categories of characters without a glyph
HIDDEN_CATEGORIES = {"Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"}
MAX_MESSAGE_LENGTH = 400  # characters of a message


class RefusedError(ValueError):
    """A request that is refused, exit status 2; the message is one line for the user."""


class FailedError(RuntimeError):
    """Something that failed, exit status 1; the message has a line for the user per failure."""


def has_hidden(text: str) -> bool:
    """Return whether a text has a character that a reader would not see.

    Examples
    --------
    >>> has_hidden("plain"), has_hidden("a" + chr(0x202E) + "b"), has_hidden("a" + chr(0) + "b")
    (False, True, True)
    """
    return any(unicodedata.category(one) in HIDDEN_CATEGORIES for one in text)


def parse_json(text: str) -> Any:
    """Return the value of a JSON text, or the text itself where it is not JSON.

    Raises
    ------
    KeyError
        If an object has a key twice: the intended value is unknown.

    Examples
    --------
    >>> parse_json("[1, 2]"), parse_json("force")
    ([1, 2], 'force')
    """
    try:
        return json.loads(text, object_pairs_hook=_refuse_repeated_keys)
    except (ValueError, RecursionError):  # no JSON, or beyond the parser's limits
        return text


def _refuse_repeated_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise KeyError(name)
        found[name] = value
    return found


def escape_unprintable(text: str) -> str:
    """Return the text with unprintable characters escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str, longest: int = 60) -> str:
    """Shorten a text to one line of at most `longest` characters."""
    text = escape_unprintable(text)
    return text if len(text) <= longest else text[: longest - 3] + "..."


def format_list(names: Iterable[str], command: str) -> str:
    """List all names or, if the list is too long, name the command that shows them."""
    all_ = ", ".join(names)
    fits = len(all_) <= MAX_MESSAGE_LENGTH - 100
    return f"there are {all_}" if fits else f"`{command}` names them all"


def message(text: str) -> str:
    """Shorten a message to a line of :data:`MAX_MESSAGE_LENGTH` characters; cut its middle."""
    text = escape_unprintable(text.strip())
    if len(text) <= MAX_MESSAGE_LENGTH:
        return text
    half = (MAX_MESSAGE_LENGTH - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"


def describe_error(error: BaseException) -> str:
    """Describe an unexpected error by its type and its text, which may be anything.

    A system error is described by its file and the problem with it.

    Examples
    --------
    >>> describe_error(OSError(28, "No space left on device", "cubes/a.nc"))
    'cubes/a.nc: No space left on device'
    >>> describe_error(KeyError("case"))
    "KeyError: 'case'"
    """
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def format_share(share: float) -> str:
    """Format a share in percent, whole from 10 % on, else with one decimal."""
    return f"{100 * share:.{0 if share >= 0.1 else 1}f} %"


def describe_damage(path: Path, problem: object) -> str:
    """Return the message on an unreadable published file, with the command that restores it."""
    mend = f"`git checkout {path}`, or installing the library again, restores it"
    return f"{path}: damaged ({one_line(str(problem), 120)}); {mend}"


QUIET_VARIABLE = "THESIS_QUIET"
"""Set in the environment of kernels, whose standard error would be an output of the notebook."""
JSON_OPTION = click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
_VERDICT_COLOURS = {"agrees": "green", "within scatter": "yellow", "differs": "red"}
_VERDICT_PATTERN = re.compile("|".join(_VERDICT_COLOURS))


def print_status(text: str) -> None:
    """Print a line on standard error, but not in a kernel, where it would be cell output."""
    if QUIET_VARIABLE not in os.environ:
        echo(message(text), err=True)


def echo(*lines: str, err: bool = False, verdicts: bool = False, colour: str = "") -> None:
    """Print lines on standard output, or on standard error.

    On a terminal, unless NO_COLOR is set, verdicts or whole lines are coloured if asked for.
    Unprintable characters, line feeds included, are escaped: file names may contain any.
    """
    on_screen = not err and sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    for line in map(escape_unprintable, lines):
        shown = _VERDICT_PATTERN.sub(_colour_verdict, line) if verdicts and on_screen else line
        click.echo(click.style(shown, fg=colour) if colour and on_screen else shown, err=err)


def _colour_verdict(found: re.Match[str]) -> str:
    return click.style(found[0], fg=_VERDICT_COLOURS[found[0]])


def print_json(value: Any) -> None:
    """Print a value as one JSON document on standard output; NaN and infinities are null."""
    from pydantic_core import to_jsonable_python

    plain = to_jsonable_python(value, inf_nan_mode="null", fallback=lambda one: one.tolist())
    click.echo(json.dumps(plain, ensure_ascii=False, indent=1))
