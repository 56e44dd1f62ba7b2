"""A book of two figure sets, in a copy of the project that tests may damage."""

from __future__ import annotations

import shutil

import pytest
import yaml

GOOD, BAD = "beam-resolution", "beam-distance"
MAKE = f"""
import sys
from thesis_lib.book import build as p, plan
from thesis_lib.book.pieces import write as prose
from thesis_lib.runs import tasks

plan.STUDIES = {{name: plan.STUDIES[name] for name in ("{GOOD}", "{BAD}")}}
prose.PIECES = {{"beam-results": prose.PIECES["beam-results"]}}
p.walk.PICTURES = p.walk.VALUES = {{}}
p.sample.NAMES = ()
p.demos.PAGES = p.reference.PIECES = p.thesis_index.PIECES = p.assumptions.PIECES = {{}}
try:
    print(p.build())
except tasks.RunError as error:
    sys.exit(str(error))
"""
INTRO = """# A small book

(law-of-rounding)=
## Law

See [its figure](fig-3-4), {numref}`fig-3-4` and [the other page](executed/beam-resolution.ipynb).

```{include} executed/beam-results.md
```
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A checkout whose book has two pages of results and is not made yet."""
    from conftest import PROJECT, Checkout

    assets = PROJECT / "build" / "assets"
    if not assets.is_dir():
        pytest.skip("no build/assets: render the book first")
    checkout = Checkout(tmp_path_factory.mktemp("small") / "project")
    root = checkout.root
    for name in ("_config.yml", "package.json", "package-lock.json"):
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
    return checkout.python("-c", MAKE, cwd=checkout.root, timeout=900)
