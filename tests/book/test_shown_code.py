"""What pages show as the program text of a function is what runs."""

import inspect
import pkgutil
import re
from importlib import import_module
from types import CodeType

import pytest

from thesis_lib.book import extension
from thesis_lib.files import project_root

PAGES = "\n".join(page.read_text(encoding="utf-8") for page in project_root().glob("book/*.md"))
SHOWN = set(re.findall(r"^```\{computed-by\} (\S+)$", PAGES, re.MULTILINE))


def steps(code, description):
    """What a function does, wherever it stands and whatever it is said to do."""
    inside = [steps(c, None) for c in code.co_consts if isinstance(c, CodeType)]
    constants = {repr(c) for c in code.co_consts if not isinstance(c, CodeType)}
    return code.co_names, code.co_varnames, constants - {repr(description), "None"}, inside


@pytest.mark.parametrize("name", sorted(SHOWN))
def test_what_is_shown_is_what_runs(name):
    shown = pkgutil.resolve_name(f"thesis_lib.{name}")
    text = extension.read_source(shown)
    assert shown.__doc__
    assert shown.__doc__.splitlines()[0] not in text
    postponed = getattr(import_module(shown.__module__), "annotations", None)
    flags = postponed.compiler_flag if postponed else 0
    module = compile(text, "shown", "exec", flags)
    (again,) = (c for c in module.co_consts if isinstance(c, CodeType))
    assert steps(again, None) == steps(inspect.unwrap(shown).__code__, shown.__doc__)
