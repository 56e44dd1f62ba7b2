"""Pieces of the report's page."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape

import pandas as pd


def frame(data: pd.DataFrame) -> str:
    """A table."""
    return f'<div class="scroll">{data.to_html(index=False, border=0, na_rep="—")}</div>'


def items(lines: Iterable[str]) -> str:
    """Lines as a list."""
    found = "".join(f"<li>{escape(line)}</li>" for line in lines if line)
    return f"<ul>{found}</ul>" if found else "<p>None.</p>"


def warned(lines: Sequence[str]) -> str:
    """Lines in a note; nothing of none."""
    return f"<aside><p><strong>Note</strong></p>{items(lines)}</aside>" if lines else ""


def details(title: str, inner: str) -> str:
    """What is folded out by its title."""
    return f"<details><summary>{escape(title)}</summary>{inner}</details>"


def figure(pictures: Mapping[str, tuple[str, bytes]], name: str, caption: str) -> str:
    """A picture with its caption."""
    kind, content = pictures[name]
    mime = "image/svg+xml" if kind == "svg" else "image/png"
    source = f"data:{mime};base64,{base64.b64encode(content).decode()}"
    text = escape(caption, quote=True)
    return f'<figure><img src="{source}" alt="{text}"><figcaption>{text}</figcaption></figure>'
