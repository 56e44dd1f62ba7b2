"""Numbers that help to film, computed as the assessment of a manifest computes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from thesis_lib.laboratory.recording_files import example_manifest, example_rig
from thesis_lib.measure.feasibility.assess import CENTRE_NOISE_PX, Assessment, assess, describe
from thesis_lib.measure.feasibility.prediction import alias
from thesis_lib.measure.messages import LIMIT
from thesis_lib.measure.recordings.manifest_model import CameraFiles, Manifest
from thesis_lib.vision.optics import depth_of_field
from thesis_lib.web.markdown import columns, table

LAYOUTS = {
    "two on one side, 20° apart": (-10, 10),
    "two on one side, 90° apart": (-45, 45),
    "two that face each other": (0, 180),
    "three on one side, 45° apart": (-45, 0, 45),
    "three all around": (0, 120, 240),
    "four, as in the thesis": (10, -10, 170, 190),
}
ELEVATIONS = (5, 15, 25, 35, 50, 70)
SHUTTERS = (60, 125, 250, 500, 1000)  # parts of a second
FREQUENCIES = (5, 25, 100)  # Hz
STOPS = (2.8, 5.6, 11)
SECONDS = (1, 10, 60)


def seen_from(azimuths: Sequence[float], elevation: float) -> Assessment:
    """The assessment of the example's structure and camera, filmed from other places."""
    example = example_manifest(example_rig())
    cameras = tuple(
        example.cameras[0].model_copy(
            update={"name": str(i), "azimuth_deg": float(azimuth), "elevation_deg": elevation}
        )
        for i, azimuth in enumerate(azimuths)
    )
    return assess(example.model_copy(update={"cameras": cameras}))


def _rms_um(of: Assessment) -> tuple[float, float]:
    """Standard errors of one frame and of the fit, rms over the markers, in µm."""
    return 1000 * of.rig.one_frame[0], 1000 * of.rig.fit[0]


def _layouts() -> str:
    """What sides do."""
    own = _camera()
    rows = []
    for name, azimuths in LAYOUTS.items():
        one, fit = _rms_um(seen_from(azimuths, 25.0))
        rows.append([name, f"{one:.0f}", f"{fit:.1f}"])
    seconds = seen_from((0, 180), 25.0).rig.steady_s
    header = ["cameras, 25° up", "one frame, µm", f"fit of {seconds:g} s, µm"]
    return table(header, rows) + (
        "\nStandard errors of the deflection, root mean square over the markers of the example: "
        f"{own.distance_mm:g} mm away, {own.focal_length_mm:g} mm lens on {own.sensor_width_mm:g} "
        f"mm, {own.width_px} px, {own.frame_rate_hz:g} frames a second, centres that scatter "
        f"{CENTRE_NOISE_PX:g} px.\n"
    )


def _elevations() -> str:
    """What elevation does."""
    rows = []
    for degrees in ELEVATIONS:
        phi = np.radians(degrees)
        one, _ = _rms_um(seen_from((0, 180), float(degrees)))
        of = seen_from((0, 180), float(degrees)).table[0]
        rows.append(
            {
                "elevation": f"{degrees}°",
                "deflection seen": f"{100 * np.cos(phi):.0f} %",
                "markers high, px": f"{of.across_px:.1f}",
                "slides, mm/mm": f"{1 / np.tan(phi):.1f}",
                "one frame, µm": f"{one:.0f}",
            }
        )
    return columns(rows) + (
        "\nTwo cameras that face each other. *Slides*: along the plane at rest, where its "
        "neighbours are, a marker seems to move so far for each mm of deflection. The last column "
        "takes the centres to scatter alike at all elevations, which flat markers do not.\n"
    )


def _exposure() -> str:
    """What shutters take."""
    rows = [
        [f"1/{parts} s", *(_lost(frequency / parts) for frequency in FREQUENCIES)]
        for parts in SHUTTERS
    ]
    header = ["shutter", *(f"{frequency} Hz" for frequency in FREQUENCIES)]
    return table(header, rows) + (
        f"\nShare of the amplitude that is lost. From {LIMIT['long-exposure']:g} of a period on, "
        f"which takes {_lost(LIMIT['long-exposure'])}, the assessment warns. A dash: open for a "
        "whole period or more, of which nothing useful is left.\n"
    )


def _lost(turns: float) -> str:
    return f"{100 * (1 - np.sinc(turns)):.2g} %" if turns < 1 else "–"


def _alias() -> str:
    """What a vibration above half of the frame rate asks for."""
    rate, frequency = 60.0, 110.0
    turns = LIMIT["alias"]
    rows = [
        [f"{seconds} s", f"{turns / seconds:.2g}", f"{1e6 * turns / seconds / frequency:.0f}"]
        for seconds in SECONDS
    ]
    header = ["steady part", "known to, Hz", f"millionths of {frequency:g} Hz"]
    return (
        f"At {rate:g} frames a second {frequency:g} Hz look like {alias(frequency, rate):g} Hz. "
        f"The frequency must be known so well that it drifts by less than {turns:g} of a turn "
        f"over the steady part, which takes {_lost(turns)} of the amplitude:\n\n"
        + table(header, rows)
        + "\nThe last column is asked of the camera's clock, too. The alias must also stay "
        f"{LIMIT['alias-edge']:g} turns of the steady part away from 0 and from half of the "
        "frame rate.\n"
    )


def _focus() -> str:
    """What apertures keep sharp."""
    own, outlook = _camera(), assess(example_manifest(example_rig())).table
    focal, distance = own.focal_length_mm or 0.0, own.distance_mm or 0.0
    rows = []
    for stop in STOPS:
        row = [f"f/{stop:g}"]
        for width in (1280, 1920):
            circle = LIMIT["depth-of-field"] * (own.sensor_width_mm or 0.0) / width
            near, far = depth_of_field(focal, stop, distance, circle)
            row.append(f"{near:.0f}–{far:.0f}")
        rows.append(row)
    nearest = min(one.nearest_mm for one in outlook)
    farthest = max(one.farthest_mm for one in outlook)
    return table(["aperture", "1280 px, mm", "1920 px, mm"], rows) + (
        f"\nDepths that a {focal:g} mm lens on {own.sensor_width_mm:g} mm, focused at "
        f"{distance:g} mm, keeps sharp to {LIMIT['depth-of-field']:g} px. The example's markers "
        f"lie between {nearest:.0f} and {farthest:.0f} mm.\n"
    )


def _markers() -> str:
    """What markers must look like."""
    return (
        f"In every picture a marker is at least {LIMIT['coarse']:g} px wide and "
        f"{LIMIT['foreshortened']:g} px high, and {LIMIT['crowded-markers']:g} px of ground lie "
        "between it and its neighbour. From one frame to the next it may move by "
        f"{LIMIT['large-move']:g} of the distance to that neighbour while the tracker does not "
        "know the motion yet.\n"
    )


def _check() -> str:
    """What the command tells of the example."""
    lines = describe(assess(example_manifest(example_rig())))
    return "\n".join(["```text", *lines, "```", ""])


def _camera() -> CameraFiles:
    example: Manifest = example_manifest(example_rig())
    return example.cameras[0]


PIECES: dict[str, Callable[[], str]] = {
    "film-check": _check,
    "film-layouts": _layouts,
    "film-elevations": _elevations,
    "film-exposure": _exposure,
    "film-alias": _alias,
    "film-focus": _focus,
    "film-markers": _markers,
}
