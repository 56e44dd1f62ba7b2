"""What is changed in a notebook after its execution, before it becomes a page."""

from __future__ import annotations

import re
from typing import Any


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


def disown_captions(notebook: Any) -> None:
    """Say under each figure that it is the thesis's only in kind."""
    for cell in notebook.cells:
        caption = cell.metadata.get("mystnb", {}).get("figure", {})
        if "caption" in caption:
            caption["caption"] = "With the parameters of this run, after: " + caption["caption"]
