"""Safe parsing of untrusted YAML, TOML, XML and JSON files, and output of tables as CSV.

A few lines of YAML can stand for gigabytes, or for lists that are nested without end. Size and
depth are therefore limited, so that a file is read within a second or refused: every function
raises :class:`TextFileError` with the problem, and with its line number if there is one.

Spreadsheets may open the tables, so no text in them is a formula.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import yaml

from thesis_lib.text import one_line

if TYPE_CHECKING:
    import pandas as pd

MAX_BYTES = 1_000_000  # of a file; fifty board images, with all their corners, are 150 kB
MAX_VALUES = 50_000  # in a YAML text; so many take a third of a second
MAX_DEPTH = 20  # levels; a manifest has six
MAX_CHARACTERS = 10_000  # of a single value in YAML
# TOML needs memory as the square of a name's parts: limits are 20 in a row, 1000 quoted ones
_LONG_NAME = re.compile(r"(?:\.[ \t]*+[\w-]++[ \t]*+){20}")
_QUOTED_PART = re.compile(r"""["'][ \t]*+\.""")
_POWER_PATTERN = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+$")  # 210e9 is a text in YAML 1.1
POWER_RESOLVER = "tag:yaml.org,2002:float", _POWER_PATTERN, list("-+0123456789")
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")  # first characters of spreadsheet formulas
_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class TextFileError(ValueError):
    """A text that cannot be read; the message is one line, without the name of the file."""


class _Loader(_SafeLoader):  # type: ignore[misc]
    """Loader of plain YAML, with OpenCV's matrices as mappings; refuses duplicate keys."""

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except ValueError:  # a number of thousands of digits, an invalid date
            given = one_line(str(node.value))
            raise _refusal(f"given {given}, allowed: a value that can be read", node) from None

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        keys: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _refusal("a list or an object as a field's name, allowed: text", key)
            if key.value in keys:
                raise _refusal(f"{one_line(str(key.value))} is given twice", key)
            keys.add(str(key.value))
        return super().construct_mapping(node, deep)


_Loader.add_constructor(
    "tag:yaml.org,2002:opencv-matrix", lambda own, node: own.construct_mapping(node, deep=True)
)
_Loader.add_implicit_resolver(*POWER_RESOLVER)


def _refusal(problem: str, at: Any) -> TextFileError:
    return TextFileError(f"line {at.start_mark.line + 1}: {problem}")


def read_text(path: Path, errors: str = "strict") -> str:
    """Return the text of a file in UTF-8, without a byte order mark.

    Invalid UTF-8 is handled according to `errors`, as in :meth:`bytes.decode`. A text of more than
    :data:`MAX_BYTES` is refused.
    """
    with path.open("rb") as file:  # limited, since the file may grow
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise TextFileError(f"larger than {MAX_BYTES / 1e6:g} MB, allowed: a smaller text")
    try:
        return data.decode("utf-8-sig", errors)
    except UnicodeDecodeError:
        raise TextFileError("not a text in UTF-8") from None


def parse_yaml(text: str) -> Any:
    r"""Return the values of a YAML text, also from OpenCV; aliases are refused.

    Examples
    --------
    >>> parse_yaml("%YAML:1.0\n---\nE: 210e9")
    {'E': 210000000000.0}
    """
    if text.startswith("%YAML"):  # from OpenCV, which also writes \' for ', invalid in YAML
        text = re.sub(r"\\(.)", lambda one: one[1] if one[1] == "'" else one[0], text)
    if text.startswith("%YAML:"):
        text = "#" + text
    with _parsing("a YAML text"):
        _check_yaml(text)
        return yaml.load(text, _Loader)


@contextmanager
def _parsing(kind: str) -> Iterator[None]:
    """Convert errors of parsing and of further processing to a :class:`TextFileError`."""
    try:
        yield
    except TextFileError:
        raise
    except yaml.MarkedYAMLError as error:
        where = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise TextFileError(f"{where}{one_line(str(error.problem))}") from None
    except (json.JSONDecodeError, tomllib.TOMLDecodeError, ElementTree.ParseError) as error:
        raise TextFileError(f"not {kind}: {one_line(str(error), 120)}") from None
    except (yaml.YAMLError, TypeError, AttributeError, LookupError, ValueError, RecursionError):
        raise TextFileError(f"not {kind} that can be read") from None


def _check_yaml(text: str) -> None:
    """Refuse a text that would take long to load, from the stream of the parser's events."""
    depth = 0
    for count, event in enumerate(yaml.parse(text, _Loader)):
        if isinstance(event, yaml.AliasEvent):
            raise _refusal("an alias, allowed: values", event)
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > MAX_CHARACTERS:
            raise _refusal(f"a value of more than {MAX_CHARACTERS} characters", event)
        if depth > MAX_DEPTH:
            raise _refusal(f"nested too deep, allowed: {MAX_DEPTH} levels", event)
        if count > MAX_VALUES:
            raise _refusal(f"too many values, allowed: {MAX_VALUES}", event)


def parse_toml(text: str) -> dict[str, Any]:
    """Return the values of a TOML text."""
    if _LONG_NAME.search(text) or len(_QUOTED_PART.findall(text)) > 1000:
        raise TextFileError(f"a name of too many parts, allowed: {MAX_DEPTH}")
    with _parsing("a TOML text"):
        return _shallow(tomllib.loads(text))


def parse_json(text: str) -> Any:
    """Return the values of a JSON text."""
    with _parsing("a JSON text"):
        return _shallow(json.loads(text))


def parse_xml(text: str) -> ElementTree.Element:
    """Return the root element of an XML text; declared types and entities are refused."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise TextFileError("declares its own types (DOCTYPE), allowed: elements")
    with _parsing("an XML text"):
        return _shallow(ElementTree.fromstring(text))


def _shallow(values: Any) -> Any:
    """Return lists, objects or an element unchanged; refuse those that are nested too deep."""
    level = [values]
    for _ in range(MAX_DEPTH + 1):
        inside = [one for one in level if isinstance(one, dict | list | ElementTree.Element)]
        level = [v for one in inside for v in (one.values() if isinstance(one, dict) else one)]
    if level:
        raise TextFileError(f"nested too deep, allowed: {MAX_DEPTH} levels")
    return values


def quote_formula(value: Any) -> Any:
    """Return a value for a table's cell, with an apostrophe before a text that is a formula.

    Examples
    --------
    >>> quote_formula("=1+1"), quote_formula("A"), quote_formula(-1.0)
    ("'=1+1", 'A', -1.0)
    """
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA_STARTS) else value


def write_csv(table: pd.DataFrame, path: Path, float_format: str | None = None) -> None:
    """Write a table of numbers and texts as CSV, with formulas quoted."""
    table.map(quote_formula).to_csv(path, index=False, float_format=float_format)
