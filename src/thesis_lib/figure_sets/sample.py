"""The shipped example, rendered and measured once: what the report in the book is written from.

To render and measure it takes a minute. What came out, and what a report draws beside it, is in
``data/recordings/example.nc`` with its digest and that of the code that made it; the first frames
are rendered anew, each in a moment. Other code renders and measures again, and ``build/cache``
keeps it; ``thesis record example`` makes it the data.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import xarray as xr

from thesis_lib import records
from thesis_lib.arrays import Image
from thesis_lib.asides import aside
from thesis_lib.figure_sets import keys
from thesis_lib.figure_sets.recorded import ASKING, STEP, folder
from thesis_lib.files import workplace
from thesis_lib.laboratory.example import example_rig, write_example
from thesis_lib.laboratory.film import frames
from thesis_lib.measure.measured import deflection, recorded
from thesis_lib.measure.recordings.manifest import read_manifest
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report.shown import shown
from thesis_lib.studies.cache import kept
from thesis_lib.studies.storage import opened, write

MAKERS = ("laboratory.example", "measure.measured", "measure.report.shown")
TRACKS = ("corners", "residuals", "found", "outline", "track", "residual")  # kept to STEP px


def path() -> Path:
    """Where it is data."""
    return folder() / "example.nc"


def made_from() -> str:
    """Digest of the code that renders and measures it, in which comments do not count."""
    files = keys.code_of(*(f"thesis_lib.{name}" for name in MAKERS))
    files = [file for file in files if file.parent.name not in ASKING]
    return keys.digest([*files, *keys.facts_of(files)])


def measured_now(say: Callable[[str], object] = lambda _: None) -> xr.Dataset:
    """The example rendered and measured: its result, and what a report draws beside it."""
    with tempfile.TemporaryDirectory() as work:
        return measured(write_example(Path(work) / "example", say), Path(work) / "steps", say)


def measured(place: Path, steps: Path, say: Callable[[str], object] = lambda _: None) -> xr.Dataset:
    """A recording's result, by its manifest, and what a report draws beside it."""
    manifest = read_manifest(place)
    of = recorded(manifest, place.parent, steps, say)
    data, moved = deflection(manifest, of)
    seen = shown(data, moved, manifest, of.recordings)
    return xr.merge([data, seen], combine_attrs="override", join="exact").load()


def current() -> xr.Dataset | None:
    """The data, if they are what this code made."""
    beside = path().with_suffix(".json")
    record = records.read(beside)
    problem = "" if record else f"{beside} is missing or cannot be read"
    problem = problem or records.damage(beside, [path()])
    if record and not problem and record.made_from != made_from():
        problem = f"{path()} was measured by other code"
    if not problem:
        return opened(path())
    aside(f"{problem}; the example is rendered and measured anew, which takes a minute")
    return None


def sample() -> xr.Dataset:
    """The measured example: from the data, the cache, or rendered now."""
    data = current()
    if data is None:
        cache = workplace() / "build" / "cache" / "example.nc"
        data = kept(cache, measured_now, made_from())
    return data


def record(say: Callable[[str], object] = print) -> Path:
    """Render and measure the example now, and make that the data."""
    data = measured_now(say)
    write(data, path(), compact=True, steps=dict.fromkeys(TRACKS, STEP))
    records.write(path().with_suffix(".json"), made_from(), [path()])
    return path()


def first_frames() -> list[Image]:
    """What each camera of the example sees first, before compression."""
    rig = example_rig()
    return [image for k in range(len(rig.stations)) for image in islice(frames(rig, k), 1)]


def manifest_of(data: xr.Dataset) -> Manifest:
    """The manifest that a result holds."""
    return Manifest.model_validate_json(data.attrs["parameters"])
