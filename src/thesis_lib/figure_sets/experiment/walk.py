"""Figures and paragraphs of the page that walks through chapter 5, from its recordings."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from PIL import Image

from thesis_lib import files
from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment import figures, methods, photographs
from thesis_lib.figure_sets.experiment.compute import EXPERIMENT, tracks_of
from thesis_lib.figure_sets.experiment.figure_set import ExperimentResolution
from thesis_lib.measure.fitting.reconstruction import deflection_at
from thesis_lib.measure.recordings.board import rows_on
from thesis_lib.plotting.style import save_figure
from thesis_lib.studies.cubes import iterate_slices
from thesis_lib.templates import render
from thesis_lib.vibration.motion import Component

PICTURE_WIDTH_PX = 1500  # width of figures that hold photographs
WEBP_QUALITY = 85  # of 100, at which they are stored
WALK_FIGURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "rig": figures.draw_rig,
    "views": photographs.draw_views,
    "board": photographs.draw_board,
    "coverage": figures.draw_coverage,
    "sound": figures.draw_sound,
    "outline": photographs.draw_outline,
    "plane": photographs.draw_plane,
    "centres": photographs.draw_centres,
    "widths": photographs.draw_widths,
    "tracks": figures.draw_tracks,
}


def file_name(name: str) -> str:
    """Name a figure's file: WebP if it holds photographs, SVG otherwise."""
    kind = "webp" if WALK_FIGURES[name].__module__ == photographs.__name__ else "svg"
    return f"lab-{name}.{kind}"


def write_pictures(data: xr.Dataset, folder: Path) -> list[Path]:
    """Write all figures of the measured recordings; the same dataset gives the same bytes."""
    paths = [folder / file_name(name) for name in WALK_FIGURES]
    for path, draw in zip(paths, WALK_FIGURES.values(), strict=True):
        figure = draw(data)
        content = _encode_webp(figure) if path.suffix == ".webp" else save_figure(figure, "svg")
        files.whole_file(path, partial(Path.write_bytes, data=content))
    return paths


def _encode_webp(figure: Figure) -> bytes:
    """Encode as WebP: lossless where that takes fewer bytes, else as near as eyes can tell."""
    file = io.BytesIO(save_figure(figure, "png", dpi=PICTURE_WIDTH_PX / figure.get_figwidth()))
    picture, found = Image.open(file).convert("RGB"), []
    for lossless in (True, False):
        file = io.BytesIO()
        picture.save(file, format="webp", lossless=lossless, quality=WEBP_QUALITY, method=6)
        found.append(file.getvalue())
    return min(found, key=len)


# What paragraphs and tables need besides the recordings.


def _phase_loss(data: xr.Dataset, frames: float) -> float:
    """Return what being so many frames off a maximum costs, in %."""
    phase = 2 * np.pi * float(data["frequency"]) * frames / float(data["frame_rate"][0])
    return float(100 * (1 - np.cos(phase)))


def _synchronisation(data: xr.Dataset) -> dict[str, Any]:
    """Compare delays in whole frames with the true ones."""
    cameras = []
    for one in list(iterate_slices(data, "camera"))[1:]:
        true = float(one["true_delay"] * one["frame_rate"])
        cameras.append((one, true, _phase_loss(data, float(one["delay_frames"]) - true)))
    return {"cameras": cameras}


def _clocks(data: xr.Dataset) -> dict[str, Any]:
    """Return the frames in a period, and what a clock that is off costs."""
    half, whole = (_phase_loss(data, frames) for frames in (0.5, 1.0))
    rate, frequency = float(data["frame_rate"][0]), float(data["frequency"])
    return {"rate": rate, "frequency": frequency, "half": half, "whole": whole}


def _exposure(data: xr.Dataset) -> dict[str, Any]:
    """Return what the exposure takes, in %."""
    time, rate = float(data["exposure"][0]), float(data["frame_rate"][0])
    loss, whole = (100 * (1 - np.sinc(float(data["frequency"]) * t)) for t in (time, 1 / rate))
    return {"loss": loss, "whole_frame": whole}


def _matches(data: xr.Dataset) -> dict[str, Any]:
    """Return how far the tip seems to move on the plane at rest."""
    given = json.loads(data.attrs["rendering"])
    sideways = given["amplitude_mm"] / np.tan(np.radians(given["elevation_deg"]))
    markers = rows_on(setups.thesis_beam())
    return {"amplitude_mm": given["amplitude_mm"], "sideways_mm": sideways, "markers": markers}


def _tracking(data: xr.Dataset) -> dict[str, Any]:
    """Return the size of a marker's image at the least width."""
    given, narrow = json.loads(data.attrs["rendering"]), int(data["width"].min())
    camera = data.sel(calibration="full").isel(camera=0)
    focal = float(camera["K"].values[0, 0]) * narrow / float(camera["size"].values[0])
    length = 1000 * rows_on(setups.thesis_beam()).diameter * focal / given["distance_mm"]
    height = length * np.sin(np.radians(given["elevation_deg"]))
    return {"narrow": narrow, "length_px": length, "height_px": height}


def _steps(data: xr.Dataset) -> dict[str, Any]:
    """Measure the deflection by the four methods, and the frame it is measured in."""
    given, beam = json.loads(data.attrs["rendering"]), setups.thesis_beam()
    instant, found = _instant(data), []
    part = Component("bending", 1, given["frequency_hz"], given["amplitude_mm"] / 1000)
    reference = part.amplitude * part.shape(beam, beam.markers)
    tracks = {name: _tracks(data, name) for name in ("matched", "literal", "harmonic")}
    for method in ("matched", "literal", "aligned", "harmonic"):
        own = tracks["literal" if method == "aligned" else method]
        measured, _ = methods.measure_deflection(own, instant, method, data["exposure"].values)
        measured = measured[rows_on(beam).middle_row]
        error = 100 * np.abs(measured - reference) / np.abs(reference).max()
        mean, largest = np.sqrt(np.nanmean(error**2)), np.nanmax(error)
        found.append((method, measured, {"mean": mean, "largest": largest}))
    return {
        "methods": found,
        "widest": int(data["width"].max()),
        "reference": reference,
        "frame": tracks["harmonic"].frame,
    }


def _instant(data: xr.Dataset) -> methods.Instant:
    return methods.find_maxima(data, setups.thesis_beam().damping)


def _tracks(data: xr.Dataset, method: str) -> methods.Tracks:
    """Return the tracks of all cameras at the largest width, as a method takes them."""
    letters, widest = "".join(data["camera"].values.tolist()), int(data["width"].max())
    return tracks_of(data, (method, letters, widest))


def _parts(data: xr.Dataset) -> dict[str, Any]:
    """Return what the literal method loses to the missed maximum and to whole frames alone."""
    row = rows_on(setups.thesis_beam()).middle_row
    instant, tracks = _instant(data), _tracks(data, "literal")
    first = tracks.times[0, 0] * tracks.rate
    maximum, frame = (float(t) for t in instant.nearest(tracks.rate, first))
    exact = (data["delay"] - data["delay"][0]).values
    residual, n = exact - tracks.frames / tracks.rate, len(exact)

    def shape_at(times: Array) -> Array:
        images = [
            own.at(instant.omega, [t])[0] for own, t in zip(tracks.harmonics, times, strict=True)
        ]
        return deflection_at(tracks.P, tracks.frame, tracks.rest, np.array(images))[row]

    def loss(times: Array) -> float:
        seen, most = shape_at(times), shape_at(np.full(n, maximum))
        return float(100 * np.sqrt(np.nanmean((seen - most) ** 2)) / np.nanmax(np.abs(most)))

    return {
        "frames_off": abs(frame - maximum) * tracks.rate,
        "peak": loss(np.full(n, frame)),
        "rounding": loss(maximum + residual),
        "both": loss(frame + residual),
    }


TEXT_VALUES: dict[str, Callable[[xr.Dataset], dict[str, Any]]] = {
    "lab-calibration": lambda _: {},
    "lab-synchronisation": _synchronisation,
    "lab-clocks": _clocks,
    "lab-exposure": _exposure,
    "lab-matches": _matches,
    "lab-tracking": _tracking,
    "lab-steps": _steps,
    "lab-parts": _parts,
}


def fill_text(data: xr.Dataset, name: str) -> str:
    """Fill in a table or paragraph of the page."""
    return render(__file__, name, data=data, slices=iterate_slices, **TEXT_VALUES[name](data))


def write_all(folder: Path) -> None:
    """Write figures and texts into a folder, from the recordings of chapter 5."""
    data = EXPERIMENT.load(ExperimentResolution().recordings)
    write_pictures(data, folder)
    for name in TEXT_VALUES:
        files.whole_text(folder / f"{name}.md", fill_text(data, name))
