"""Tables as CSV, which spreadsheets open: no text in them is a formula."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

FORMULA_STARTS = (
    "=",
    "+",
    "-",
    "@",
    "\t",
    "\r",
)  # what a cell begins with that a spreadsheet computes


def quote_formula(value: Any) -> Any:
    """Return a value as it stands in a cell: a text that is a formula after an apostrophe.

    Examples
    --------
    >>> quote_formula("=1+1"), quote_formula("A"), quote_formula(-1.0)
    ("'=1+1", 'A', -1.0)
    """
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA_STARTS) else value


def write_csv(table: pd.DataFrame, path: Path, float_format: str | None = None) -> None:
    """Write a table of numbers and texts."""
    table.map(quote_formula).to_csv(path, index=False, float_format=float_format)
