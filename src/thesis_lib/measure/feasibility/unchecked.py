"""What a manifest leaves open, so that no limit can be held against it."""

from __future__ import annotations

from collections.abc import Sequence

from thesis_lib.measure.feasibility.outlook import OPTICS, STEADY_S
from thesis_lib.measure.recordings.manifest_model import Manifest


def unchecked(manifest: Manifest) -> list[str]:
    """Checks that could not be made, and the fields that they need."""
    needs = {
        "ground sample distance": OPTICS[:3],
        "view": OPTICS,
        "errors": OPTICS,
        "depth of field": (*OPTICS, "f_number"),
    }
    groups: dict[tuple[str, str], list[str]] = {}
    for camera in manifest.cameras:
        lacks: dict[str, list[str]] = {}
        for what, fields in needs.items():
            missing = [name for name in fields if getattr(camera, name) is None]
            lacks.setdefault(_list(missing), []).append(what)
        for fields_text, whats in lacks.items():
            groups.setdefault((fields_text, _list(whats)), []).append(camera.name)
    lines = [
        f"{what} of camera{'s' * (len(names) > 1)} {_list(names)}: give {missing_text}"
        for (missing_text, what), names in groups.items()
        if missing_text
    ]
    e = manifest.excitation
    if e.frequency_hz is None and e.kind == "tone":
        lines.append("frame rate, exposure, blur and movement: give excitation.frequency_hz")
    if e.amplitude_mm is None:
        lines.append("blur, movement and whole pixels: give excitation.amplitude_mm")
    if e.steady_s is None:
        lines.append(
            f"length of the steady part, taken as {STEADY_S:g} s: give excitation.steady_s"
        )
    if e.sound == "room":
        lines.append("a clap: no field tells whether every sound track has one")
    if manifest.structure.kind == "flat":
        lines.append('natural frequencies: give structure.kind "beam" or "plate" if it is one')
    return lines


def _list(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))
