"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence


def format_rows(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; its cells stand as they are."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def format_columns(rows: Iterable[Mapping[str, str]]) -> str:
    """Return a Markdown table of rows by column, — where one is missing; empty without rows."""
    rows = list(rows)
    header = list(dict.fromkeys(name for row in rows for name in row))
    return (
        format_rows(header, [[row.get(name, "—") for name in header] for row in rows])
        if rows
        else ""
    )


def escape_markdown(text: str) -> str:
    """Escape a reader's words, so that nothing in them is Markdown."""
    return "".join(f"&#{ord(c)};" if c in "&<>|*_`[]{}\\$#!~" else c for c in text)
