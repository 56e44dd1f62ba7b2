"""Forms of parameters on a page: of one figure set, above its viewer, or of all of them.

All that a form knows comes from the models of :mod:`thesis_lib.figure_sets.registry`, so that it
asks, refuses and writes what the ``thesis`` command takes. Beam and plate it computes, too.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from typing import Any

from thesis_lib.figure_sets.parametric import in_page
from thesis_lib.figure_sets.registry import CHAPTER_SETS, STUDIES, TITLES
from thesis_lib.studies import effort
from thesis_lib.studies.fields import describe_permitted
from thesis_lib.studies.request import Study, describe_parameters, whole_numbers

_KNOWN_KEYS = {"title", "description", "default", "allowed"}  # of a schema, told apart from it


def form_data(names: Iterable[str] = tuple(STUDIES)) -> dict[str, Any]:
    """Return what a form of some figure sets shows and checks, as JSON values.

    Returns
    -------
    dict
        ``fields``, a list of parameters that differ in anything: name, meaning, unit, what is
        allowed in words and as JSON schema, how a refusal ends, the default as it would be typed,
        and the choices of a list of names. ``sets`` and ``chapters``, by name: title, and numbers
        of fields in the order to show, and a sentence on what the published run takes; a set also
        numbers in the order in which they are checked, a chapter its sets and the names of the
        parameters in which they differ. ``here``, what the page computes by itself, as
        :func:`thesis_lib.figure_sets.parametric.in_page.page_facts` has it.
    """
    fields: list[dict[str, Any]] = []
    sets: dict[str, dict[str, Any]] = {}
    for name in names:
        study, numbers = STUDIES[name], {}
        schema = study.model_json_schema()["properties"]
        for row in describe_parameters(study):
            if row["name"] == "cube":  # where a notebook writes: not of the command
                continue
            field = _describe_field(study, row, schema[row["name"]])
            if field not in fields:
                fields.append(field)
            numbers[row["name"]] = fields.index(field)
        checked = [numbers[key] for key in study.model_fields if key in numbers]
        sets[name] = {
            "title": study.title,
            "shown": list(numbers.values()),
            "checked": checked,
            "takes": _describe_cost([name]),
        }
    whole = {name: members for name, members in CHAPTER_SETS.items() if sets.keys() >= set(members)}
    return {
        "fields": fields,
        "sets": sets,
        "chapters": {name: _describe_chapter(name, fields, sets) for name in whole},
        "here": in_page.page_facts([name for name in in_page.COMPUTED_SETS if name in sets]),
    }


def form_of(request: Study) -> dict[str, Any]:
    """Return the form of one figure set, which begins with the values of a request."""
    data = form_data([request.name])
    default, values = type(request)().request, request.request
    start = {name: _format_typed(one) for name, one in values.items() if one != default[name]}
    return data | {"start": start}


def _describe_field(
    study: type[Study], row: dict[str, str], schema: dict[str, Any]
) -> dict[str, Any]:
    """Describe a parameter; a list of names only the command knows offers its default's."""
    default = json.loads(row["default"])
    plain = {key: value for key, value in schema.items() if key not in _KNOWN_KEYS}
    named = plain.get("items") == {"type": "string"}
    return {
        **{key: row[key] for key in ("name", "meaning", "unit", "allowed")},
        "schema": plain | ({"items": {"type": "string", "enum": default}} if named else {}),
        "permitted": describe_permitted(study, row["name"]),
        "typed": _format_typed(default),
    }


def _format_typed(value: Any) -> str:
    """Return a value as one would type it.

    Examples
    --------
    >>> [_format_typed(one) for one in (24.0, "known", [500.0, 750.5], [[10.0, 22.0]])]
    ['24', 'known', '500, 750.5', '[[10, 22]]']
    """
    if isinstance(value, str):
        return value
    text = json.dumps(whole_numbers(value), ensure_ascii=False)
    flat = isinstance(value, list) and not any(isinstance(one, list) for one in value)
    return text[1:-1] if flat else text


def _describe_chapter(
    name: str, fields: list[dict[str, Any]], sets: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    """Describe the parameters that sets of a chapter share, common ones first."""
    members = CHAPTER_SETS[name]
    held = Counter(number for one in members for number in sets[one]["shown"])
    numbers = sorted(held, key=lambda number: held[number] < len(members))
    names = [fields[number]["name"] for number in numbers]
    return {
        "title": TITLES[name],
        "sets": members,
        "shown": [n for n in numbers if names.count(fields[n]["name"]) == 1],
        "differ": [one for one in dict.fromkeys(names) if names.count(one) > 1],
        "takes": _describe_cost(members),
    }


def _describe_cost(names: list[str]) -> str:
    """Return the measured cost of running figure sets one after another, or empty."""
    known = effort.read_efforts()
    if not set(names) <= set(known):
        return ""
    total = effort.total_effort(known[name] for name in names)
    return f"With the defaults it takes {total.time} and {total.memory}, from nothing on two cores."
