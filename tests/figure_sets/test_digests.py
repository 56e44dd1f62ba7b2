"""Digests of code: the folders that a figure set names hold all that computes it.

Figure sets do not know each other; `parametric` alone may be varied by others.
"""

import json
import subprocess
import sys
from itertools import permutations

import grimp
import pytest

from thesis_lib.figure_sets.cube_file import PACKAGE_FOLDER, source_files
from thesis_lib.figure_sets.registry import FIGURE_SETS

PRODUCTS = {one.module: one for one in FIGURE_SETS.values()}
LOADED = """
import importlib, json, sys
import thesis_lib.figure_sets.registry

known = set(sys.modules)  # all requests, which a cube carries itself
for name in sys.argv[1:]:
    importlib.import_module(name)
print(json.dumps([module.__file__ for name, module in sys.modules.items()
                  if name.startswith("thesis_lib.") and name not in known]))
"""
INFRASTRUCTURE = {"web"}  # which shows results and changes none


@pytest.mark.slow
@pytest.mark.few(2)
@pytest.mark.parametrize("module", sorted(PRODUCTS))
def test_what_computes_a_cube_is_in_the_folders_that_count(module):
    product = PRODUCTS[module]
    done = subprocess.run(
        [sys.executable, "-c", LOADED, module], capture_output=True, text=True, check=True
    )
    counted = {str(path) for path in source_files(product)}
    places = [PACKAGE_FOLDER / place for place in json.loads(done.stdout)]
    inside = [place.relative_to(PACKAGE_FOLDER).parts for place in places]
    missed = [
        parts for place, parts in zip(places, inside, strict=True)
        if str(place) not in counted and len(parts) > 1 and parts[0] not in INFRASTRUCTURE
        and not (parts[0] == "figure_sets" and len(parts) == 2)
    ]  # fmt: skip
    assert missed == []
    assert any(parts[0] == "figure_sets" for parts in inside)


def test_no_figure_set_imports_another():
    families = {one.module.rpartition(".")[0] for one in FIGURE_SETS.values()}
    graph = grimp.build_graph("thesis_lib")
    chains = [
        graph.find_shortest_chain(importer, imported, as_packages=True)
        for importer, imported in permutations(sorted(families), 2)
        if not imported.endswith(".parametric")
    ]
    assert len(families) > 8
    assert [chain for chain in chains if chain] == []
