"""Every figure of the book, drawn from its cubes; ``python tests/drawings.py 10``: ten times."""

import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import matplotlib
import xarray as xr

from thesis_lib.book.pieces import factors as conclusions_figure
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.experiment import walk
from thesis_lib.figure_sets.experiment.compute import EXPERIMENT
from thesis_lib.figure_sets.experiment.figure_set import ExperimentResolution
from thesis_lib.files import project_root
from thesis_lib.notebook import show as notebook
from thesis_lib.plotting.style import figure_svg

_DRAWS = re.compile(r"[\w.]*(?:figures|picture)\(result\b.*\)", re.DOTALL)
_THREAD = threading.local()


def of_cube(cube: xr.Dataset) -> Iterator[tuple[str, bytes]]:
    """The figures that the notebook of a cube's figure set shows."""
    name = str(cube.attrs["figure_set"])
    text = (project_root() / "notebooks" / f"{name}.ipynb").read_text(encoding="utf-8")
    cells = ["".join(c["source"]) for c in json.loads(text)["cells"] if c["cell_type"] == "code"]
    shown: list[Any] = []
    _THREAD.shown = shown
    notebook.display = lambda one: _THREAD.shown.append(one)
    try:
        space: dict[str, Any] = {"result": cube}
        lines = [line for source in cells for line in source.splitlines()]
        exec("\n".join(line for line in lines if line.startswith(("import ", "from "))), space)
        for source in cells:
            if _DRAWS.fullmatch(source.strip()):
                made = eval(source.strip(), space)
                shown += [made] if made is not None else []
    finally:
        del _THREAD.shown
    for number, picture in enumerate(shown):
        yield f"{name}-{number}", picture.svg.encode()


def of_conclusions(results: Path) -> bytes:
    """The figure of the conclusions, from the cubes of a folder."""
    opened = {path.stem: cube_file.read_cube(path) for path in sorted(results.glob("*.nc"))}
    return str(figure_svg(conclusions_figure.draw_summary(opened))).encode()


def of_recordings(folder: Path) -> Iterator[tuple[str, bytes]]:
    """The pictures of the walk through chapter 5, from the measured recordings in the cache."""
    data = EXPERIMENT.load(ExperimentResolution().recordings)
    for path in walk.write_pictures(data, folder):
        yield path.name, path.read_bytes()


def all_of_them(results: Path) -> dict[str, str]:
    """SHA-256 of every figure of the book, by name, two drawn at a time as in a book."""
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as threads:
        jobs = [
            threads.submit(lambda path=path: dict(of_cube(cube_file.read_cube(path))))
            for path in sorted(results.glob("*.nc"))
        ]
        jobs.append(threads.submit(lambda: {"conclusions": of_conclusions(results)}))
        jobs.append(threads.submit(lambda: dict(of_recordings(Path(name)))))
        found = {key: content for job in jobs for key, content in job.result().items()}
    return {key: hashlib.sha256(content).hexdigest() for key, content in found.items()}


def main(times: int) -> None:
    """Draw all figures again and again, beside processes that keep all cores busy."""
    spin = [sys.executable, "-c", "while True: pass"]
    busy = [subprocess.Popen(spin) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        before = dict(matplotlib.rcParams)
        first = all_of_them(project_root() / "data" / "results")
        for turn in range(1, times):
            again = all_of_them(project_root() / "data" / "results")
            differ = sorted(key for key in first if again.get(key) != first[key])
            if differ or again.keys() != first.keys():
                sys.exit(f"drawing {turn + 1} differs in {', '.join(differ)}")
        if dict(matplotlib.rcParams) != before:
            sys.exit("drawing has changed Matplotlib's parameters")
    finally:
        for process in busy:
            process.kill()
    print(f"{len(first)} figures, {times} times the same bytes")


if __name__ == "__main__":
    main(int(sys.argv[1]))
