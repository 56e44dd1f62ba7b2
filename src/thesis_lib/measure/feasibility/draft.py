"""Draft manifests before anything is recorded: telephones around a structure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from thesis_lib.files import whole_text
from thesis_lib.measure.feasibility.prediction import view_markers
from thesis_lib.measure.recordings import template
from thesis_lib.measure.recordings.manifest import Manifest, ManifestError

PHONE_CAMERA: dict[str, Any] = {  # its main camera, as if on a sensor of 36 mm
    "width_px": 1920,
    "height_px": 1080,
    "frame_rate_hz": 60.0,
    "exposure_s": 0.002,
    "focal_length_mm": 26.0,
    "sensor_width_mm": 36.0,
    "f_number": 7.0,
}
FIRST_AZIMUTH_DEG, ELEVATION_DEG = 20.0, 30.0  # of the first camera, of all
DISTANCE_MARGIN = 1.05  # over the distance from which the structure just fits into every image
MARKER_COLUMNS, MARKER_ROWS = 6, 4  # of a plate's markers, unless they are given
MAX_DIAMETER_MM = 12.0  # of a marker
STEADY_INTERVAL_S = [5.0, 35.0]  # half a minute
REPORTED_FIELDS = (
    *(name for name in template.ASKED_FIELDS if name != "cameras.exposure_s"),
    "excitation.amplitude_mm",
    *(f"cameras.{name}" for name in (*PHONE_CAMERA, "distance_mm", "elevation_deg")),
)


def write_draft(folder: Path, given: Mapping[str, Any]) -> tuple[Path, list[str]]:
    """Write ``planned.yaml`` into a folder, which is made if there is none.

    Parameters
    ----------
    folder : Path
        Where the recordings will be; nothing in it is read.
    given : mapping
        Fields by path; ``cameras`` is how many there are.

    Returns
    -------
    Path
        The manifest.
    list of str
        Where the cameras stand, and what was not given and so assumed.

    Raises
    ------
    ManifestError
        If there is such a manifest already, or what is given is not allowed.
    """
    path = folder / "planned.yaml"
    if path.exists():
        raise ManifestError(f"{path}: is there already, allowed: none; edit it, or remove it")
    manifest, own = draft_manifest(given), {k: v for k, v in given.items() if k != "cameras"}
    asked = template.list_asked(manifest, REPORTED_FIELDS)
    folder.mkdir(parents=True, exist_ok=True)
    whole_text(path, template.text_of(manifest, own, asked))
    places = ", ".join(f"{c.azimuth_deg:g}°" for c in manifest.cameras)
    first = manifest.cameras[0]
    where = (
        f"{len(manifest.cameras)} cameras, {first.distance_mm:g} mm from the structure's centre "
        f"and {first.elevation_deg:g}° above its plane, at azimuths {places}"
    )
    return path, [where, *template.list_assumed(manifest, own, asked)]


def draft_manifest(given: Mapping[str, Any]) -> Manifest:
    """Return the manifest of telephones on all sides, as near as the structure fits in view.

    Azimuths are even; for a structure that is more than twice as long as wide, two sides are
    favoured, since from its ends it is seen foreshortened.

    Raises
    ------
    ManifestError
        If what is given is not allowed.
    """
    count, rest = given["cameras"], {k: v for k, v in given.items() if k != "cameras"}
    if type(count) is not int or not 2 <= count <= 16:
        raise ManifestError(f"-p: cameras: given {count}, allowed: a whole number from 2 to 16")
    cameras = [
        {
            "name": f"phone-{i + 1}",
            "video": f"phone-{i + 1}.mp4",
            "board_images": f"board/phone-{i + 1}",
            **PHONE_CAMERA,
            "distance_mm": 1000.0,
            "elevation_deg": ELEVATION_DEG,
        }
        for i in range(count)
    ]
    filled = {"excitation.steady_interval_s": STEADY_INTERVAL_S} | _default_markers(rest) | rest
    manifest = template.validate_manifest(template.with_given(cameras, filled))
    size = manifest.structure.width_mm, manifest.structure.length_mm
    turn = np.radians(FIRST_AZIMUTH_DEG) + 2 * np.pi * np.arange(count) / count
    slender = min(1.0, 2 * size[0] / size[1])
    azimuths = np.degrees(np.arctan2(slender * np.sin(turn), np.cos(turn)))
    for camera, azimuth in zip(cameras, azimuths, strict=True):
        camera.setdefault("azimuth_deg", round(float(azimuth), 1))
    values = template.with_given(cameras, filled)
    if "cameras.distance_mm" not in rest:
        distance = _nearest_distance(template.validate_manifest(values))
        for camera in cameras:
            camera["distance_mm"] = distance
    return template.validate_manifest(values)


def _default_markers(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return markers all over a plate, unless any of theirs is given."""
    size: list[Any] = [given.get(f"structure.{side}_mm") for side in ("length", "width")]
    known = all(isinstance(one, (int, float)) and one > 0 for one in size)
    own = any(name.startswith("structure.markers") for name in given)
    if own or not known or given.get("structure.kind", "beam") == "beam":
        return {}
    along, across = (
        one / (n + 0.5) for one, n in zip(size, (MARKER_COLUMNS, MARKER_ROWS), strict=True)
    )
    return {
        "structure.markers.columns": MARKER_COLUMNS,
        "structure.markers.rows": MARKER_ROWS,
        "structure.markers.spacing_mm": _round_digits(along),
        "structure.markers.row_spacing_mm": _round_digits(across),
        "structure.markers.diameter_mm": min(
            MAX_DIAMETER_MM, _round_digits(min(along, across) / 3)
        ),
    }


def _round_digits(value: float) -> float:
    return float(f"{value:.2g}")


def _nearest_distance(manifest: Manifest) -> float:
    """Return the distance in mm from which all cameras have all of the structure in view."""
    low, high = 1.0, 1e5
    while high > 1.001 * low:
        middle = float(np.sqrt(low * high))
        cameras = tuple(c.model_copy(update={"distance_mm": middle}) for c in manifest.cameras)
        view = view_markers(manifest.model_copy(update={"cameras": cameras}), 0.0)
        inside = bool(view.corners.all() and view.seen.all())
        low, high = (low, middle) if inside else (middle, high)
    return float(10 * np.ceil(DISTANCE_MARGIN * high / 10))
