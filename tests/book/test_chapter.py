"""The book of one chapter: its pages and no others, no dead link, and what it leaves alone."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

pytest.importorskip("jupyter_book", reason="the book needs jupyter-book")

from conftest import PROJECT
from thesis_lib.book import build, chapter, missing, site
from thesis_lib.book.plan import Plan, planned
from thesis_lib.figure_sets.registry import CHAPTERS, STUDIES
from thesis_lib.runs import execute as runs

OWN = ("numbers", "pages", "sketches")
_LINK = re.compile(r'(?:href|src)="([^":?#]*)(?:\?[^"#]*)?(?:#([^"]*))?"')


def test_pages_of_a_chapter_are_those_of_the_contents():
    names = [path.name for path in chapter.pages(PROJECT, "ch3")]
    assert sorted(names) == ["beam.md", "conventions.md", "references.md"]
    names = [path.name for path in chapter.pages(PROJECT, "lab")]
    assert {"layouts.md", "motions.md"} <= set(names)
    for one in CHAPTERS:
        assert all(path.is_file() for path in chapter.pages(PROJECT, one))


@pytest.mark.parametrize("name", CHAPTERS)
def test_every_set_of_a_chapter_has_its_page_there(name):
    pages = {page for entry in chapter._contents(PROJECT, name) for page in chapter._in(entry)}
    executed = {page.partition("/")[2] for page in pages if page.startswith("executed/")}
    assert executed == set(CHAPTERS[name])


def test_a_chapter_has_a_place_of_its_own_and_shares_what_was_run():
    plan, whole = planned("ch3"), Plan(PROJECT, [])
    assert plan.index == PROJECT / "build" / "ch3" / "html" / "index.html"
    assert plan.executed == PROJECT / "build" / "ch3" / "executed"
    assert plan.archives == []
    steps = {one.name: one for one in build._tasks(plan)}
    of_cubes = [f"figures and numbers of {one}" for one in (*CHAPTERS["ch3"], "facts")]
    assert sorted(steps) == sorted(
        [*CHAPTERS["ch3"], "MathJax and MiniSearch", *(f"ch3 {one}" for one in (*OWN, *of_cubes))]
    )
    numbers = [path.name for path in steps["ch3 numbers"].makes]
    assert sorted(numbers) == [
        f"beam-{one}.md" for one in ("cameras", "model", "result", "results")
    ]
    for name, step in steps.items():
        assert step.seconds > 0
        if name.startswith("ch3"):
            ours = PROJECT / "build" / "ch3"
            assert all(ours in path.parents for path in step.makes)
            assert step.record.name == f"{name.replace(' ', '-')}.json"
        elif name in STUDIES:
            assert steps[name].makes[0] == whole.executed / f"{name}.ipynb"


@pytest.mark.book
@pytest.mark.parametrize("name", CHAPTERS)
def test_a_chapter_renders_alone_without_a_warning_or_a_dead_link(tmp_path, name):
    if not (PROJECT / "build" / "assets").is_dir():
        pytest.skip("no build/assets: render the book first")
    pieces, work, stubs = (tmp_path / folder for folder in ("pieces", "work", "stubs"))
    for folder in (work, stubs):
        folder.mkdir()
    text = "".join(page.read_text(encoding="utf-8") for page in chapter.pages(PROJECT, name))
    for piece in re.findall(r"executed/([\w-]+\.(?:md|svg|png|webp))", text):
        missing.write_placeholder(pieces / piece, "a step")
    for one in CHAPTERS[name]:
        missing.write_page(runs.source(one), one, "not run", stubs / f"{one}.ipynb")
    chapter.lay_out(PROJECT, name, pieces, stubs.glob("*.ipynb"), work)
    contents = yaml.safe_load((work / "book" / "_toc.yml").read_text(encoding="utf-8"))
    assert contents["root"] == "index"
    html = site.render(work, tmp_path / "html").parent
    assert (html / "index.html").is_file()
    assert {page.stem for page in html.glob("executed/*.html")} == set(CHAPTERS[name])
    assert not (html / "intro.html").exists()
    assert "in another chapter of the book" in "".join(
        page.read_text(encoding="utf-8") for page in html.rglob("*.html")
    )
    pages = [*html.glob("*.html"), *html.glob("executed/*.html")]
    assert [link for page in pages for link in dead(page)] == []


def dead(page: Path) -> list[str]:
    """Local links of a page that lead nowhere, those to downloads apart."""
    found = []
    for link in _LINK.finditer(page.read_text(encoding="utf-8")):
        place = (page.parent / link[1]).resolve() if link[1] else page
        there = place.is_file()
        if not there or (link[2] and f'id="{link[2]}"' not in place.read_text(encoding="utf-8")):
            found.append(f"{page.name}: {link[0]}")
    return found
