"""Failures of steps: what is told in one line, and where the traceback is."""

from __future__ import annotations

import contextlib
import re
import shutil
import traceback
from pathlib import Path

from thesis_lib.files import workplace
from thesis_lib.text import message, of_error
from thesis_lib.web.page import BookError

MIN_FREE_BYTES = 2**20  # a disk with less is full


class RunError(RuntimeError):
    """A run that failed; the message says what failed, where, and how to go on."""


def describe_failure(name: str, error: Exception, *places: Path) -> str:
    """Return in one line why a step failed; of errors that are not ours, keep the traceback."""
    if isinstance(error, RunError | BookError):
        text = "\n".join(map(message, str(error).splitlines()))
    else:
        text = full_disk(*places) or f"{of_error(error)}; {write_log(name)}"
    return text if text.startswith(name) else f"{name}: {text}"


def full_disk(*places: Path) -> str:
    """Return what to say if one of the disks in use is full; libraries find odd words for that."""
    for place in (*places, workplace()):
        with contextlib.suppress(OSError):
            if shutil.disk_usage(place).free < MIN_FREE_BYTES:
                return f"the disk of {place} is full; make room, and run the same command again"
    return ""


def write_log(name: str, text: str = "") -> str:
    """Keep a traceback, by default that of the handled error; return a sentence on where it is."""
    slug = re.sub(r"[^\w-]+", "-", name)
    path = workplace() / "build" / "logs" / f"{slug}.txt"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text or traceback.format_exc(), encoding="utf-8")
    except OSError as error:
        return f"the traceback could not be kept ({of_error(error)})"
    return f"the traceback is in {path}"
