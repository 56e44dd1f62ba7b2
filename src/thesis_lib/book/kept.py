"""What Sphinx has read of the pages is kept, so that an edit reads a page anew, not all of them.

All pages are written each time, so none is stale and references between them are checked as ever.
What was read is believed only if a rendering without a warning left it and its pages, and whatever
these include or document, still hold what they held: contents count, not dates. If the book's
settings, contents, bibliography, packages or this extension have changed, all is read anew.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from thesis_lib import files, records

SETTINGS = ("_config.yml", "book/_toc.yml", "book/references.bib", "requirements.lock")
"""What every page rests on, beside the modules of this extension."""


@contextmanager
def reading(root: Path) -> Iterator[Path]:
    """A folder with what Sphinx read of a project's book the last time, or with nothing in it.

    What is in it is kept if the block ends without an error.
    """
    folder = root / "build" / "cache" / "pages"
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "read.json"
    own = sorted(Path(__file__).parent.glob("*.py"))
    made_from = files.digest_of([*(root / name for name in SETTINGS), *own])
    with files.one_at_a_time(folder):
        found = records.read(record)
        if found is None or found.made_from != made_from:
            shutil.rmtree(folder / "_build", ignore_errors=True)
        record.unlink(missing_ok=True)
        yield folder
        records.write(record, made_from, [])
