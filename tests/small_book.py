"""A book of two figure sets, in a copy of the project that tests may damage."""

import shutil

import pytest
import yaml

GOOD, BAD = "beam-resolution", "beam-distance"
STEPS = f"""
import runpy
from pathlib import Path

from thesis_lib.book.build import EXECUTED_FOLDER, list_cubes, make_task, result_files
from thesis_lib.book.pieces import write
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES

for name in STUDIES.keys() - {{"{GOOD}", "{BAD}"}}:
    del STUDIES[name], FIGURE_SETS[name]
whole = runpy.run_path(str(Path(__file__).with_name("whole.py")))
DOIT_CONFIG = {{**whole["DOIT_CONFIG"], "default_tasks": ["notebook"]}}
task_notebook, task_figures = whole["task_notebook"], whole["task_figures"]
"""
PAGES = """
DOIT_CONFIG["default_tasks"] = ["notebook", "assets", "piece", "figures", "pages"]
task_assets = whole["task_assets"]


def task_pages():
    return whole["task_pages"]([task_figures, task_piece])


def task_inputs():
    yield {"name": "none", "actions": None}


task_text = task_inputs


def task_piece():
    def act():
        write.write_pieces(list_cubes(), EXECUTED_FOLDER, ["beam-results"])

    needs = [result_files(name)[0] for name in STUDIES]
    yield make_task("numbers", act, needs, [EXECUTED_FOLDER / "beam-results.md"])
"""
INTRO = """# A small book

(law-of-rounding)=
## Law

See [its figure](fig-3-4), {numref}`fig-3-4` and [the other page](executed/beam-resolution.ipynb).

```{include} executed/beam-results.md
```
"""


def shrink(checkout, pages=False):
    """Leave the book of a checkout two figure sets, and the steps of pages or not."""
    (checkout.root / "dodo.py").rename(checkout.root / "whole.py")
    text = STEPS + PAGES if pages else STEPS
    (checkout.root / "dodo.py").write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A checkout whose book has two pages of results and is not made yet."""
    from conftest import PROJECT, Checkout

    assets = PROJECT / "build" / "assets"
    if not assets.is_dir():
        pytest.skip("no build/assets: render the book first")
    checkout = Checkout(tmp_path_factory.mktemp("small") / "project")
    root = checkout.root
    shrink(checkout, pages=True)
    for name in ("_config.yml", "CITATION.cff", "package.json", "package-lock.json"):
        shutil.copy(PROJECT / name, root)
    shutil.copytree(assets, root / "build" / "assets")
    shutil.copytree(PROJECT / "book" / "assets", root / "book" / "assets")
    for name in ("conf.py", "references.bib"):
        shutil.copy(PROJECT / "book" / name, root / "book")
    (root / "book" / "intro.md").write_text(INTRO, encoding="utf-8")
    (root / "book" / "misses.md").write_text("# Misses\n", encoding="utf-8")  # results link to it
    chapters = [{"file": file} for file in (f"executed/{BAD}", f"executed/{GOOD}", "misses")]
    toc = {"format": "jb-book", "root": "intro", "chapters": chapters}
    (root / "book" / "_toc.yml").write_text(yaml.safe_dump(toc), encoding="utf-8")
    return checkout


def make(checkout):
    return checkout.thesis("book", cwd=checkout.root, timeout=900)
