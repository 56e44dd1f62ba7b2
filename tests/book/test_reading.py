"""The pages that a reader goes through first are short, illustrated, and in short sentences."""

import re

import pytest

from thesis_lib import files

BOOK = files.project_root() / "book"
PATH = ("intro", "rounding", "laboratory", "sound", "conclusions", "beam", "plate")
PAGES = sorted(
    page.stem for page in BOOK.glob("*.md") if page.stem not in ("glossary", "references")
)
_BLOCK = re.compile(r"^\s*(`{3,}|\${2})[^\n]*\n.*?^\s*\1", re.MULTILINE | re.DOTALL)
_PRONOUN = re.compile(r"(It|They|Its|Their|(This|That|These|Those) (is|are|was|does|makes))\b")
_PICTURE = re.compile(r"\{figure\}|:file: executed/|executed/fig-[\w-]+\.md")


def prose(page: str) -> str:
    """A page's sentences: without tables, formulas, code, directives' heads and addresses."""
    text = (BOOK / f"{page}.md").read_text(encoding="utf-8")
    text = re.sub(r"^```\{figure\}[^\n]*\n(?::[^\n]*\n)*(.*?)^```", r"\1", text, flags=re.M | re.S)
    text = _BLOCK.sub(".", text)
    return re.sub(r"^(\||:|#|\().*$|\]\([^)]*\)|<[^>]*>|\{\w+\}|\$[^$]*\$", " ", text, flags=re.M)


def words(text: str) -> list[str]:
    return re.findall(r"[^\W\d_][\w'’⁻-]*|\d[\d.,]*", text)


def sentences(page: str) -> list[int]:
    """Numbers of words of a page's sentences; two words are a label."""
    parts = re.split(r"[.!?:;](?:\s|$)|\n\s*\n|\n\s*[*] ", prose(page))
    return [n for n in (len(words(part)) for part in parts) if n > 2]


def opened_by_a_pronoun(page: str) -> list[str]:
    """Sentences whose first word stands for what a sentence before has named."""
    parts = re.split(r"(?<=[.!?:;])\s+|\n\s*\n|\n\s*[*] ", prose(page))
    return [" ".join(part.split()) for part in parts if _PRONOUN.match(part.strip().lstrip("* "))]


def test_words_pictures_and_sentences_are_counted():
    assert len(words("A beam, 25 markers: it's 3.5 px.")) == 7
    found = len(_PICTURE.findall((BOOK / "sound.md").read_text(encoding="utf-8")))
    assert found > 3


@pytest.mark.parametrize("page", PATH)
def test_no_sentence_of_the_reading_path_opens_with_a_pronoun(page):
    assert opened_by_a_pronoun(page) == []


def test_the_reading_path_is_short():
    lengths = {page: len(words(prose(page))) for page in PATH}
    assert sum(lengths.values()) <= 9000, lengths
    assert max(lengths.values()) <= 1800, lengths


@pytest.mark.parametrize("page", PAGES)
def test_sentences_are_short(page):
    assert sum(sentences(page)) / len(sentences(page)) <= 20


@pytest.mark.parametrize("page", PATH)
def test_a_chapter_argues_with_pictures(page):
    text = (BOOK / f"{page}.md").read_text(encoding="utf-8")
    assert 250 * len(_PICTURE.findall(text)) >= len(words(prose(page)))
    first = text[: _PICTURE.search(text).start()]
    assert len(words(first)) <= 160  # within the first screen
