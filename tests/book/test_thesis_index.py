"""The index of the thesis has every item once, and all that it points to is there."""

import ast
import pkgutil
import re
from functools import cache

import nbformat
import pytest
import xarray as xr
import yaml

from thesis_lib import files
from thesis_lib.facts import claims
from thesis_lib.figure_sets.display import list_captions
from thesis_lib.figure_sets.registry import STUDIES

ROOT = files.project_root()
BOOK = ROOT / "book"
ENTRIES = claims.read_index()
# How many of each the thesis has, counted in its text. Equation 3.20 is in two parts.
FIGURES = {"1": 8, "2": 7, "3": 39, "4": 37, "5": 4, "6": 40,
           "A": 2, "B": 2, "C": 1, "D": 5, "E": 1, "F": 7}  # fmt: skip
TABLES = {"1": 1, "2": 1, "3": 4, "4": 4, "5": 2, "6": 2}
EQUATIONS = {"2": 20, "3": 23, "4": 9, "5": 2, "6": 8, "A": 1, "B": 1, "C": 1, "D": 1, "E": 1}
RESULTS = [("3", 4, 39), ("4", 2, 37), ("5", 3, 4), ("6", 5, 40)]  # figures of results


def numbered(kind, counts):
    return {f"{kind} {c}.{n}" for c, most in counts.items() for n in range(1, most + 1)}


EXPECTED = numbered("figure", FIGURES) | numbered("table", TABLES) | numbered("equation", EQUATIONS)
EXPECTED = EXPECTED - {"equation 3.20"} | {"equation 3.20a", "equation 3.20b"}


# Complete, and nothing twice.


def test_every_item_of_the_thesis_is_there_once():
    assert sorted(entry.item for entry in ENTRIES) == sorted(EXPECTED)


def test_an_item_has_something_here_or_a_reason():
    for one in ENTRIES:
        something = [one.page, *one.function, *one.cube, *one.test]
        assert bool(one.reason) != any(something), one.item
        assert one.what, one.item


def test_every_figure_of_results_has_page_cube_and_test():
    by_item = {entry.item: entry for entry in ENTRIES}
    found = [by_item[f"figure {c}.{n}"] for c, a, b in RESULTS for n in range(a, b + 1)]
    for one in found:
        anchor = "fig-" + one.item.removeprefix("figure ").replace(".", "-")
        document, _, given = one.page.partition("#")
        name = document.removeprefix("executed/")
        assert given == anchor
        assert one.function
        assert all(cube.startswith(f"{name}: ") for cube in one.cube)
        assert one.cube
        assert one.test


# Everything that it points to is there.


@cache
def documents():
    """Names of the pages in the table of contents."""
    found = set()
    todo = [yaml.safe_load((BOOK / "_toc.yml").read_text(encoding="utf-8"))]
    while todo:
        node = todo.pop()
        found |= {node[key] for key in ("root", "file") if key in node}
        todo += [child for key in ("parts", "chapters", "sections") for child in node.get(key, [])]
    return found


@cache
def anchors(document):
    """Labels, equations, figures and headings of a page."""
    if document.startswith("executed/"):
        name = document.removeprefix("executed/")
        cells = nbformat.read(ROOT / "notebooks" / f"{name}.ipynb", as_version=4).cells
        return {one.name for cell in cells for one in list_captions(STUDIES[name](), cell.source)}
    text = (BOOK / f"{document}.md").read_text(encoding="utf-8")
    named = re.findall(r"^(?:\((.+)\)=|:name: (.+)|\$\$ \((.+)\))$", text, re.MULTILINE)
    headings = re.findall(r"^#{1,3} (.+)$", text, re.MULTILINE)
    slugs = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    return {name for names in named for name in names if name} | slugs


@pytest.mark.parametrize("page", sorted({entry.page for entry in ENTRIES if entry.page}))
def test_pages_and_anchors_exist(page):
    document, _, anchor = page.partition("#")
    assert document in documents()
    assert not anchor or anchor in anchors(document)


@pytest.mark.skipif(not (BOOK / "errata.md").exists(), reason="the book has no errata")
def test_errata_exist():
    given = {anchor.removeprefix("errata#") for entry in ENTRIES for anchor in entry.errata}
    assert given <= anchors("errata")


@pytest.mark.parametrize("name", sorted({name for e in ENTRIES for name in e.function}))
def test_functions_can_be_imported(name):
    assert not any(part.startswith("_") for part in name.split("."))
    assert pkgutil.resolve_name(name).__doc__


@pytest.mark.book
@pytest.mark.parametrize("cube", sorted({cube for entry in ENTRIES for cube in entry.cube}))
def test_cubes_have_the_variables(cube):
    name, variables = cube.split(": ")
    with xr.open_dataset(ROOT / "data" / "results" / f"{name}.nc") as made:
        assert set(variables.split(", ")) <= set(made.data_vars)


@cache
def names_in(file):
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("test", sorted({test for entry in ENTRIES for test in entry.test}))
def test_tests_exist(test):
    file, name = test.split("::")
    assert name in names_in(file)
