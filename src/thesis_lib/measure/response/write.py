"""Motion over force as files and, where no modes are asked for, as a report of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path

import xarray as xr

from thesis_lib import __version__
from thesis_lib.files import staging
from thesis_lib.measure.exchange import uff
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import html
from thesis_lib.measure.report.page import Pictures
from thesis_lib.measure.response import report
from thesis_lib.measure.response.result import responded
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.outputs import put_files
from thesis_lib.studies import storage
from thesis_lib.studies.attributes import with_origin
from thesis_lib.web.shell import shell


def over_force(
    manifest: Manifest,
    sound: xr.Dataset,
    recordings: Sequence[Recording],
    folder: Path,
    out: Path,
    say: Callable[[str], object],
) -> tuple[str, Pictures]:
    """Write motion over force into a folder; returns what the report tells of it, and pictures.

    Raises
    ------
    ForceError, ChainError, MediaError
        If force or tracks do not suffice; one line that says what would do.
    """
    say("motion over force")
    data = with_origin(
        responded(manifest, sound, recordings, folder), f"measurement by thesis_lib {__version__}"
    )
    data.attrs.update(
        title=f"Motion of a {manifest.structure.kind} over a force",
        parameters=manifest.model_dump_json(),
        synchronisation=sound.attrs["synchronisation"],
    )
    pictures = report.figures(data)
    with staging(out) as part:
        storage.write(data, part / "response.nc")
        uff.write_response(part / "response.uff", data)
        put_files(part, out)
    for line in report.summary(data):
        say(line)
    for note in report.warnings(data, manifest):
        say(f"note: {note.text} [{note.code}]")
    return report.section(data, manifest, pictures), pictures


def alone(
    manifest: Manifest, sound: xr.Dataset, notes: str, section: str, pictures: Pictures, out: Path
) -> Path:
    """Write a report of motion over force alone."""
    title = f"Motion of a {manifest.structure.kind} over a force"
    page = [
        f"<h1>{escape(title)}</h1>",
        section,
        "<h2>Files</h2>" + html.items(report.FILES),
        html.details("Calibration", html.items(notes.split("\n"))),
        html.details("Synchronisation", html.items(sound.attrs["synchronisation"].split("\n"))),
        html.details("The manifest", f"<pre>{escape(manifest.model_dump_json(indent=1))}</pre>"),
    ]
    with staging(out) as part:
        html.write_pictures(part, pictures)
        (part / "report.html").write_text(shell(title, "\n".join(page)), encoding="utf-8")
        put_files(part, out)
    return out / "report.html"
