"""Will it do? A rule in pixels, and the answer for one plate before anything is filmed."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from thesis_lib.book.pieces import benchmarks
from thesis_lib.measure.feasibility.assess import Assessment, assess, describe
from thesis_lib.measure.feasibility.draft import draft_manifest
from thesis_lib.measure.messages import LIMIT
from thesis_lib.vision import cone_law
from thesis_lib.web.markdown import columns

PLATE: dict[str, Any] = {
    "cameras": 4,
    "structure.kind": "plate",
    "structure.length_mm": 600,
    "structure.width_mm": 400,
    "structure.thickness_mm": 3,
    "excitation.frequency_hz": 50,
    "excitation.amplitude_mm": 0.2,
}
"""What is known of the plate."""
PHONES: dict[str, dict[str, Any]] = {
    "full HD": {},
    "4K": {"cameras.width_px": 3840, "cameras.height_px": 2160},
}
LOSSLESS, COMPRESSED = "lossless", "H.264, crf 23"
MOTIONS = (2.0, 1.0, LIMIT["small-motion"], 0.1)  # px


def wrong_px(film: str) -> float:
    """Pixels by which a kind of film has a motion wrong, rms, at the worst of all motions."""
    rows = benchmarks.read()["compression"]["rows"]
    return float(max(row["motion_px"] * row["error"] for row in rows if row["film"] == film))


def command(given: Mapping[str, Any]) -> str:
    """The command that makes the manifest, in lines that a page can show."""
    parts = [f"-p {name}={shlex.quote(str(value))}" for name, value in given.items()]
    lines = [" ".join(parts[i : i + 3]) for i in range(0, len(parts), 3)]
    return " \\\n    ".join(["thesis measure --new plate", *lines])


def rule() -> str:
    """How many pixels of motion are enough, by what films have wrong."""
    whole = float(cone_law.cone_deflection_error(1, 1, PLATE["cameras"], np.pi / 2))
    films = {
        "as a phone compresses it": wrong_px(COMPRESSED),
        "without loss": wrong_px(LOSSLESS),
        "rounded to whole pixels, as in the thesis": whole,
    }
    rows = [
        {"film": name} | {f"{moved:g} px": _percent(wrong / moved) for moved in MOTIONS}
        for name, wrong in films.items()
    ]
    return (
        "**One pixel of motion will do. With a phone's film half a pixel is the least.** Count the "
        "pixels that the largest deflection moves a marker in the picture, from rest. Of that "
        f"deflection a shape is then wrong by up to\n\n{columns(rows)}\n[Films compressed by "
        "x264](benchmarks.md#what-compression-leaves), by its own defaults, stand for a phone's. "
        "The last row is the average of four cameras.\n"
    )


def answer() -> str:
    """The plate: what to type, what comes out, and whether it will do."""
    told = {name: assess(draft_manifest(PLATE | phone)) for name, phone in PHONES.items()}
    asked = f"```console\n$ {command(PLATE)}\n$ thesis measure --check plate/planned.yaml\n```\n"
    more = " ".join(f"-p {name}={value}" for name, value in PHONES["4K"].items())
    said = "\n".join(["```text", *describe(told["full HD"]), "```"])
    return "\n".join(
        [
            _verdict(told),
            columns([_row(name, one) for name, one in told.items()]),
            f"These commands tell it, before anything is filmed:\n\n{asked}",
            "No folder need be there. The first command puts phones around the plate, so near that "
            "it just fits into their pictures, and lists what it assumed. For 4K add "
            f"`{more}`.\n",
            f":::{{dropdown}} What the check says of full HD\n{said}\n:::\n",
        ]
    )


def _percent(share: float) -> str:
    return benchmarks.format_share(share) if share < 1 else "all of it"


def _shares(one: Assessment) -> tuple[float, float, float]:
    """Errors over the largest deflection: of a compressed film, without loss, of whole pixels."""
    moved = min(row.motion_px for row in one.table)
    worst = one.rig.rounding[1] / PLATE["excitation.amplitude_mm"]
    return wrong_px(COMPRESSED) / moved, wrong_px(LOSSLESS) / moved, worst


def _row(name: str, one: Assessment) -> dict[str, str]:
    lossy, exact, whole = map(_percent, _shares(one))
    return {
        "phones": name,
        "a pixel on the plate, mm": f"{one.table[0].ground_sample_mm:.2f}",
        "motion, px": f"{min(row.motion_px for row in one.table):.2f}",
        "compressed": lossy,
        "without loss": exact,
        "by whole pixels": whole,
    }


def _verdict(told: Mapping[str, Assessment]) -> str:
    """Whether it will do, and what the frequency asks for."""
    few = [name for name, one in told.items() if "small-motion" in {w.code for w in one.warnings}]
    errs = {name: f"{name} ({_percent(_shares(one)[0])})" for name, one in told.items()}
    enough = " and ".join(text for name, text in errs.items() if name not in few)
    does = f"Four phones will do in {enough}" if enough else "Four phones will not do"
    fails = f", not in {' and '.join(errs[name] for name in few)}" if few and enough else ""
    rate, steady = 2 * PLATE["excitation.frequency_hz"], next(iter(told.values())).rig.steady_s
    return (
        f"**{does}{fails}.** So much is the shape wrong at most. For "
        f"{PLATE['excitation.frequency_hz']} Hz take more than {rate} frames a second, too. Or "
        f"know the frequency to {LIMIT['alias'] / steady:.1g} Hz, as from a generator, and say "
        "`excitation.undersampled=true`.\n"
    )


PIECES: dict[str, Callable[[], str]] = {"film-rule": rule, "film-answer": answer}
