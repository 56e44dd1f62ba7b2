"""The numbers of the page that walks through chapter 5, from the measured recordings."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment import methods as shapes
from thesis_lib.measure.fitting.reconstruction import deflection_at
from thesis_lib.measure.recordings.markers import rows_on
from thesis_lib.vibration.motion import Component
from thesis_lib.web.markdown import columns, table

LITERAL, FULL = "literal", "full"


def _parameters(data: xr.Dataset) -> dict[str, Any]:
    """Return the parameters that the recordings were rendered with."""
    given: dict[str, Any] = json.loads(data.attrs["rendering"])
    return given


def _omega(data: xr.Dataset) -> float:
    return 2 * np.pi * float(data["frequency"])


def _signed(value: float, digits: int) -> str:
    """A number with its sign, the minus as it is printed."""
    return f"{value:+.{digits}f}".replace("-", "−")


def _calibration(data: xr.Dataset) -> str:
    """What each way of calibrating makes of the cameras."""
    rows = []
    for name in data["camera"].values:
        camera = data.sel(camera=name)
        focal = [
            f"{np.abs(camera[f'focal_error_{kind}'].values).max():.4f}"
            for kind in ("single", LITERAL, FULL)
        ]
        places = [f"{1e6 * float(camera[f'centre_error_{kind}']):.0f}" for kind in (LITERAL, FULL)]
        residual = np.sqrt(np.nanmean(camera["corner_residuals"].values ** 2))
        rows.append(
            [
                str(name),
                f"{int(camera['shots_used'])}",
                *focal,
                *places,
                f"{1e6 * float(camera['centre_deviation']):.0f}",
                f"{residual:.4f}",
            ]
        )
    header = [
        "camera",
        "shots used",
        "focal length alone, %",
        "the thesis's way, %",
        "adjusted, %",
        "centre, the thesis's way, µm",
        "adjusted, µm",
        "predicted, µm",
        "residual, px",
    ]
    literal = data["reprojection_rms"].sel(calibration=LITERAL)
    return table(header, rows) + (
        "\nErrors against the truth: of the worse of the two focal lengths, and of the centre of "
        "projection after the four cameras are moved as one rigid body onto the true ones. *Alone* "
        "is Zhang's method camera by camera, with all corners; "
        "*adjusted* all corners and all cameras together. The residual is the rms of a "
        f"coordinate after the adjustment; the thesis's way leaves {float(literal):.4f} px.\n"
    )


def _synchronisation(data: xr.Dataset) -> str:
    """Delays, and what is left of them by the two alignments."""
    rows = []
    for name in data["camera"].values[1:]:
        camera = data.sel(camera=name)
        true, rate = float(camera["true_delay"]), float(camera["frame_rate"])
        whole = int(camera["delay_frames"]) - true * rate
        part = (float(camera["delay"]) - true) * rate
        loss = 100 * (1 - np.cos(_omega(data) * whole / rate))
        rows.append(
            {
                "camera": str(name),
                "starts after A, ms": _signed(1000 * true, 2),
                "in frames": _signed(true * rate, 3),
                "whole frames": _signed(int(camera["delay_frames"]), 0),
                "their error, frames": _signed(whole, 3),
                "costs at a maximum, %": f"{loss:.2f}",
                "error of the tone's phase, frames": _signed(part, 4),
            }
        )
    return columns(rows)


def _tracking(data: xr.Dataset) -> str:
    """What is found at each width."""
    rows = []
    for width in sorted(data["width"].values.tolist(), reverse=True):
        at = data.sel(width=width)
        wrong, error = float(at["wrong_share"]), float(at["centre_error"])
        rows.append(
            {
                "frames": f"{width}×{round(width * 9 / 16)}",
                "missing, %": f"{100 * float(at['missing_share']):.1f}",
                "of those found wrong, %": f"{100 * wrong:.1f}" if np.isfinite(wrong) else "–",
                "rms error of the others, px": f"{error:.4f}" if np.isfinite(error) else "–",
            }
        )
    given = _parameters(data)
    camera = data.sel(calibration=FULL).isel(camera=0)
    narrow = min(data["width"].values.tolist())
    focal = float(camera["K"].values[0, 0]) * narrow / float(camera["size"].values[0])
    long = 1000 * rows_on(setups.beam()).diameter * focal / given["distance_mm"]
    high = long * np.sin(np.radians(given["elevation_deg"]))
    return columns(rows) + (
        "\nOver all markers, frames and cameras. *Wrong* is more than one pixel of that width off; "
        f"the rms is of one coordinate. At {narrow} px a marker is {long:.1f} px long and "
        f"{high:.1f} px high.\n"
    )


def _shapes(data: xr.Dataset) -> str:
    """The measured deflection by the four methods, and the frame it is measured in."""
    markers, given = rows_on(setups.beam()), _parameters(data)
    beam, row = setups.beam(), markers.middle_row
    part = Component("bending", 1, given["frequency_hz"], given["amplitude_mm"] / 1000)
    reference = part.amplitude * part.shape(beam, beam.markers)
    instant = shapes.instant_of(data, beam.damping)
    names = "".join(data["camera"].values.tolist())
    exposures = data["exposure"].values
    widest = int(data["width"].max())
    by = {kind: shapes.tracks_of(data, markers, names, widest, kind) for kind in (LITERAL, FULL)}
    matched = shapes.tracks_of(data, markers, names, widest, LITERAL, matched=True)
    rows = []
    for method in ("matched", "literal", "aligned", "harmonic"):
        tracks = {"matched": matched, "harmonic": by[FULL]}.get(method, by[LITERAL])
        measured = shapes.deflection(tracks, instant, method, exposures)[row]
        error = 100 * np.abs(measured - reference) / np.abs(reference).max()
        rows.append(
            {
                "method": method,
                "outermost marker, mm": f"{1000 * measured[-1]:.4f}",
                "mean error, %": f"{np.sqrt(np.nanmean(error**2)):.3f}",
                "largest error, %": f"{np.nanmax(error):.3f}",
            }
        )
    frame = by[FULL].frame
    return columns(rows) + (
        f"\nFour cameras at {widest} px; the truth at the outermost marker is "
        f"{1000 * reference[-1]:.4f} mm. The 75 markers at rest fit their nominal grid with "
        f"{1e6 * frame.rms:.1f} µm rms; the measured grid's size is "
        f"off by {_signed(1e6 * (frame.scale - 1), 0)} millionths.\n"
    )


def _parts(data: xr.Dataset) -> str:
    """What the literal method loses to the missed maximum and to whole frames, each alone."""
    markers, beam = rows_on(setups.beam()), setups.beam()
    names = "".join(data["camera"].values.tolist())
    instant = shapes.instant_of(data, beam.damping)
    tracks = shapes.tracks_of(data, markers, names, int(data["width"].max()), LITERAL)
    first = tracks.times[0, 0] * tracks.rate
    maximum, frame = (float(t) for t in instant.nearest(tracks.rate, first))
    exact = (data["delay"] - data["delay"][0]).values
    left, n = exact - tracks.frames / tracks.rate, len(exact)

    def lost(times: Array) -> float:
        seen, most = (shape_at(t)[markers.middle_row] for t in (times, np.full(n, maximum)))
        return float(100 * np.sqrt(np.nanmean((seen - most) ** 2)) / np.nanmax(np.abs(most)))

    def shape_at(times: Array) -> Array:
        images = [
            own.at(instant.omega, [t])[0] for own, t in zip(tracks.harmonics, times, strict=True)
        ]
        return deflection_at(tracks.P, tracks.frame, tracks.rest, np.array(images))

    peak, rounding, both = (
        lost(times) for times in (np.full(n, frame), maximum + left, frame + left)
    )
    return (
        f"Here A's nearest frame is {abs(frame - maximum) * tracks.rate:.2f} frames off the "
        f"maximum, which alone makes an error of {peak:.2f} %; whole frames between the cameras "
        f"alone make {rounding:.2f} %, both together {both:.2f} %.\n"
    )


def _clocks(data: xr.Dataset) -> str:
    """Frames in a period, and what a clock that is off costs."""
    rate, frequency = float(data["frame_rate"][0]), float(data["frequency"])
    half, whole = (100 * (1 - np.cos(_omega(data) * n / rate)) for n in (0.5, 1.0))
    return (
        f"At {rate:g} frames a second and {frequency:g} Hz a period has {rate / frequency:.2f} "
        f"frames, and one frame is {360 * frequency / rate:.1f}° of it. Half a frame, the most "
        f"that rounding leaves, costs {half:.1f} %; one whole frame, which is as far as the "
        f"thesis vouches for its alignment, costs {whole:.1f} %.\n"
    )


def _exposure(data: xr.Dataset) -> str:
    """What the exposure takes."""
    time, frequency = float(data["exposure"][0]), float(data["frequency"])
    loss = 100 * (1 - np.sinc(frequency * time))
    open_ = 100 * (1 - np.sinc(frequency / float(data["frame_rate"][0])))
    return (
        f"Here the shutter is open for {1000 * time:g} ms, which takes {loss:.3f} %; open for the "
        f"whole frame it would take {open_:.2f} %.\n"
    )


def _matches(data: xr.Dataset) -> str:
    """How many places look like a marker in camera A's first frame, and how far the tip goes."""
    markers, given = rows_on(setups.beam()), _parameters(data)
    found = data["picture_matches"].transpose("axis", "match").values
    spare = int(data.attrs["spare_matches"])
    away = given["amplitude_mm"] / np.tan(np.radians(given["elevation_deg"]))
    return (
        f"In camera A's first frame {found.shape[1]} places look like a disc: the markers, the "
        f"hole and {spare} more. The tip's {given['amplitude_mm']:g} mm up look like {away:.1f} mm "
        f"sideways on the plane at rest, where rows are {1000 * markers.row_spacing:g} mm apart.\n"
    )


PIECES: dict[str, Callable[[xr.Dataset], str]] = {
    "lab-calibration": _calibration,
    "lab-synchronisation": _synchronisation,
    "lab-clocks": _clocks,
    "lab-exposure": _exposure,
    "lab-matches": _matches,
    "lab-tracking": _tracking,
    "lab-steps": _shapes,
    "lab-parts": _parts,
}
