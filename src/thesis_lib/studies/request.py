"""What the parameters of all figure sets share: fields, checks, and their one-line refusals."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from pydantic import ValidationError, model_validator
from pydantic_core import from_json

from thesis_lib.facts import setups
from thesis_lib.facts.setups import Setting
from thesis_lib.studies.refusals import permitted, refuse, shown, suggestion
from thesis_lib.studies.vocabulary import (
    SHARED,
    Fields,
    Seed,
    Trials,
    allowed_text,
    field,
    unit,
)
from thesis_lib.text import first_hidden, listed, one_line
from thesis_lib.vibration.structure import Structure

CHOOSES = {"cube", "trials", "repeats", "seed", "modes", "cases", "layouts"}
"""Parameters that only choose of what the thesis has, or draw."""


class ParameterError(ValueError):
    """A request that cannot be run; the message is one line for the person who made it."""


class Study(Fields):
    """Parameters that all figure sets share."""

    name: ClassVar[str]
    title: ClassVar[str]
    subject: ClassVar[str]  # beam, plate, sound or experiment
    section: ClassVar[str] = ""  # of the thesis, if it is about one
    folder: ClassVar[str] = ""  # where it is found, if that is not the library
    study: ClassVar[str]  # what is varied: distance, aperture, resolution, arrays, cameras
    varied: ClassVar[str]  # name of the varied parameter
    varied_label: ClassVar[str]
    first: ClassVar[str] = "literal run"  # what trial 0 is
    predicts: ClassVar[str] = "law of rounding"  # what predicted_error stands for
    draws: ClassVar[str] = "pixel-grid shifts"  # what differs from trial to trial

    trials: Trials = 200
    seed: Seed = 0
    cube: str = field(
        "",
        "file to write the cube to, from the project's folder; empty writes nothing",
        "a path that ends in .nc, or empty",
    )

    def settings(self) -> list[Setting]:
        """The study's settings in the order of the thesis's tables; none if nothing is varied."""
        return []

    @property
    def structure(self) -> Structure:
        """What is measured."""
        return setups.beam()

    @property
    def predicted_by(self) -> str:
        """What `predicted_error` stands for, as legends say it."""
        return self.predicts

    @property
    def is_of_the_thesis(self) -> bool:
        """Whether the parameters are the thesis's, apart from what only chooses or draws."""
        model = type(self)
        if model.folder or any(info.is_required() for info in model.model_fields.values()):
            return False
        printed, fields = model(), set(model.model_fields) - CHOOSES
        return all(getattr(self, name) == getattr(printed, name) for name in fields)

    @property
    def request(self) -> dict[str, Any]:
        """All that determines the result, as JSON values; where it is written does not."""
        return self.model_dump(mode="json", exclude={"cube"})

    @property
    def digest(self) -> str:
        """Ten hexadecimal digits that stand for the request."""
        text = json.dumps([self.name, self.request])  # the order of layouts is part of it
        return hashlib.sha256(text.encode()).hexdigest()[:10]

    @model_validator(mode="after")
    def _check_lists(self) -> Study:
        for name in type(self).model_fields:
            value = getattr(self, name)
            repeats = isinstance(value, list) and len(set(value)) < len(value)
            if repeats and name != "amplitude_mm":
                self.refuse(name)
        if self.cube and not self.cube.endswith(".nc"):
            self.refuse("cube")
        return self

    def refuse(self, field: str) -> None:
        """Refuse the value of a field by what the field allows."""
        refuse(field, getattr(self, field), permitted(type(self), field))


def beyond(reach: float) -> str:
    """What a distance from a structure allows, as it stands in a refusal; `reach` is in mm."""
    return f"allowed: more than {reach:.4g} mm, the reach of the structure and its deflection"


def validated(model: type[Study], values: Mapping[str, Any]) -> Study:
    """A model's parameters from plain values, refused in one line."""
    name = model.name
    parts = []
    for key, value in values.items():
        if key not in model.model_fields:
            names = list(model.model_fields)
            hint = suggestion(str(key), names)
            command = "thesis plan --parameters" if name == "plan" else f"thesis list {name}"
            there = listed((one for one in names if one != "cube"), command)
            raise ParameterError(f"{name}: no parameter {one_line(str(key))}{hint}; {there}")
        try:
            text = json.dumps(value).replace("4a\\u2032", "4a'")
            from_json(f"[{text}]")
        except (TypeError, ValueError, RecursionError):  # not JSON, or nested beyond measure
            problem = f"{key}: given {shown(value)}, {permitted(model, key)}"
            raise ParameterError(f"{name}: {problem}") from None
        parts.append(f'"{key}": {text}')
    try:
        request = model.model_validate_json(f"{{{', '.join(parts)}}}")
    except ValidationError as error:
        raise ParameterError(f"{name}: {_first_problem(model, values, error)}") from None
    if problem := first_hidden(values):
        raise ParameterError(f"{name}: {problem}")
    return request


def describe(model: type[Study]) -> list[dict[str, str]]:
    """One row per parameter: name, default, unit, allowed, meaning."""
    defaults = model().model_dump(mode="json")
    return [
        {
            "name": name,
            "default": json.dumps(defaults[name], ensure_ascii=False),
            "unit": unit(name),
            "allowed": allowed_text(model, name),
            "meaning": info.description or "",
        }
        for name, info in sorted(
            model.model_fields.items(),
            key=lambda item: (item[0] in Study.model_fields, item[0] in SHARED),
        )
    ]


def _first_problem(model: type[Study], values: Mapping[str, Any], error: ValidationError) -> str:
    problem = error.errors(include_url=False)[0]
    if problem["type"] == "refused":
        return problem["msg"]
    key = str(problem["loc"][0])
    place, inside = key, values[key]
    for part in problem["loc"][1:]:  # where in the value; the rest is pydantic's own words
        if isinstance(inside, Mapping) and part in inside:
            place, inside = f"{place}[{shown(part)}]", inside[part]
        elif isinstance(inside, Sequence) and isinstance(part, int) and part < len(inside):
            place, inside = f"{place}[{part}]", inside[part]
    return f"{place}: given {shown(problem['input'])}, {permitted(model, key)}"


def whole_numbers(value: Any) -> Any:
    """The same with whole numbers written without a point."""
    if isinstance(value, list):
        return [whole_numbers(one) for one in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value
