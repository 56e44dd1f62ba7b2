"""Whether a book is what it was, which is asked of every file of it and of nothing else."""

from __future__ import annotations

import os
import shutil

import pytest

from thesis_lib.book import unchanged

FILES = (
    "notebooks/a.ipynb",
    "book/page.md",
    "book/executed/a.ipynb",
    "data/thesis/facts.toml",
    "data/results/a.nc",
    "tests/test_a.py",
    "benchmarks/a.py",
    "_config.yml",
    "package.json",
    "package-lock.json",
    "build/assets/mathjax/es5/tex.js",
    "build/html/index.html",
    "build/html/_static/script.js",
    "build/book.zip",
)


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setattr(unchanged, "project_root", lambda: tmp_path)
    for name in FILES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"what {name} says")
    made = [tmp_path / "build" / "html", tmp_path / "build" / "book.zip"]
    unchanged.remember(made, unchanged.written())
    assert unchanged.is_unchanged() == tmp_path / "build" / "html" / "index.html"
    return tmp_path


@pytest.mark.parametrize("name", FILES)
def test_an_edited_byte_a_lost_and_a_new_file_are_noticed(root, name):
    path = root / name
    whole, time = path.read_bytes(), path.stat().st_mtime_ns
    path.write_bytes(b"W" + whole[1:])
    os.utime(path, ns=(time, time))
    assert unchanged.is_unchanged() is None
    path.write_bytes(whole)
    assert unchanged.is_unchanged() is not None
    path.rename(path.with_name("other"))
    assert unchanged.is_unchanged() is None


@pytest.mark.parametrize(
    "name", [name for name in FILES if name.startswith(("notebooks", "book/p"))]
)
def test_a_file_that_is_edited_while_the_book_is_made_is_not_in_it(root, name):
    (root / unchanged.RECORD).unlink()
    begun = unchanged.written()
    (root / "book" / "executed" / "a.ipynb").write_text("made anew")
    (root / name).write_text("edited")
    unchanged.remember([root / "build" / "html"], begun)
    assert unchanged.is_unchanged() is None


def test_a_page_that_nobody_made_is_noticed(root):
    (root / "build" / "html" / "spare.html").write_text("new")
    assert unchanged.is_unchanged() is None


def test_an_edited_library_is_noticed(root, monkeypatch):
    (root / "a.py").write_text("n = 1")
    monkeypatch.setattr(unchanged, "library_files", lambda: [root / "a.py"])
    assert unchanged.is_unchanged() is None


@pytest.mark.parametrize(
    "record", ["", "{", "[]", "null", "[" * 9000, '{"made": []}', '{"made": ["build/html"]}']
)
def test_a_record_that_is_none_is_not_believed(root, record):
    (root / unchanged.RECORD).write_text(record)
    assert unchanged.is_unchanged() is None


def test_a_copy_is_unchanged(root, tmp_path_factory, monkeypatch):
    there = tmp_path_factory.mktemp("copies") / "copy"
    shutil.copytree(root, there)
    monkeypatch.setattr(unchanged, "project_root", lambda: there)
    assert unchanged.is_unchanged() == there / "build" / "html" / "index.html"
