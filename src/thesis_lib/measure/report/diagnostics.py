"""Diagnostic data that a report draws: some tracks, outlines, residuals of each frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.validation import markers_of
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies.schema import label_values, parse_variables
from thesis_lib.vision.lens import project_points

MAX_FRAMES = 2000  # of a camera, the last ones, that show the motion
VARIABLES = parse_variables("""
    found(camera, side, marker) [px] centres in the camera's first frame
    outline(camera, side, vertex) [px] the structure's corners in the camera's first frame, by the
        calibration
    track_side(camera) [1] along which side of the image the marker that moves most moves most
    track_time(camera, frame) [s] times of frames, on the first camera's clock
    track(camera, frame) [px] motion of the marker that moves most, along the side of the image
        along which the motion is largest
    residual(camera, time) [px] rms distance of the centres in a frame from what the cameras agree
        on
""")


def collect_diagnostics(
    data: xr.Dataset, moved: xr.Dataset, manifest: Manifest, recordings: Sequence[Recording]
) -> xr.Dataset:
    """Collect what the figures of a report draw besides the result.

    Parameters
    ----------
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.fitting.result.shape_result` returns, with ``steady``.
    moved : xarray.Dataset
        What :func:`~thesis_lib.measure.exchange.history.time_histories` returns.
    manifest : Manifest
        Its structure.
    recordings : sequence of Recording
        The cameras and their tracks.

    Returns
    -------
    xarray.Dataset
        ``found``, ``outline``, ``track_side``, ``track_time``, ``track``, ``residual``; NaN where a
        camera has fewer frames than another.
    """
    marker = int(np.nanargmax(np.abs(data["deflection"].values)))
    tracks = [_track(own, marker, *data["steady"].values) for own in recordings]
    longest = max(len(t) for _, t, _ in tracks)

    def padded(values: Array) -> Array:
        return np.pad(values, (0, longest - len(values)), constant_values=np.nan)

    values = {
        "found": [own.centres[0] for own in recordings],
        "outline": [_outline(data, manifest, own) for own in recordings],
        "track_side": [side for side, _, _ in tracks],
        "track_time": [padded(t) for _, t, _ in tracks],
        "track": [padded(moves) for _, _, moves in tracks],
        "residual": moved["residual"].values,
    }
    places = {"camera": data["camera"], "time": moved["time"]}
    return xr.Dataset(label_values(values, VARIABLES), places)


def _track(own: Recording, marker: int, begin: float, end: float) -> tuple[int, Array, Array]:
    """Return the side along which a marker moves most, u (0) or v (1), times, and its motion."""
    parts = [
        (t, uv[:, :, marker]) for t, uv in own.parts(max(begin, end - MAX_FRAMES / own.rate), end)
    ]
    t, uv = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    side = int(np.nanargmax(np.nan_to_num(np.nanstd(uv, axis=0))))
    return side, t, uv[:, side] - np.nanmean(uv[:, side])


def _outline(data: xr.Dataset, manifest: Manifest, own: Recording) -> Array:
    """Return the structure's corners in a camera's image, (2, 4), px."""
    markers = markers_of(manifest)
    corners = on_surface(markers.extent, markers.corners)
    R, origin = data["frame_rotation"].values, data["frame_origin"].values
    return project_points(own.camera, R.T @ corners + origin[:, None])
