"""A plan as a labelled cube, and as a table of cameras."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.planning.errors import predict_errors
from thesis_lib.planning.planner import Option, Plan
from thesis_lib.planning.positions import camera_centres
from thesis_lib.studies.schema import label_values, read_variables

CAMERA_COLUMNS = (
    "camera",
    "x_mm",
    "y_mm",
    "z_mm",
    "azimuth_deg",
    "elevation_deg",
    "distance_mm",
    "focal_length_mm",
    "width_px",
    "height_px",
    "frame_rate_hz",
)


def camera_table(cube: xr.Dataset, option: int) -> str:
    """Return the cameras of an option as CSV."""
    one = cube.isel(option=option)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CAMERA_COLUMNS)
    for i in range(int(one["n_cameras"])):
        camera = one.isel(camera=i)
        lengths = (1000 * camera["camera_position"].values).tolist()
        angles = [float(camera["camera_azimuth"]), float(camera["camera_elevation"])]
        lens = [1000 * float(camera["camera_distance"]), 1000 * float(camera["focal_length"])]
        place = [f"{round(value, 3) + 0.0:.3f}" for value in (*lengths, *angles)]
        size = int(one["width_px"]), int(one["height_px"])
        rate = f"{float(one['frame_rate']):g}"
        writer.writerow([i + 1, *place, f"{lens[0]:.3f}", f"{lens[1]:g}", *size, rate])
    return text.getvalue()


OF_SOUND = read_variables(__file__, "sound")
AXIS_NAMES = ("x", "y", "z")

VARIABLES = read_variables(__file__, "plan")


def as_cube(plan: Plan) -> xr.Dataset:
    """Return the cube of a plan: every option, the proposed one marker by marker."""
    options, body = plan.options, plan.body
    best = options[plan.chosen]
    most = max(len(one.layout) for one in options)
    places = np.full((len(options), most, 7), np.nan)
    for row, one in zip(places, options, strict=True):
        row[: len(one.layout)] = _camera_rows(one, plan)
    verified = plan.verified
    values: dict[str, Any] = {
        "n_cameras": [len(one.layout) for one in options],
        "width_px": [one.resolution[0] for one in options],
        "height_px": [one.resolution[1] for one in options],
        "frame_rate": [one.frame_rate for one in options],
        "pixel_rate": [one.pixel_rate for one in options],
        "cost": [one.cost for one in options],
        "expected_error": [one.expected for one in options],
        "bound": [one.bound for one in options],
        "predicted_error": [one.predicted for one in options],
        "simulated_error": [one.simulated for one in verified],
        "simulated_low": [one.band[0] for one in verified],
        "simulated_high": [one.band[1] for one in verified],
        "on_front": [int(i in plan.front) for i in range(len(options))],
        "chosen": plan.chosen,
        "camera_azimuth": places[:, :, 0],
        "camera_elevation": places[:, :, 1],
        "camera_distance": places[:, :, 2],
        "focal_length": places[:, :, 3],
        "camera_position": places[:, :, 4:],
        "point_error": predict_errors(best.scene, best.layout, best.resolution[0]),
        "marker": body.points.T,
        "normal": body.normals.T,
        "reference_deflection": body.shapes * np.array(plan.request.peaks_m)[:, None],
        "outline": _outline(plan).T,
        "frequency": body.frequencies,
    }
    cube = xr.Dataset(
        coords={
            "mode": ("mode", list(body.modes), {"units": "1", "long_name": "mode number"}),
            "axis": ("axis", list(AXIS_NAMES), {"units": "1", "long_name": "axis"}),
        },
        attrs={
            "structure": body.name,
            "candidates": np.int64(plan.candidates),
            "cost_is": "price" if plan.request.prices else "pixels per second",
            "objective": plan.request.objective,
            "target_percent": json.dumps(plan.request.target_percent),
        },
    )
    cube = cube.assign(label_values({name: values[name] for name in VARIABLES}, VARIABLES))
    instead = [one.instead.field for one in options if one.instead]
    if not instead:
        return cube
    cube.attrs["goal"] = plan.request.goal
    return cube.assign(label_values({"shape_plan_error": instead}, OF_SOUND))


def _camera_rows(option: Option, plan: Plan) -> np.ndarray[Any, Any]:
    """Return azimuth and elevation in degrees, distance and focal length in m, position in m."""
    layout = option.layout
    azimuth = np.mod(np.degrees(layout[:, 0]) + 180, 360) - 180
    focal = layout[:, 3] * plan.request.sensor_width_mm / 1000
    return np.column_stack(
        [
            azimuth,
            np.degrees(layout[:, 1]),
            layout[:, 2],
            focal,
            camera_centres(option.scene, layout),
        ]
    )


def _outline(plan: Plan) -> np.ndarray[Any, Any]:
    """Return the structure's corners, or those of the box around its markers as one closed walk."""
    if plan.body.outline.size:
        return plan.body.outline
    low, high = plan.body.points.min(axis=1), plan.body.points.max(axis=1)
    bottom = [(0, 0), (1, 0), (1, 1), (0, 1)]
    # around the bottom, up, and around the top, down and up again at each other corner
    walk = [(*corner, 0) for corner in (*bottom, bottom[0])] + [(0, 0, 1)]
    walk += [(*corner, up) for corner in bottom[1:] for up in (1, 0, 1)] + [(0, 0, 1)]
    return low[:, None] + np.array(walk).T * (high - low)[:, None]
