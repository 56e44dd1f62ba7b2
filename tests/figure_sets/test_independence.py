"""Figure sets do not know each other; `parametric` alone may be varied by others."""

import grimp

from thesis_lib.figure_sets.registry import FIGURE_SETS

ROOM = "thesis_lib.figure_sets"


def test_no_figure_set_imports_another():
    families = {one.module.split(".")[2] for one in FIGURE_SETS.values()}
    graph = grimp.build_graph("thesis_lib")
    crossing = [
        (importer, imported)
        for family in families
        for importer in graph.find_descendants(f"{ROOM}.{family}")
        for imported in graph.find_modules_directly_imported_by(importer)
        if imported.startswith(f"{ROOM}.")
        and (other := imported.split(".")[2]) in families - {family}
        and other != "parametric"
    ]
    assert len(families) > 8
    assert crossing == []
