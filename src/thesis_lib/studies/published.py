"""The published run: the errors of every figure set as CSV, written and read, and checked."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from thesis_lib import text
from thesis_lib.files import shipped, whole_file
from thesis_lib.studies import cubes
from thesis_lib.studies.storage import CubeError
from thesis_lib.text import has_hidden, one_line

Columns = Mapping[str, Callable[[str], Any]]


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
    table = pd.DataFrame(read_table(path, LIST_COLUMNS.get(_first_column(path), ERROR_COLUMNS)))
    key = next(list(keys) for keys in PUBLISHED_KEYS if set(keys) <= set(table.columns))
    if (twice := table.duplicated(key)).any():
        raise damage_refusal(path, int(twice.idxmax()) + 2, "is there twice")
    return table


def _first_column(path: Path) -> str:
    with path.open("rb") as stream:
        return stream.readline(99).decode(errors="replace").split(",")[0]


def read_table(path: Path, columns: Columns) -> dict[str, list[Any]]:
    """Return the columns of a published CSV file, by name.

    Raises
    ------
    CubeError
        In one line: the file, the line, what is wrong with it, and what restores it.
    """
    found: dict[str, list[Any]] = {name: [] for name in columns}
    number = 0  # of the last line that could be read
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = csv.reader(stream, strict=True)
            header, number = next(rows, []), 1
            if sorted(header) != sorted(columns):
                raise damage_refusal(path, 1, f"names other columns than {', '.join(columns)}")
            for number, row in enumerate(rows, 2):
                if len(row) != len(header):
                    raise damage_refusal(path, number, f"has {len(row)} values, not {len(header)}")
                for name, given in zip(header, row, strict=True):
                    try:
                        found[name].append(columns[name](given))
                    except ValueError:
                        raise damage_refusal(
                            path, number, f"has {name} = {one_line(repr(given))}"
                        ) from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise damage_refusal(path, number + 1, f"cannot be read ({type(error).__name__})") from None
    return found


def damage_refusal(path: Path, line: int, problem: str) -> CubeError:
    """Return the refusal of a published file."""
    return CubeError(text.damaged(path, line, problem))
