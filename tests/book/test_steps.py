"""The steps of ``dodo.py`` make all that pages include."""

import re
import runpy
from pathlib import Path

import pytest

from thesis_lib.book import find_figure_names
from thesis_lib.book.pieces.manifest import SAMPLE_PAGE
from thesis_lib.files import project_root

pytest.importorskip("doit", reason="the book needs doit")
INCLUDED = re.compile(r"executed/([\w.-]+\.(?:md|svg|webp|html|ipynb))")


def tasks():
    found = runpy.run_path(str(project_root() / "dodo.py"))
    for name, make in found.items():
        if name.startswith("task_"):
            made = make()
            yield from [made] if isinstance(made, dict) else made


def test_steps_make_what_pages_include():
    pages = sorted((project_root() / "book").glob("*.md"))
    found = [name for page in pages for name in INCLUDED.findall(page.read_text("utf-8"))]
    included = {*found, *(f"{name}.svg" for name in find_figure_names(pages))}
    made = {Path(target).name for task in tasks() for target in task["targets"]}
    notebooks = {f"{Path(name).stem}.html" for name in made if name.endswith(".ipynb")}
    assert included - made - notebooks == set()
    kinds = (".md", ".svg", ".webp", ".html")
    alone = {name for name in made if name.endswith(kinds)} - included
    assert alone == {"index.html", SAMPLE_PAGE}


def test_pages_are_rendered_again_when_anything_that_they_include_is():
    every = list(tasks())
    (pages,) = (task for task in every if "name" not in task)
    made = {target for task in every for target in task["targets"] if task is not pages}
    included = {str(path) for path in made if Path(path).parent.name == "executed"}
    assert included
    assert included - set(map(str, pages["file_dep"])) == set()


def test_steps_depend_on_files_that_are_there_or_made():
    every = list(tasks())
    made = {str(target) for task in every for target in task["targets"]}
    needed = {str(path) for task in every for path in task.get("file_dep", ())}
    assert {path for path in needed - made if not Path(path).is_file()} == set()
