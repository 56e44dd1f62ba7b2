"""Tables and paragraphs from Jinja templates of Markdown, with shared filters.

A template is in the folder ``templates`` next to the module that renders it. Python computes the
values; the template holds the text, the headings and the rounding of each number.
"""

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from thesis_lib.studies.cubes import band_text, percent_text
from thesis_lib.web.html import build_environment, format_number


def escape_markdown(text: str) -> str:
    """Escape user text, so that no part of it is Markdown."""
    return "".join(f"&#{ord(c)};" if c in "&<>|*_`[]{}\\$#!~" else c for c in text)


TEMPLATE_FOLDER = "templates"
# Spaces and dashes at which lines do not break.
_UNBROKEN_CHARACTERS = str.maketrans(
    {" ": "\N{NO-BREAK SPACE}", "–": "\N{WORD JOINER}–\N{WORD JOINER}"}
)


def render(module_file: str | Path, name: str, /, **values: Any) -> str:
    """Render the template ``templates/NAME.md`` next to the module with the given ``__file__``.

    `name` may also be a whole file name, such as ``sketch.svg`` or ``cameras.yaml.j2``. An
    undefined value is an error.
    """
    file = name if Path(name).suffix in (".md", ".svg", ".html", ".json", ".j2") else f"{name}.md"
    folder = Path(module_file).parent / TEMPLATE_FOLDER
    return _environment(folder).get_template(file).render(**values)


@cache
def _environment(folder: Path) -> jinja2.Environment:
    environment = build_environment(folder, keep_trailing_newline=True)
    filters: dict[str, Any] = {
        "number": lambda value, spec=".0f", missing="nan": format_number(value, spec, missing),
        "percent": lambda value: percent_text(float(value)),
        "band": lambda values: band_text(*map(float, values)),
        "mm": format_millimetres,
        "rms": lambda values: float(np.sqrt((values**2).mean())),
        "minus": lambda text: text.replace("-", "−"),
        "signed": format_signed,
        "spread": format_spread,
        "unbroken": lambda text: text.translate(_UNBROKEN_CHARACTERS),
        "words": join_words,
        "plain": lambda text: escape_markdown(str(text)),
    }
    environment.filters |= filters
    environment.globals |= {"abs": abs, "len": len, "max": max, "min": min, "zip": zip}
    return environment


def format_millimetres(metres: Any, digits: int = 0) -> str:
    """Format a length in m as millimetres; infinity as ∞ and NaN as –.

    Examples
    --------
    >>> format_millimetres(0.0125, 1), format_millimetres(np.inf)
    ('12.5', '∞')
    """
    value = 1000 * float(metres)
    return "∞" if np.isinf(value) else "–" if np.isnan(value) else f"{value:.{digits}f}"


def format_signed(value: float, digits: int = 2) -> str:
    """Format a number with a true minus sign, and zero without a sign.

    Examples
    --------
    >>> format_signed(-0.5), format_signed(0.5), format_signed(-0.001)
    ('−0.50', '0.50', '0.00')
    """
    return f"{round(float(value), digits) + 0.0:.{digits}f}".replace("-", "−")


def format_spread(values: Iterable[float], digits: int = 2) -> str:
    """Format median and range of values; a dash if there are none.

    Examples
    --------
    >>> format_spread([0.5, 0.4, 0.9]), format_spread([2.0]), format_spread([150.26])
    ('0.50 (0.40–0.90)', '2.00', '150')
    """
    finite = np.array([value for value in values if np.isfinite(value)])
    if not finite.size:
        return "—"
    middle, low, high = (
        format_signed(v, digits if abs(v) < 100 else 0)
        for v in (np.median(finite), finite.min(), finite.max())
    )
    to = " to " if "−" in low else "–"
    return middle if low == high else f"{middle} ({low}{to}{high})"


def join_words(words: Iterable[Any], last: str = "and") -> str:
    """Join words into a list as in a sentence.

    Examples
    --------
    >>> join_words(["beam", "plate", "sound"])
    'beam, plate and sound'
    """
    *rest, final = [str(word) for word in words]
    return f"{', '.join(rest)} {last} {final}" if rest else final
