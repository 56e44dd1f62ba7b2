"""The report of a measurement: one page that loads nothing, and the lines for the screen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.arrays import Image
from thesis_lib.measure.exchange import files
from thesis_lib.measure.feasibility.describe import describe
from thesis_lib.measure.feasibility.limits import Assessment
from thesis_lib.measure.fitting.models import rms
from thesis_lib.measure.radiation.files import MEANINGS as SOUND_FILES
from thesis_lib.measure.radiation.report import sound_section
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import figures as draw
from thesis_lib.measure.report import html, tables
from thesis_lib.measure.report.notes import notes, source_of_size
from thesis_lib.measure.report.view import shape_view
from thesis_lib.plotting.style import saved
from thesis_lib.web.shell import shell

Pictures = dict[str, tuple[str, bytes]]  # name: kind of file and content


def figures(
    data: xr.Dataset, seen: xr.Dataset, manifest: Manifest, firsts: Sequence[Image]
) -> Pictures:
    """All pictures of the report, by name.

    Parameters
    ----------
    data : xarray.Dataset
        The result.
    seen : xarray.Dataset
        What :func:`~thesis_lib.measure.report.shown.shown` returns.
    manifest : Manifest
        The manifest.
    firsts : sequence of ndarray, shape (height, width)
        The first frame of each camera.
    """
    made = {
        "shape": draw.shape(data, manifest),
        "cameras": draw.cameras(data, manifest),
        "motion": draw.motion(data, seen),
        "residuals": draw.residuals(seen),
    }
    if data["shots_used"].any():
        made["corners"] = draw.corners(data)
    pictures = {name: ("svg", saved(figure, "svg")) for name, figure in made.items()}
    for i, first in enumerate(firsts):
        one = seen.isel(camera=i)
        photo = draw.photograph(first, one["found"].values, one["outline"].values)
        pictures[f"camera-{i:02d}"] = ("png", saved(photo, "png", dpi=140))
    return pictures


def table(data: xr.Dataset) -> pd.DataFrame:
    """The result marker by marker, in mm and degrees."""
    mm = {
        "x_mm": "x",
        "y_mm": "y",
        "deflection_mm": "deflection",
        "standard_error_mm": "standard_error",
        "quadrature_mm": "quadrature",
        "model_mm": "reference_deflection",
    }
    frame = pd.DataFrame({name: np.round(1e3 * data[key].values, 6) for name, key in mm.items()})
    frame.insert(0, "marker", np.arange(1, len(frame) + 1))
    frame["phase_deg"] = np.round(data["phase"].values, 3)
    frame["cameras"] = data["cameras_seen"].values
    return frame


def summary(data: xr.Dataset) -> list[str]:
    """What was found, in a few lines."""
    w, error = 1e3 * data["deflection"].values, 1e3 * data["standard_error"].values
    known = np.isfinite(w)
    most = int(np.nanargmax(np.abs(np.where(np.isfinite(error), w, np.nan))))
    lines = [
        f"frequency {_frequency(data)}",
        f"largest deflection {abs(w[most]):.4g} ± {error[most]:.2g} mm at x = "
        f"{1e3 * float(data['x'][most]):.4g} mm, y = {1e3 * float(data['y'][most]):.4g} mm",
        f"{np.count_nonzero(known)} of {len(w)} markers measured; standard error of a marker "
        f"{rms(error):.2g} mm, so that {3 * rms(error):.2g} mm could be told from rest",
    ]
    if data.attrs["most_similar"]:
        best = data["mac"].sel(candidate=data.attrs["most_similar"])
        lines.append(
            f"most similar to {data.attrs['most_similar']}: MAC {float(best):.5f}, mean distance "
            f"{float(data['mean_error']):.2g} % of the largest deflection"
        )
    return lines


def page(
    data: xr.Dataset,
    manifest: Manifest,
    assessment: Assessment,
    pictures: Pictures,
    radiated: xr.Dataset | None = None,
) -> str:
    """The report as one HTML page, with the sound if that was asked for."""
    parts = [
        f"<h1>{escape(data.attrs['title'])}</h1>",
        html.items(summary(data)),
        html.warned(notes(data)),
        shape_view(data, (manifest.structure.length_mm / 1e3, manifest.structure.width_mm / 1e3)),
        html.figure(pictures, "shape", "Deflection of the markers at the instant of its maximum."),
        html.details("The numbers, marker by marker", html.frame(table(data))),
        "" if radiated is None else sound_section(radiated, manifest),
        "<h2>Model</h2>" + _model(data),
        "<h2>Cameras and calibration</h2>",
        html.frame(tables.cameras(data)),
        html.figure(pictures, "cameras", "Where the calibration puts the cameras."),
        html.figure(
            pictures,
            "corners",
            "Residuals of the board's corners. They should scatter about "
            "zero; a pattern tells of a lens that the model does not describe, or of a board "
            "that is not flat.",
        )
        if "corners" in pictures
        else "",
        html.details("Pictures of the board that were not used", html.items(_lines(data, "notes"))),
        "<h2>Synchronisation</h2>" + html.items(_lines(data, "synchronisation")),
        "<h2>Markers</h2>",
        html.frame(tables.tracking(data)),
        *(
            html.figure(
                pictures,
                f"camera-{i:02d}",
                f"First frame of camera {escape(str(name))}: markers found, and the outline "
                "of the structure as the calibration puts it.",
            )
            for i, name in enumerate(data["camera"].values)
        ),
        "<h2>Vibration</h2>",
        html.figure(
            pictures,
            "motion",
            "The marker that moves most, folded into one period of the "
            "frequency found. A thin line is a steady vibration that the cameras' clocks "
            "agree on.",
        ),
        html.figure(
            pictures,
            "residuals",
            "Distance of the centres in each frame from what the cameras agree on. A step tells of "
            "a camera that was touched, a slow rise of clocks that drift apart.",
        ),
        "<h2>Files</h2>"
        + html.items([*files.MEANINGS, *(() if radiated is None else SOUND_FILES)]),
        "<h2>Feasibility, from the manifest alone</h2>",
        f"<pre>{escape(chr(10).join(describe(assessment)))}</pre>",
        *map(html.remedy, dict.fromkeys(warning.code for warning in assessment.warnings)),
        "<h2>What was assumed</h2>" + html.items(_assumed(data, manifest)),
        html.details("The manifest", f"<pre>{escape(manifest.model_dump_json(indent=1))}</pre>"),
        html.details(
            "How this was made",
            html.items(
                [
                    f"{key}: {str(data.attrs[key]).strip()}"
                    for key in ("source", "commit", "created", "versions")
                ]
            ),
        ),
    ]
    return shell(data.attrs["title"], "\n".join(part for part in parts if part))


def _lines(data: xr.Dataset, name: str) -> list[str]:
    """The lines of an attribute."""
    return str(data.attrs[name]).split("\n")


def _assumed(data: xr.Dataset, manifest: Manifest) -> Iterable[str]:
    """What the result rests on and nothing in it can prove."""
    yield (
        f"The size of everything comes from {source_of_size(manifest)}. By that the markers' grid "
        f"is {100 * (float(data['grid_scale']) - 1):+.3f} % larger than "
        f"the manifest says, and its markers lie {1e3 * float(data['grid_rms']):.3f} mm (rms) off "
        "their places."
    )
    yield "The structure is flat at rest, and moves along its normal."
    yield "The calibration was the same while the board and while the structure was filmed."
    yield "Pictures and sound of a camera start together, to within a period of the vibration."
    if any(camera.readout_s for camera in manifest.cameras):
        yield "Every row of a picture was exposed at its own time, as readout_s says."
    else:
        yield (
            "All rows of a frame are exposed at once. A rolling shutter sees markers lower in the "
            "picture later: give readout_s, else their phase errs by up to 2πf times that."
        )
    if manifest.board.two_sided and not manifest.board.thickness_mm and data["shots_used"].any():
        yield "The board has no thickness: its two sides are taken to be in one place."
    order = int(data["harmonics"])
    yield (
        f"In the steady part every image coordinate is a constant and {order} "
        f"harmonic{'s' if order > 1 else ''} of one frequency."
    )
    yield (
        "Standard errors are those by the scatter of the centres, times the motion in the plane "
        "over "
        "what that scatter explains, "
        f"{max(float(np.nan_to_num(data['in_plane_excess'])), 1.0):.2g}, and what the "
        "calibration's own errors add, as its pictures of the board tell by leaving one out. "
        "Errors that show in none of these they do not know."
    )
    if manifest.excitation.undersampled:
        yield "The frequency is known from elsewhere: the frames alone would show an alias."
    if manifest.excitation.sound == "room":
        yield (
            "The sound tells when the cameras started and nothing of the force: its phase, and "
            "which side is up, are unknown."
        )
    if manifest.excitation.sound == "none":
        yield (
            "The vibration is steady in all recordings: no sound tells when they started. The "
            "force's phase, and which side is up, are unknown."
        )
    if not data.attrs["most_similar"]:
        yield "There is no model of this structure: the shape is compared with none."
    else:
        yield (
            "The model's shape is put into the size that fits best, so that only its form is "
            "compared."
        )


def _model(data: xr.Dataset) -> str:
    if not data.sizes["candidate"]:
        return "<p>The manifest gives no model to compare with.</p>"
    order = np.argsort(-np.nan_to_num(data["mac"].values))[:6]
    part = data.isel(candidate=order)
    frame = pd.DataFrame(
        {
            "mode of the model": part["candidate"].values,
            "MAC": tables.texts(part["mac"].values, ".5f"),
            "its frequency in Hz": tables.texts(part["model_frequency"].values, ".4g"),
        }
    )
    return f"<p>Found at {_frequency(data)}.</p>" + html.frame(frame)


def _frequency(data: xr.Dataset) -> str:
    used, tracks = float(data["frequency"]), float(data["frequency_of_tracks"])
    error = float(data["frequency_deviation"])
    if np.isnan(error):
        return f"{used:.6g} Hz (the recording is too short to check it)"
    return f"{used:.6g} Hz (the tracks show {tracks:.6g} ± {error:.1g} Hz)"
