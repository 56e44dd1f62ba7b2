"""Whether recordings are what the chain needs."""

from __future__ import annotations

from pathlib import Path

from thesis_lib.measure.recordings.manifest import ManifestError, check_recordings
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.markers import Markers
from thesis_lib.measure.recordings.media_info import MediaError, check_frame_times, probe


class ChainError(ValueError):
    """Recordings that do not fit together; the message is one line."""


def markers_of(manifest: Manifest) -> Markers:
    """What the manifest says is printed on the structure."""
    given = manifest.structure
    hole = None if given.hole is None else (float(given.hole[0]), float(given.hole[1]))
    size = given.length_mm / 1000, given.width_mm / 1000
    diameter = given.markers.diameter_mm / 1000
    return Markers(size, given.marker_points, diameter, hole, given.markers.tone == "bright")


def check(manifest: Manifest, folder: Path) -> list[int]:
    """Refuse recordings that are not what the manifest says, or not whole.

    Returns
    -------
    list of int
        Frames of each video.

    Raises
    ------
    ManifestError, MediaError
        With the first difference, in one line.
    """
    for problem in check_recordings(manifest, folder):
        raise ManifestError(problem)
    counts = []
    for camera in manifest.cameras:
        path = folder / camera.video
        there = len(check_frame_times(path, camera.frame_rate_hz))
        says = probe(path).frames
        if says is not None and there < says:
            raise MediaError(f"{path}: ends before frame {there}, the file says {says}")
        counts.append(there)
    return counts
