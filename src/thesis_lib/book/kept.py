"""What Sphinx has read and written of the pages is kept, so that an edit takes a page, not all.

What was read is believed only if a rendering without a warning left it, all files are what they
were, and its pages, and whatever these include or document, still hold what they held: contents
count, not dates (:mod:`thesis_lib.book.extension`). What was written stays while it would be
written alike (:mod:`thesis_lib.book.writing`). If the book's settings, contents, bibliography,
packages or the code of this room have changed, all is made anew.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from thesis_lib import files, records

SETTINGS = ("_config.yml", "book/_toc.yml", "book/references.bib", "requirements.lock")
"""What every page rests on, beside the modules of this room."""


@contextmanager
def reading(root: Path) -> Iterator[Path]:
    """A folder with what Sphinx made of a project's book the last time, or with nothing in it.

    What is in it is kept if the block ends without an error.
    """
    folder = root / "build" / "cache" / "pages"
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "read.json"
    own = sorted(Path(__file__).parent.glob("*.py"))
    made_from = files.digest_of([*(root / name for name in SETTINGS), *own])
    made = folder / "_build"
    with files.one_at_a_time(folder):
        found = records.read(record)
        if found is None or found.made_from != made_from or records.damage(record, [made]):
            shutil.rmtree(made, ignore_errors=True)
        record.unlink(missing_ok=True)
        yield folder
        records.write(record, made_from, [made])
