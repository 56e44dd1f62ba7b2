"""Figure sets do not know each other; `parametric` alone may be varied by others."""

from itertools import permutations

import grimp

from thesis_lib.figure_sets.registry import FIGURE_SETS


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
