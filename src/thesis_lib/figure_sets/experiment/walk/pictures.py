"""The pictures of the page that walks through chapter 5, from the measured recordings."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure
from PIL import Image

from thesis_lib import files
from thesis_lib.figure_sets.experiment.walk import photographs, signals, sketches
from thesis_lib.plotting.style import saved

PIXELS = 1500  # width of pictures that hold photographs
QUALITY = 85  # of 100, at which they are kept

PICTURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "rig": sketches.rig,
    "views": photographs.views,
    "board": photographs.board,
    "coverage": sketches.coverage,
    "sound": signals.sound,
    "outline": photographs.outline,
    "plane": photographs.plane,
    "centres": photographs.centres,
    "widths": photographs.widths,
    "tracks": signals.tracks,
}


def file_name(name: str) -> str:
    """Name of a picture's file: WebP if it holds photographs, SVG otherwise."""
    kind = "webp" if PICTURES[name].__module__ == photographs.__name__ else "svg"
    return f"lab-{name}.{kind}"


def write(data: xr.Dataset, folder: Path) -> list[Path]:
    """Write all pictures of the measured recordings; the same dataset gives the same bytes."""
    paths = []
    for name, draw in PICTURES.items():
        path = folder / file_name(name)
        content = _webp(draw(data)) if path.suffix == ".webp" else saved(draw(data), "svg")
        files.whole_file(path, partial(Path.write_bytes, data=content))
        paths.append(path)
    return paths


def _webp(figure: Figure) -> bytes:
    """As WebP: as it is where that takes fewer bytes, else as near as eyes can tell."""
    file = io.BytesIO(saved(figure, "png", dpi=PIXELS / figure.get_figwidth()))
    picture, files = Image.open(file).convert("RGB"), (io.BytesIO(), io.BytesIO())
    for file, lossless in zip(files, (True, False), strict=True):
        picture.save(file, format="webp", lossless=lossless, quality=QUALITY, method=6)
    return min((file.getvalue() for file in files), key=len)
