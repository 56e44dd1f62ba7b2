"""Status messages on standard error, which change no result."""

from __future__ import annotations

import os
import re
import shutil
import sys

import click

from thesis_lib.text import message, visible

QUIET_VARIABLE = "THESIS_QUIET"
"""Set in the environment of kernels, whose standard error would be an output of the notebook."""
VERDICT_COLOURS = {"agrees": "green", "within scatter": "yellow", "differs": "red"}
_VERDICT_PATTERN = re.compile("|".join(VERDICT_COLOURS))


def aside(text: str) -> None:
    """Write one line on standard error, but not in a notebook's kernel, where it is output."""
    if QUIET_VARIABLE not in os.environ:
        say(message(text))


def echo(*lines: str, err: bool = False, verdicts: bool = False) -> None:
    """Print lines on standard output, or on standard error; on a screen with coloured verdicts.

    Names of files are anybody's: what could act on a screen is written out, a line feed too.
    """
    coloured = verdicts and not err and sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    for line in map(visible, lines):
        click.echo(_VERDICT_PATTERN.sub(_colour_verdict, line) if coloured else line, err=err)


def _colour_verdict(found: re.Match[str]) -> str:
    return click.style(found[0], fg=VERDICT_COLOURS[found[0]])


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
