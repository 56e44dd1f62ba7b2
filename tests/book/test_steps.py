"""The steps of ``dodo.py`` make all that pages include."""

import re
import runpy
from pathlib import Path

import pytest

from thesis_lib.files import project_root

pytest.importorskip("doit", reason="the book needs doit")
INCLUDED = re.compile(r"executed/([\w.-]+\.(?:md|svg|webp|html|ipynb))")


def tasks():
    found = runpy.run_path(str(project_root() / "dodo.py"))
    for name, make in found.items():
        if name.startswith("task_"):
            made = make()
            yield from [made] if isinstance(made, dict) else made


def test_all_that_pages_include_is_made_by_a_step():
    root = project_root()
    made = {Path(target).name for task in tasks() for target in task["targets"]}
    made |= {f"{Path(name).stem}.html" for name in made if name.endswith(".ipynb")}
    pages = (root / "book").glob("*.md")
    included = {name for page in pages for name in INCLUDED.findall(page.read_text("utf-8"))}
    assert len(included) > 50
    assert included - made == set()


def test_steps_depend_on_files_that_are_there_or_made():
    every = list(tasks())
    made = {str(target) for task in every for target in task["targets"]}
    needed = {str(path) for task in every for path in task.get("file_dep", ())}
    assert {path for path in needed - made if not Path(path).is_file()} == set()
