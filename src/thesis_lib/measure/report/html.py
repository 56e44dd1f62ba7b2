"""Pieces of the report's page."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

import pandas as pd

from thesis_lib.measure.feasibility.remedies import reason_of, remedy_of
from thesis_lib.measure.report.meanings import MEANINGS, Note


def frame(data: pd.DataFrame) -> str:
    """A table."""
    rows = data.to_html(index=False, border=0, na_rep="—")
    return f'<div class="scroll" tabindex="0">{rows}</div>'


def items(lines: Iterable[str]) -> str:
    """Lines as a list."""
    found = "".join(f"<li>{escape(line)}</li>" for line in lines if line)
    return f"<ul>{found}</ul>" if found else "<p>None.</p>"


def warned(notes: Sequence[Note]) -> str:
    """Notes, each with its meaning folded beside it; nothing of none."""
    if not notes:
        return ""
    told = "".join(f"<li>{escape(note.text)}{_meaning(note.code)}</li>" for note in notes)
    return f"<aside><p><strong>Note</strong></p><ul>{told}</ul></aside>"


def _meaning(code: str) -> str:
    """What a note means and what to do, folded."""
    meaning = MEANINGS[code]
    words = f"<p>{_coded(meaning.means)}</p><p><em>What to do.</em> {_coded(meaning.do)}</p>"
    return details(f"What this means, and what to do: {code}", words)


def remedy(code: str) -> str:
    """Why a warning before measuring has its limit, and what to do, folded."""
    words = f"<p>{_coded(reason_of(code))}</p><p><em>What to do.</em> {_coded(remedy_of(code))}</p>"
    return details(f"What this means, and what to do: {code}", words)


def _coded(text: str) -> str:
    """Words, in which names of fields stand between backticks."""
    return re.sub(r"`(.*?)`", r"<code>\1</code>", escape(text))


def details(title: str, inner: str) -> str:
    """What is folded out by its title."""
    return f"<details><summary>{escape(title)}</summary>{inner}</details>"


def write_pictures(folder: Path, pictures: Mapping[str, tuple[str, bytes]]) -> None:
    """Write the pictures of a report into a folder's ``figures``."""
    (folder / "figures").mkdir(exist_ok=True)
    for name, (kind, content) in pictures.items():
        (folder / "figures" / f"{name}.{kind}").write_bytes(content)


def figure(pictures: Mapping[str, tuple[str, bytes]], name: str, caption: str) -> str:
    """A picture with its caption."""
    kind, content = pictures[name]
    mime = "image/svg+xml" if kind == "svg" else "image/png"
    source = f"data:{mime};base64,{base64.b64encode(content).decode()}"
    text = escape(caption, quote=True)
    return f'<figure><img src="{source}" alt="{text}"><figcaption>{text}</figcaption></figure>'
