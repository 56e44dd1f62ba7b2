"""Displacement time histories of all markers, in mm.

The cameras' frames are not simultaneous. Time histories have the times of the first camera's
frames; tracks are interpolated there by Lagrange's polynomial through the six nearest frames. In
the steady-state interval only the residual of the harmonic fit is interpolated, so that neither a
frequency near or above half of the frame rate nor motion blur reduces the amplitude.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure.fitting.harmonics import at_rest, row_delays
from thesis_lib.measure.fitting.reconstruction import group_visible, triangulate_seen
from thesis_lib.measure.recordings.validation import ChainError
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies.cubes import complex_of
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.vision.pinhole import project, projection_matrices
from thesis_lib.vision.triangulation import triangulation_gain

INTERPOLATION_FRAMES = 6  # nodes of Lagrange's polynomial
MAX_GAP_FRAMES = 2.5  # frame intervals; longer gaps are not interpolated
# Of the frame rate; faster motion cannot be interpolated, only fitted
MAX_INTERPOLATED_RATIO = 0.25
STEADY_FLAG, UNSTEADY_FLAG, LOST_FLAG, FAST_FLAG = range(4)
FLAG_MEANINGS = (
    "steady_part outside_the_steady_part fewer_than_two_cameras too_fast_to_be_interpolated"
)
VARIABLES = read_variables(__file__, "history")


def time_histories(
    data: xr.Dataset, recordings: Sequence[Recording], rest_duration_s: float
) -> xr.Dataset:
    """Return the displacement time histories of all markers while all cameras record.

    `data` is what :func:`~thesis_lib.measure.fitting.result.shape_result` returns, with ``steady``;
    every camera sees the structure at rest for `rest_duration_s` at its start.

    Returns
    -------
    xarray.Dataset
        ``displacement`` along x, y and z of the structure in mm at ``time`` in s on the first
        camera's clock, ``standard_error``, ``flag``, ``cameras_seen``, ``residual`` of each camera.
    """
    cameras = [own.camera for own in recordings]
    P, R = projection_matrices(cameras), data["frame_rotation"].values
    rest = R.T @ data["rest_position"].values + data["frame_origin"].values[:, None]
    sigma = data["centre_scatter"].values
    spans = [own.times[[0, -1]] for own in recordings]
    begin, end = max(first for first, _ in spans), min(last for _, last in spans)
    static = np.array([at_rest(own, rest_duration_s) for own in recordings])
    placed = project(P, rest)
    # Each camera's image offset at rest, subtracted at all times; 0 for markers hidden at rest
    off = np.where(np.isfinite(static), static, placed) - placed
    parts = []
    for times, _ in recordings[0].parts(begin, end):
        first, last = data["steady"].values
        steady = (times >= first - 1e-9) & (times <= last + 1e-9)
        pairs = zip(recordings, P, strict=True)
        uv = np.array([_at(own, matrix, data, rest, times, steady) for own, matrix in pairs])
        agreed = uv - off[:, :, None]
        points, seen = triangulate_seen(P, agreed)
        away = np.square(project(P, points) - uv).mean(axis=1)  # (cameras, times, markers)
        counts = np.isfinite(away).sum(axis=2)
        residual = np.sqrt(np.nansum(away, axis=2) / np.where(counts, counts, np.nan))
        moved = np.tensordot(R, points - rest[:, None], axes=1)
        values = {
            "displacement": 1e3 * moved.astype(np.float32),
            "standard_error": 1e3 * _errors(P, R, rest, sigma, agreed).astype(np.float32),
            "flag": np.where(
                seen < 2, LOST_FLAG, np.where(steady[:, None], STEADY_FLAG, UNSTEADY_FLAG)
            ).astype(np.int8),
            "cameras_seen": seen.astype(np.int8),
            "residual": residual.astype(np.float32),
        }
        parts.append(xr.Dataset(label_values(values, VARIABLES), {"time": times}))
    if not parts:
        raise ChainError("the cameras did not record at one time: no frame of one lies within all")
    whole = xr.concat(parts, "time")
    sources = {"x": "x", "y": "y", "rest": "rest_position"}
    places = {name: 1e3 * data[source].values for name, source in sources.items()}
    numbers = "marker", np.arange(1, rest.shape[1] + 1), {"long_name": "number of the marker"}
    whole = whole.assign(label_values(places, VARIABLES)).assign_coords(
        camera=data["camera"], axis=data["axis"], marker=numbers
    )
    meaning = "time on the first camera's clock"
    whole["time"].attrs = {"units": "s", "long_name": meaning, "axis": "T"}
    flag = whole["flag"].values
    if float(data["frequency"]) > MAX_INTERPOLATED_RATIO * min(own.rate for own in recordings):
        flag[flag == UNSTEADY_FLAG] = FAST_FLAG
        for name in ("displacement", "standard_error"):
            whole[name].values[:, flag == FAST_FLAG] = np.nan
    whole["flag"].attrs |= {
        "standard_name": "quality_flag",
        "flag_values": np.arange(4, dtype=np.int8),
        "flag_meanings": FLAG_MEANINGS,
    }
    whole["flag"].encoding = {"_FillValue": None}
    whole["displacement"].attrs |= {"ancillary_variables": "standard_error flag cameras_seen"}
    return whole.assign_attrs(
        title=f"{data.attrs['title']}: motion of every marker",
        comment="What the harmonic fit explains is free of the exposures' blur; in the residual, "
        "and outside the steady-state interval, it is left in.",
    )


def write_csv(path: Path, moved: xr.Dataset) -> None:
    """Write times in s and deflections in mm, a column for each marker."""
    header = ["time_s", *(f"marker_{number}_mm" for number in moved["marker"].values)]
    deflection = moved["displacement"].sel(axis="z").values
    rows = np.column_stack([moved["time"].values, deflection])
    form = ["%.6f", *["%.6g"] * deflection.shape[1]]
    np.savetxt(path, rows, form, ",", header=",".join(header), comments="")


def _at(
    own: Recording, P: Array, data: xr.Dataset, rest: Array, times: Array, steady: Mask
) -> Array:
    """Interpolate the marker images of a camera at other times, (2, times, markers), px."""
    pad = (INTERPOLATION_FRAMES + 1) / own.rate + abs(own.readout)
    found = [*own.parts(times[0] - pad, times[-1] + pad)]
    s, uv = (np.concatenate([part[k] for part in found]) for k in (0, 1))
    late = row_delays(own, project(P[None], rest)[0])
    plain = _lagrange(s, uv, times, late)
    if not steady.any():
        return np.moveaxis(plain, 1, 0)
    amplitude = complex_of(data, "amplitude")
    amplitude = np.where(np.isfinite(amplitude), amplitude, 0)
    normal, omega = data["frame_rotation"].values[2], 2 * np.pi * float(data["frequency"])

    def image_at(at: Array, loss: float) -> Array:  # at (n, markers) or (n, 1)
        height = loss * np.real(amplitude * np.exp(1j * omega * at))
        points = rest[:, None] + normal[:, None, None] * height
        return np.moveaxis(project(P[None], points)[0], 0, 1)

    blurred = image_at(s[:, None] + late, float(np.sinc(omega * own.exposure / (2 * np.pi))))
    whole = _lagrange(s, uv - blurred, times, late) + image_at(times[:, None], 1.0)
    return np.moveaxis(np.where(steady[:, None, None], whole, plain), 1, 0)


def _lagrange(s: Array, values: Array, times: Array, late: Array) -> Array:
    """Interpolate values (n, 2, markers), sampled at s (n,) + late (markers,), at times (m,).

    NaN where a frame of nonzero weight is missing or beyond a gap, outside all frames, or with
    fewer than six of them.
    """
    if len(s) < INTERPOLATION_FRAMES:
        return np.full((len(times),) + values.shape[1:], np.nan)
    at = times[:, None] - late
    first = np.clip(
        np.searchsorted(s, at + 1e-9) - INTERPOLATION_FRAMES // 2, 0, len(s) - INTERPOLATION_FRAMES
    )
    index = first + np.arange(INTERPOLATION_FRAMES)[:, None, None]  # (6, m, markers)
    nodes = s[index]
    weights = np.ones_like(nodes)
    for i in range(INTERPOLATION_FRAMES):
        for j in range(INTERPOLATION_FRAMES):
            if i != j:
                weights[i] *= (at - nodes[j]) / (nodes[i] - nodes[j])
    weights[np.abs(weights) < 1e-6] = 0.0  # at a frame's time the others have no weight
    markers = np.arange(values.shape[2])
    result = np.zeros((len(times), 2, values.shape[2]))
    for w, k in zip(weights, index, strict=True):
        taken = np.moveaxis(values[k, :, markers], 2, 1)  # (m, 2, markers)
        result += np.where(w[:, None] == 0, 0.0, w[:, None] * taken)
    outside = (at < s[0] - 1e-6) | (at > s[-1] + 1e-6)
    apart = np.diff(nodes, axis=0).max(axis=0) > MAX_GAP_FRAMES * np.median(np.diff(s))
    outside |= apart & (np.count_nonzero(weights, axis=0) > 1)  # exact at a frame's time
    result[np.broadcast_to(outside[:, None], result.shape)] = np.nan
    return result


def _errors(P: Array, R: Array, rest: Array, sigma: Array, uv: Array) -> Array:
    """Return standard errors along the structure's axes, (3, times, markers)."""
    visible = np.isfinite(uv).all(axis=1)
    errors = np.full((3,) + visible.shape[1:], np.nan)
    for pattern, where in group_visible(visible.reshape(len(P), -1)):
        response = np.einsum("ai,icuk->acuk", R, triangulation_gain(P[pattern], rest))
        noise = np.square(response).sum(axis=2) * np.square(sigma[pattern])
        each = np.broadcast_to(np.sqrt(noise.sum(axis=1))[:, None], errors.shape)
        errors = np.where(where.reshape(visible.shape[1:]), each, errors)
    return errors
