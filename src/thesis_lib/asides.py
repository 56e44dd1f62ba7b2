"""Status messages on standard error, which change no result."""

from __future__ import annotations

import os
import shutil
import sys

import click

from thesis_lib.text import message, visible

QUIET_VARIABLE = "THESIS_QUIET"
"""Set in the environment of kernels, whose standard error would be an output of the notebook."""


def aside(text: str) -> None:
    """Write one line on standard error, but not in a notebook's kernel, where it is output."""
    if QUIET_VARIABLE not in os.environ:
        say(message(text))


def echo(*lines: str, err: bool = False) -> None:
    """Print lines on standard output, or on standard error.

    Names of files are anybody's: what could act on a screen is written out, a line feed too.
    """
    for line in lines:
        click.echo(visible(line), err=err)


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
