"""The published run: the errors of every figure set as CSV, written and read, and checked."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import xarray as xr

from thesis_lib.files import shipped, whole_file
from thesis_lib.studies import cubes
from thesis_lib.studies.storage import CubeError
from thesis_lib.text import Columns, damaged, has_hidden, read_table


def _text(given: str) -> str:
    if has_hidden(given):
        raise ValueError
    return given


def _count(given: str) -> int:
    return int(given) if given.isascii() and given.isdigit() else int("no number")


ERROR_COLUMNS: Columns = {
    **dict.fromkeys(("case", "pair_order", "label", "error"), _text),
    "mode": _count,
    **dict.fromkeys(("value", *cubes.STATISTIC_NAMES), float),
}
LIST_COLUMNS: dict[str, Columns] = {  # by what a list is of
    name: dict.fromkeys(columns, _text) | ({"value": float} if "value" in columns else {})
    for name, columns in cubes.LISTED_VARIABLES.items()
}
PUBLISHED_KEYS = (*cubes.ROW_KEYS, "error"), ("quantity",), ("claim",)


def summary_path(name: str) -> Path:
    """Return the path of a figure set's published figures."""
    return shipped() / "data" / "published" / f"{name}.csv"


def publish_errors(cube: xr.Dataset) -> Path:
    """Make this cube's errors the published ones; returns the file."""
    path = summary_path(cube.attrs["figure_set"])
    table = cubes.summarise_errors(cube)
    whole_file(
        path, lambda part: table.to_csv(part, index=False, float_format="%.6g", na_rep="nan")
    )
    return path


def read_published(name: str) -> pd.DataFrame | None:
    """Return the published summary of a figure set, if there is one.

    Raises
    ------
    CubeError
        In one line: the file, the line, what is wrong with it, and what restores it.
    """
    path = summary_path(name)
    if not path.is_file():
        return None
    table = pd.DataFrame(
        read_table(path, LIST_COLUMNS.get(_first_column(path), ERROR_COLUMNS), CubeError)
    )
    key = next(list(keys) for keys in PUBLISHED_KEYS if set(keys) <= set(table.columns))
    if (twice := table.duplicated(key)).any():
        raise CubeError(damaged(path, int(twice.idxmax()) + 2, "is there twice"))
    return table


def _first_column(path: Path) -> str:
    with path.open("rb") as stream:
        return stream.readline(99).decode(errors="replace").split(",")[0]
