"""Functions of the library in pages: beside a formula stands, folded, what computes it."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from thesis_lib.files import project_root


class ShownCode(SphinxDirective):
    """``{computed-by} vision.rounding.difference_variance``: its program text, as it runs."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Parse what would stand in the page."""
        full = f"thesis_lib.{self.arguments[0]}"
        module, _, name = full.rpartition(".")
        try:
            function = getattr(import_module(module), name)
        except (ImportError, AttributeError):
            raise self.error(f"computed-by: the library has no {full}") from None
        self.env.note_dependency(str(Path(inspect.getfile(function)).relative_to(project_root())))
        return self.parse_text_to_nodes(
            f"::::{{dropdown}} In code: `{name}`\n:class-container: tl-code\n\n"
            f"{{py:func}}`{full}`, without its description:\n\n"
            f"```python\n{text(function)}\n```\n::::\n"
        )


def text(function: Callable[..., Any]) -> str:
    """The program text of a function without its docstring."""
    source = inspect.getsource(function)
    first, *rest = ast.parse(source).body[0].body  # type: ignore[attr-defined]
    lines = source.splitlines()
    if rest and isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
        del lines[first.lineno - 1 : first.end_lineno]
    return "\n".join(line for line in lines if line.strip()).strip()
