"""The book: names of the figures on its pages, and the check whether it is up to date.

The check compares digests of files and imports little. The tasks of ``dodo.py`` find what is out
of date more precisely, but take some seconds.
"""

import re
from collections.abc import Iterable
from pathlib import Path

from thesis_lib.files import digest_of, folder_files, project_root, whole_text

SOURCE_FOLDERS = (
    "src/thesis_lib", "notebooks", "book", "data", "requirements", "dodo.py", "_config.yml",
    "package.json", "package-lock.json", "build/conformance.xml",
)  # fmt: skip
STATE_FILE = "build/.book"
OUTPUT_FOLDERS = ("book/executed", "data/results", "build/html", "build/assets")
_INCLUDE_PATTERN = re.compile(r"executed/(fig-[\w-]+)\.md")


def find_figure_names(pages: Iterable[Path]) -> list[str]:
    """Return the names of the figures that `pages` include."""
    texts = (page.read_text(encoding="utf-8") for page in pages if page.suffix == ".md")
    return sorted({name for text in texts for name in _INCLUDE_PATTERN.findall(text)})


def source_digest() -> str:
    """Return the digest of all source files of the book."""
    outputs = {project_root() / place for place in OUTPUT_FOLDERS}
    written = _list_files(SOURCE_FOLDERS)
    return digest_of(path for path in written if outputs.isdisjoint(path.parents))


def remember_state(sources: str) -> None:
    """Store the state of a book that has just been built from sources with this digest."""
    whole_text(project_root() / STATE_FILE, _describe_state(sources))


def is_up_to_date() -> bool:
    """Return whether sources and book are unchanged since the book was finished."""
    record = project_root() / STATE_FILE
    return record.is_file() and record.read_text("utf-8") == _describe_state(source_digest())


def _describe_state(sources: str) -> str:
    return f"{sources} {digest_of(_list_files(OUTPUT_FOLDERS))}\n"


def _list_files(places: tuple[str, ...]) -> list[Path]:
    return folder_files(project_root() / place for place in places)
