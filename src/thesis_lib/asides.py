"""What commands print: lines and JSON on standard output, status messages on standard error.

None of it changes a result.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from typing import Any

import click

from thesis_lib.text import message, visible

QUIET_VARIABLE = "THESIS_QUIET"
"""Set in the environment of kernels, whose standard error would be an output of the notebook."""
JSON_OPTION = click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
_VERDICT_COLOURS = {"agrees": "green", "within scatter": "yellow", "differs": "red"}
_VERDICT_PATTERN = re.compile("|".join(_VERDICT_COLOURS))


def aside(text: str) -> None:
    """Write one line on standard error, but not in a notebook's kernel, where it is output."""
    if QUIET_VARIABLE not in os.environ:
        say(message(text))


def echo(*lines: str, err: bool = False, verdicts: bool = False, colour: str = "") -> None:
    """Print lines on standard output, or on standard error.

    On a screen, unless NO_COLOR is set, verdicts are coloured if asked for, or whole lines are.
    Names of files are anybody's: what could act on a screen is written out, a line feed too.
    """
    on_screen = not err and sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    for line in map(visible, lines):
        shown = _VERDICT_PATTERN.sub(_colour_verdict, line) if verdicts and on_screen else line
        click.echo(click.style(shown, fg=colour) if colour and on_screen else shown, err=err)


def _colour_verdict(found: re.Match[str]) -> str:
    return click.style(found[0], fg=_VERDICT_COLOURS[found[0]])


def print_json(value: Any) -> None:
    """Print a value as one JSON document on standard output; what is not finite is null."""
    from pydantic_core import to_jsonable_python

    plain = to_jsonable_python(value, inf_nan_mode="null", fallback=lambda one: one.tolist())
    click.echo(json.dumps(plain, ensure_ascii=False, indent=1))


def live() -> bool:
    """Return whether standard error is a screen, on which a line can be written over."""
    return not sys.stderr.closed and sys.stderr.isatty()


def say(line: str, passing: bool = False) -> None:
    """Write a line on standard error; on a screen over a passing one, which the next replaces."""
    if live():
        width = shutil.get_terminal_size().columns - 1
        line = f"\r\x1b[K{line[:width] if passing else line}"
    sys.stderr.write(line if passing else f"{line}\n")
    sys.stderr.flush()
