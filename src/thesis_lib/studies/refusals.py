"""How a value is refused: in one line that says what was given and what is allowed."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticCustomError

from thesis_lib.studies.vocabulary import Fields, allowed_text, unit
from thesis_lib.text import one_line


def permitted(model: type[BaseModel], field: str) -> str:
    """What a field allows, with its unit, as it stands in a refusal."""
    return f"allowed: {allowed_text(model, field)}" + (f", in {unit(field)}" if unit(field) else "")


def shown(value: Any) -> str:
    """A value as it stands in a refusal."""
    try:
        return one_line(json.dumps(value, ensure_ascii=False, default=repr))
    except (TypeError, ValueError, RecursionError):
        return f"a {type(value).__name__} that is not JSON"


def refuse(field: str, given: Any, why: str) -> None:
    """Refuse a value in one line, from inside a validator."""
    message = f"{field}: given {shown(given)}, {why}"
    raise PydanticCustomError("refused", "{message}", {"message": message})


class Refusing(Fields):
    """Fields that refuse what does not go together, each by its name."""

    def refuse(self, name: str, why: str = "") -> None:
        """Refuse the value of a field, by what it allows if no other reason is given."""
        refuse(name, getattr(self, name), why or permitted(type(self), name))


def nearest(name: str, names: Iterable[str]) -> str:
    """The name most like `name`, or empty if none is."""
    return next(iter(difflib.get_close_matches(name, list(names), 1, 0.6)), "")


def suggestion(name: str, names: Iterable[str]) -> str:
    """Words for the name that was probably meant, if there is one."""
    meant = nearest(name, names)
    return f" (did you mean {meant}?)" if meant else ""
