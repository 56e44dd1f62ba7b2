"""What is changed in a notebook after its execution, before it becomes a page."""

from __future__ import annotations

import re
from typing import Any

from thesis_lib.web.markdown import escape


def hide_staging(notebook: Any, name: str) -> None:
    """Leave the reader's parameters in the notebook, not where we let it write."""
    recorded = notebook.metadata["papermill"]
    recorded.update(input_path=f"notebooks/{name}.ipynb", output_path=f"{name}.ipynb")
    recorded["parameters"].pop("cube")
    for cell in notebook.cells:
        if "injected-parameters" in cell.metadata.get("tags", []):
            lines = [line for line in cell.source.splitlines() if not line.startswith("cube = ")]
            cell.source = "\n".join(lines)
    notebook.cells = [cell for cell in notebook.cells if cell.source != "# Parameters"]


def cut_links(notebook: Any) -> None:
    """Let the ledger's rows lead nowhere: their pages are the book's, not beside this one."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "text/html" in data:
                data["text/html"] = re.sub(r'"href":"[^"]*"', '"href":""', data["text/html"])


def place_figures(notebook: Any) -> None:
    """Give each figure that cells have shown a cell of its own, with its caption and its words."""
    cells = []
    for cell in notebook.cells:
        cells.append(cell)
        shown = [output for output in cell.get("outputs", []) if _about(output)]
        more = [figure_cell(f"{cell.id}-{n}") for n in range(2, len(shown) + 1)]
        for place, output in zip([cell, *more], shown, strict=False):
            del output.data["text/html"]  # for front ends
            place.outputs = [one for one in place.outputs if one not in shown] + [output]
            place.metadata["mystnb"] = mystnb(**_about(output))
        cells += more
    notebook.cells = cells


def figure_cell(name: str, **metadata: Any) -> Any:
    """A cell for a figure that another cell has shown; a book leaves cells out that are empty."""
    import nbformat

    cell = nbformat.v4.new_code_cell("# shown above", id=name)
    cell.metadata.update(tags=["remove-input"], **metadata)
    return cell


def mystnb(name: str, caption: str, alt: str, **_: Any) -> dict[str, Any]:
    """What makes a figure of a cell's picture in a page."""
    words = {"figure": {"name": name, "caption": escape(caption)}} if caption else {}
    return {**words, "image": {"alt": alt}}


def _about(output: Any) -> dict[str, Any]:
    """What the output of a cell tells of the figure that it is; nothing if it is none."""
    about = output.get("metadata", {}).get("image/svg+xml", {})
    return dict(about) if {"name", "caption", "alt"} <= set(about) else {}
