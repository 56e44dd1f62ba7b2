"""Every figure of the book, drawn from cubes: their bytes by name."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import xarray as xr

from thesis_lib import conclusions_figure, cubes, notebook
from thesis_lib.files import project_root

_DRAWS = re.compile(r"[\w.]*(?:figure|figures|picture|aliases)\(result\b.*\)", re.DOTALL)


def of_cube(cube: xr.Dataset) -> Iterator[tuple[str, bytes]]:
    """The figures that the notebook of a cube's figure set shows."""
    name = str(cube.attrs["figure_set"])
    text = (project_root() / "notebooks" / f"{name}.ipynb").read_text(encoding="utf-8")
    cells = ["".join(c["source"]) for c in json.loads(text)["cells"] if c["cell_type"] == "code"]
    shown: list[Any] = []
    kept, notebook.display = notebook.display, shown.append
    try:
        space: dict[str, Any] = {"result": cube}
        setup = next(source for source in cells if "result = " in source)
        exec("\n".join(line for line in setup.splitlines() if "import" in line), space)
        for source in cells:
            if _DRAWS.fullmatch(source.strip()):
                made = eval(source.strip(), space)
                shown += [made] if made is not None else []
    finally:
        notebook.display = kept
    pictures = [text.data for text in shown if "svg" in str(text.data)]
    for number, picture in enumerate(pictures):
        yield f"{name}-{number}", str(picture).encode()


def of_conclusions(results: Path) -> bytes:
    """The figure of the conclusions, from the cubes of a folder."""
    opened = {path.stem: cubes.read(path) for path in sorted(results.glob("*.nc"))}
    return str(conclusions_figure.svg(conclusions_figure.draw(opened))).encode()
