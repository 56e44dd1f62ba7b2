"""Remarks that change no result, for whoever waits for a command."""

from __future__ import annotations

import os
import shutil
import sys

import click

from thesis_lib.text import message, visible

QUIET = "THESIS_QUIET"
"""Set in the environment of kernels, whose standard error would be an output of the notebook."""
_told: list[str] = []


def aside(text: str) -> None:
    """Tell something beside the result, as one line on standard error.

    In a notebook's kernel it would become an output; there the command that runs it passes it on.
    """
    _told.append(message(text))
    if QUIET not in os.environ:
        say(_told[-1])


def echo(*lines: str, err: bool = False) -> None:
    """Print lines on standard output, or on standard error.

    Names of files are anybody's: what could act on a screen is written out, a line feed too.
    """
    for line in lines:
        click.echo(visible(line), err=err)


def live() -> bool:
    """Whether standard error is a screen, on which a line can be written over."""
    return not sys.stderr.closed and sys.stderr.isatty()


def say(line: str, passing: bool = False) -> None:
    """Write a line on standard error; on a screen over a passing one, which the next replaces."""
    if live():
        width = shutil.get_terminal_size().columns - 1
        line = f"\r\x1b[K{line[:width] if passing else line}"
    sys.stderr.write(line if passing else f"{line}\n")
    sys.stderr.flush()


def asides() -> list[str]:
    """What has been told aside in this process."""
    return list(_told)
