"""What Sphinx has made is kept: an edit takes one page, and gives what making all would give."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

pytest.importorskip("jupyter_book", reason="the book needs jupyter-book")

from conftest import PROJECT
from thesis_lib import files
from thesis_lib.book import kept, site
from thesis_lib.web.page import BookError

PAGES = {
    "intro.md": "# Start\n\n(here)=\n## Here\n\n[There](there)\n",
    "second.md": "# Second\n\n(there)=\n## There\n\n```{include} piece.txt\n```\n\n[Here](here)\n\n"
    "![A line](old.svg)\n",
    "third.md": "# Third\n\n```{eval-rst}\n.. automodule:: thesis_lib.asides\n   :members:\n```\n",
    "piece.txt": "Old words\n",
    "old.svg": '<svg xmlns="http://www.w3.org/2000/svg"><path d="M 0 1"/></svg>',
    "new.svg": '<svg xmlns="http://www.w3.org/2000/svg"><path d="M 0 2"/></svg>',
    "_toc.yml": "format: jb-book\nroot: intro\nchapters: [{file: second}, {file: third}]\n",
    "references.bib": "",
}


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A project with a book of three pages."""
    if not (PROJECT / "build" / "assets").is_dir():
        pytest.skip("no build/assets: render the book first")
    root = tmp_path / "small"
    root.mkdir()
    for name in ("_config.yml", "package.json", "package-lock.json", "requirements.lock"):
        shutil.copy(PROJECT / name, root)
    shutil.copytree(PROJECT / "book" / "assets", root / "book" / "assets")
    shutil.copytree(PROJECT / "build" / "assets", root / "build" / "assets")
    for name, text in PAGES.items():
        (root / "book" / name).write_text(text)
    return root


def edit(page: Path, old: str, new: str) -> None:
    """Change a page as a copy from elsewhere may: its date is an old one."""
    was = page.stat()
    text = page.read_text()
    assert old in text
    page.write_text(text.replace(old, new))
    os.utime(page, ns=(was.st_atime_ns, was.st_mtime_ns))


def read(root: Path) -> dict[str, int]:
    """When each page was read."""
    trees = (root / "build" / "cache" / "pages" / "_build" / ".doctrees").glob("*.doctree")
    return {tree.stem: tree.stat().st_mtime_ns for tree in trees}


def written(root: Path) -> dict[str, int]:
    """When each page was written that is not written always."""
    html = root / "build" / "cache" / "pages" / "_build" / "html"
    pages = {page.relative_to(html).as_posix(): page for page in html.rglob("*.html")}
    always = ("genindex", "py-modindex", "search", "_static")
    return {n: p.stat().st_ctime_ns for n, p in pages.items() if not n.startswith(always)}


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a folder."""
    inside = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in inside}


def changed(before: dict[str, int], after: dict[str, int]) -> set[str]:
    """What has another time."""
    return {name for name in before if before[name] != after[name]}


@pytest.mark.book
def test_an_edit_takes_its_page_alone_and_gives_what_making_all_gives(small: Path) -> None:
    html = small / "build" / "html"
    site.render(small, html)
    were_read, were_written = read(small), written(small)
    edit(small / "book" / "piece.txt", "Old", "New")
    edit(small / "book" / "second.md", "old.svg", "new.svg")
    site.render(small, html)
    assert changed(were_read, read(small)) == {"second"}
    home = "intro.html"  # which Sphinx writes always
    assert changed(were_written, written(small)) == {"second.html", home}
    assert "New words" in (html / "second.html").read_text()
    assert [file.name for file in (html / "_images").iterdir()] == ["new.svg"]

    edit(small / "book" / "second.md", "## There", "## Where")  # which the others' margins tell
    were_read, were_written = read(small), written(small)
    site.render(small, html)
    assert changed(were_read, read(small)) == {"second"}
    assert changed(were_written, written(small)) == {*were_written} - {"index.html"}
    shutil.rmtree(small / "build" / "cache")
    site.render(small, small / "build" / "other")
    assert contents(html) == contents(small / "build" / "other")


@pytest.mark.book
def test_all_is_made_anew_by_other_settings_or_if_a_kept_page_is_damaged(small: Path) -> None:
    html = small / "build" / "html"
    site.render(small, html)
    first, whole = read(small), contents(html)
    kept_page = small / "build" / "cache" / "pages" / "_build" / "html" / "third.html"
    kept_page.write_text("No page")
    site.render(small, html)
    second = read(small)
    assert contents(html) == whole
    assert min(second.values()) > max(first.values())
    edit(small / "_config.yml", "title: Vib", "title: Bib")
    site.render(small, html)
    assert "Bibration" in (html / "second.html").read_text()
    assert min(read(small).values()) > max(second.values())


@pytest.mark.book
def test_a_reference_that_loses_its_target_is_told_though_its_page_is_as_it_was(
    small: Path,
) -> None:
    html = small / "build" / "html"
    site.render(small, html)
    whole = (html / "intro.html").read_bytes()
    edit(small / "book" / "second.md", "(there)=", "(elsewhere)=")
    for _ in range(2):  # nor is it forgotten
        with pytest.raises(BookError, match=r"intro\.md.*there"):
            site.render(small, html)
        assert (html / "intro.html").read_bytes() == whole
    edit(small / "book" / "second.md", "(elsewhere)=", "(there)=")
    site.render(small, html)
    assert (html / "intro.html").read_bytes() == whole


def test_nothing_is_kept_of_a_rendering_that_failed_or_of_other_settings(tmp_path: Path) -> None:
    (tmp_path / "_config.yml").write_text("title: one")

    def found() -> bool:
        with kept.reading(tmp_path) as folder:
            there = (folder / "_build").is_dir()
            files.whole_text(folder / "_build" / "page", "words")
        return there

    assert [found(), found()] == [False, True]
    with pytest.raises(ZeroDivisionError), kept.reading(tmp_path):
        1 / 0  # noqa: B018
    assert [found(), found()] == [False, True]
    (tmp_path / "_config.yml").write_text("title: two")
    assert [found(), found()] == [False, True]
