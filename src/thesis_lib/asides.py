"""Remarks that change no result, for whoever waits for a command."""

from __future__ import annotations

import os
import sys

from thesis_lib.text import message

QUIET = "THESIS_QUIET"
"""Set in the environment of kernels, whose standard error would be an output of the notebook."""
_told: list[str] = []


def aside(text: str) -> None:
    """Tell something beside the result, as one line on standard error.

    In a notebook's kernel it would become an output; there the command that runs it passes it on.
    """
    _told.append(message(text))
    if QUIET not in os.environ:
        print(_told[-1], file=sys.stderr, flush=True)


def asides() -> list[str]:
    """What has been told aside in this process."""
    return list(_told)
