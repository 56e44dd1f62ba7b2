"""The cameras of a plan as a table: where each stands, what it looks through, its pixels."""

from __future__ import annotations

import csv
import io

import xarray as xr

COLUMNS = (
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
    """The cameras of an option as CSV."""
    one = cube.isel(option=option)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
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
