"""A small book through Sphinx: edits show, lost references are reported."""

import shutil
from pathlib import Path

import pytest

pytest.importorskip("jupyter_book", reason="the book needs jupyter-book")

from conftest import PROJECT
from thesis_lib.book import rendering
from thesis_lib.web.page import BookError

PAGES = {
    "intro.md": "# Start\n\n(here)=\n## Here\n\n[There](there)\n",
    "second.md": "# Second\n\n(there)=\n## There\n\n```{include} piece.txt\n```\n\n[Here](here)\n\n"
    "![A line](line.svg)\n",
    "third.md": "# Third\n\n```{eval-rst}\n.. automodule:: thesis_lib.text\n   :members:\n```\n",
    "piece.txt": "Old words\n",
    "line.svg": '<svg xmlns="http://www.w3.org/2000/svg" width="72pt" height="36pt"/>',
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
    for name in ("_config.yml", "package.json", "package-lock.json"):
        shutil.copy(PROJECT / name, root)
    shutil.copytree(PROJECT / "book" / "assets", root / "book" / "assets")
    shutil.copytree(PROJECT / "build" / "assets", root / "build" / "assets")
    shutil.copy(PROJECT / "book" / "conf.py", root / "book")
    for name, text in PAGES.items():
        (root / "book" / name).write_text(text)
    return root


def edit(page: Path, old: str, new: str) -> None:
    text = page.read_text()
    assert old in text
    page.write_text(text.replace(old, new))


@pytest.mark.nightly
@pytest.mark.book
def test_edits_show_and_a_lost_reference_is_reported_until_it_is_mended(small: Path) -> None:
    html = small / "build" / "html"
    assert rendering.render_pages(small) == html / "index.html"
    page = (html / "second.html").read_text()
    assert 'width="96" height="48"' in page
    edit(small / "book" / "piece.txt", "Old", "New")
    rendering.render_pages(small)
    page = (html / "second.html").read_text()
    assert "New words" in page
    edit(small / "book" / "second.md", "[Here](here)", "[Here](nowhere)")
    for _ in range(2):  # nor is it forgotten
        with pytest.raises(BookError, match=r"second\.md.*nowhere"):
            rendering.render_pages(small)
        assert (html / "second.html").read_text() == page
    edit(small / "book" / "second.md", "[Here](nowhere)", "[Here](here)")
    edit(small / "_config.yml", "title: Vib", "title: Bib")
    rendering.render_pages(small)
    assert "Bibration" in (html / "third.html").read_text()
