"""The last step where several modes are asked for: fit, report, files."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib import __version__
from thesis_lib.files import staging
from thesis_lib.measure.calibration.exactness import covariance_of, to_keep
from thesis_lib.measure.exchange import cameras, history, uff, vtk
from thesis_lib.measure.exchange.reading import OWN
from thesis_lib.measure.exchange.tables import write_csv
from thesis_lib.measure.modes import report
from thesis_lib.measure.modes.result import result
from thesis_lib.measure.radiation import files as radiation_files
from thesis_lib.measure.radiation import report as radiation_report
from thesis_lib.measure.radiation.of_measurement import sound_of
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import html, moving
from thesis_lib.measure.report.page import Pictures
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.outputs import put_files
from thesis_lib.studies import storage
from thesis_lib.studies.attributes import with_origin

NEVER = 1e6  # s, after all recordings


def several(
    manifest: Manifest,
    sound: xr.Dataset,
    calibration: xr.Dataset,
    recordings: Sequence[Recording],
    out: Path,
    say: Callable[[str], object],
    further: str = "",
    beside: Pictures | None = None,
) -> Path:
    """Fit the modes, and write report and files into a folder; returns the report.

    A `further` section of the report has pictures of its own, given `beside`.

    Raises
    ------
    ChainError, ModalError
        If what was recorded does not suffice; one line that says what is missing.
    """
    say("fitting the modes")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a marker that is never seen
        covariance = covariance_of(calibration)
        data = with_origin(
            result(manifest, sound, recordings, covariance),
            f"measurement by thesis_lib {__version__}",
        )
        kind = "Modes" if manifest.excitation.kind == "decay" else "Tones"
        data.attrs.update(
            title=f"{kind} of a {manifest.structure.kind}, measured with {len(recordings)} cameras",
            parameters=manifest.model_dump_json(),
            notes=calibration.attrs["notes"],
            synchronisation=sound.attrs["synchronisation"],
            repeats=sound.attrs.get("repeats", ""),
        )
        moved = motion(data, recordings, manifest.excitation.rest_s)
        pictures = report.figures(data)
        radiated = None
        if manifest.radiation is not None:
            radiated = with_origin(sound_of(data, manifest), data.attrs["source"])
        page = report.page(data, manifest, pictures, further, radiated)
        pictures |= beside or {}
    with staging(out) as part:
        storage.write(data, part / "modes.nc")
        write_csv(report.modes(data), part / "modes.csv")
        write_csv(report.shapes(data), part / "shapes.csv")
        html.write_pictures(part, pictures)
        uff.write_modes(part / "modes.uff", data)
        for k in range(data.sizes["mode"]):
            one, name = data.isel(mode=k), f"mode-{k + 1}"
            (part / "vtk" / name).mkdir(parents=True)
            vtk.write(part / "vtk" / name, one)
            frames = moving.shape(one)
            moving.write_gif(part / f"{name}.gif", frames, moving.RATE)
            moving.write_mp4(part / f"{name}.mp4", moving.PERIODS * frames, moving.RATE)
        cameras.write(part, [own.camera for own in recordings], data)
        storage.write(to_keep(calibration), part / OWN)
        if moved is not None:
            storage.write(moved, part / "motion.nc")
            history.write_csv(part / "motion.csv", moved)
            uff.write_motion(part / "motion.uff", data, moved)
        if radiated is not None:
            radiation_files.write(part, radiated)
        (part / "report.html").write_text(page, encoding="utf-8")
        put_files(part, out)
    for line in [*report.summary(data), *radiation_report.summary(radiated)]:
        say(line)
    for note in report.notes(data, manifest):
        say(f"note: {note.text} [{note.code}]")
    return out / "report.html"


def motion(data: xr.Dataset, recordings: Sequence[Recording], rest_s: float) -> xr.Dataset | None:
    """Every marker from frame to frame; nothing where a mode is too fast to be interpolated."""
    highest = float(data["frequency"].max())
    if highest > history.SLOW * min(own.rate for own in recordings):
        return None
    shape = data["lag"].size, data.sizes["marker"]
    plain = data.isel(mode=0).assign(
        centre_scatter=(("camera", "marker"), np.full(shape, float(data["noise"]))),
        steady=("end", [NEVER, NEVER + 1]),
        frequency=highest,
    )
    return with_origin(history.motion(plain, recordings, rest_s), data.attrs["source"])
