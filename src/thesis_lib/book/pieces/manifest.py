"""What the book tells of manifests and warnings, made from the models and limits themselves."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from thesis_lib.book.pieces import filming as guidance
from thesis_lib.files import whole_text
from thesis_lib.measure.feasibility.limits import THRESHOLDS
from thesis_lib.measure.recordings.manifest_model import (
    BoardSpec,
    CameraFiles,
    Excitation,
    Manifest,
    Markers,
    Structure,
)
from thesis_lib.measure.recordings.radiation_fields import Radiation
from thesis_lib.measure.recordings.sought import Sought
from thesis_lib.studies.vocabulary import allowed_text, unit

PARTS: dict[str, type[BaseModel]] = {
    "manifest": Manifest,
    "structure": Structure,
    "markers": Markers,
    "cameras": CameraFiles,
    "board": BoardSpec,
    "excitation": Excitation,
    "radiation": Radiation,
    "modes": Sought,
}

REMEDIES: dict[str, dict[str, str]] = {
    "Time": {
        "short-rest": "Start all cameras, and let nothing move for a second or two.",
        "few-rest-frames": "Lengthen the rest: the structure's frame comes from its mean.",
        "few-frames": "Lengthen the steady part.",
        "few-periods": "Lengthen the steady part.",
        "steady-at-rest": "Let `steady_s` begin when the vibration has settled.",
    },
    "Frame rate": {
        "undersampled": "Film faster; or set `undersampled: true` if you know the frequency from "
        "elsewhere, as from the generator.",
        "near-nyquist": "Film faster, or record long: the fit of all frames bears it, single "
        "frames do not.",
        "few-samples": "Film faster if you can. Else the fit leaves the second harmonic out.",
        "alias": "Take the frequency from the generator, to as many digits as the warning asks "
        "for; or shorten the steady part.",
        "alias-edge": "Change the frame rate or the frequency a little, or record longer.",
        "higher-modes": "Begin gently, and let the steady part begin when what rings has died "
        "away; or film faster.",
    },
    "Exposure and lens": {
        "long-exposure": "Shorten the exposure and add light. The fit puts the loss right, but not "
        "the noise that grows with it.",
        "motion-blur": "Shorten the exposure and add light, or vibrate less.",
        "depth-of-field": "Close the aperture and add light, or go farther away.",
        "too-near": "One of distance and focal length is wrong: put it right.",
    },
    "View": {
        "coarse": "Go nearer, or take more pixels, a longer lens or larger markers.",
        "foreshortened": "Raise the camera, go nearer, or take larger markers.",
        "crowded-markers": "Raise the camera, go nearer, or leave more room between markers.",
        "out-of-view": "Go farther away or take a shorter lens. If all markers are seen and only "
        "corners are cut off, give `corners_px`.",
        "shallow-view": "Raise the camera.",
        "steep-view": "Lower the camera: seen from above, deflection does not move an image.",
        "large-move": "Let the motion grow over some periods, film faster, or leave more room "
        "between markers.",
    },
    "All cameras together": {
        "lost-markers": "Move or turn cameras until two see each marker.",
        "same-line": "Move one of the two cameras: from one place they tell the same.",
        "weak-markers": "Let cameras on other sides see these markers, too.",
        "below-noise": "Go nearer, take more pixels, record longer, or vibrate more.",
    },
}


def fields(part: str) -> str:
    """The fields of a part of the manifest, as a Markdown definition list.

    Parameters
    ----------
    part : str
        A name of :data:`PARTS`.
    """
    model = PARTS[part]
    entries = []
    for name, field in model.model_fields.items():
        given = _default(model, name)
        term = f"`{name}` · {given}"
        parts = [str(field.description)]
        if allowed_text(model, name) != "an object":  # whose fields stand in a list of their own
            parts.append(f"Allowed: {allowed_text(model, name)}")
        entries.append((term, ". ".join(_sentence(one) for one in parts) + "."))
    return _definitions(entries)


def _default(model: type[BaseModel], name: str) -> str:
    """A field's default with its unit, or what it says of being given."""
    if model.model_fields[name].is_required():
        return "required" + (f", in {unit(name)}" if unit(name) else "")
    whole: Any = model() if model is not CameraFiles and model is not Manifest else None
    field = model.model_fields[name]
    value = getattr(whole, name) if whole else field.get_default(call_default_factory=True)
    if isinstance(value, BaseModel):
        return "its fields below"
    if value is None:
        return "null" + (f", else in {unit(name)}" if unit(name) else "")
    return f"{_shown(value)} {unit(name)}".rstrip()


def _shown(value: Any) -> str:
    """A value as it stands in YAML."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_shown, value))}]"
    number = isinstance(value, float)
    return f"{value:.10g}" if number else json.dumps(value, ensure_ascii=False).strip('"')


def warnings() -> str:
    """Every warning of the assessment, its limit, its reason, and what to do about it."""
    parts = []
    for title, remedies in REMEDIES.items():
        entries = []
        for code, remedy in remedies.items():
            limit = THRESHOLDS[code]
            space = "" if limit.unit == "°" else " "
            reason = _sentence(f"{limit.reason}.")
            entries.append((f"`{code}` · {limit.value:g}{space}{limit.unit}", f"{reason} {remedy}"))
        parts.append(f"*{title}*\n\n{_definitions(entries)}")
    return "\n".join(parts)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _definitions(entries: list[tuple[str, str]]) -> str:
    """A Markdown definition list."""
    escaped = ((term, text.replace("*", r"\*")) for term, text in entries)
    return "\n".join(f"{term}\n: {text}\n" for term, text in escaped)


PIECES: dict[str, Callable[[], str]] = {
    **{f"record-{part}": partial(fields, part) for part in PARTS},
    "record-warnings": warnings,
    **guidance.PIECES,
}


def write(folder: Path) -> None:
    """Write every piece of :data:`PIECES` into a folder, as ``NAME.md``."""
    for name, piece in PIECES.items():
        text = piece()
        whole_text(folder / f"{name}.md", text)
