"""The book: the figures that its pages show, and whether a finished one is up to date.

The latter is decided by the contents of its files, before much is imported. The tasks of
``dodo.py`` know better what is stale, but to ask them takes some seconds.
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
    """Return names of the figures that `pages` show."""
    texts = (page.read_text(encoding="utf-8") for page in pages if page.suffix == ".md")
    return sorted({name for text in texts for name in _INCLUDE_PATTERN.findall(text)})


def source_digest() -> str:
    """Return the digest of all that people write."""
    outputs = {project_root() / place for place in OUTPUT_FOLDERS}
    written = _list_files(SOURCE_FOLDERS)
    return digest_of(path for path in written if outputs.isdisjoint(path.parents))


def remember_state(sources: str) -> None:
    """Keep the state of a book that has just been finished, made from sources of this digest."""
    whole_text(project_root() / STATE_FILE, _describe_state(sources))


def is_up_to_date() -> bool:
    """Return whether sources and book are as they were when the book was finished."""
    record = project_root() / STATE_FILE
    return record.is_file() and record.read_text("utf-8") == _describe_state(source_digest())


def _describe_state(sources: str) -> str:
    return f"{sources} {digest_of(_list_files(OUTPUT_FOLDERS))}\n"


def _list_files(places: tuple[str, ...]) -> list[Path]:
    return folder_files(project_root() / place for place in places)
