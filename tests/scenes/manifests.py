"""Manifests with one of their values changed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def change(values: dict[str, Any], place: Sequence[str | int], value: Any) -> dict[str, Any]:
    """The values with one of them changed; ``...`` removes it."""
    *way, last = place
    inside: Any = values
    for part in way:
        inside = inside.setdefault(part, {}) if isinstance(inside, dict) else inside[part]
    if value is ...:
        del inside[last]
    else:
        inside[last] = value
    return values
