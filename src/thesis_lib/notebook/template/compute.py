"""Results of the figure set footprint."""

import numpy as np
import xarray as xr

from thesis_lib.vision.pinhole import ground_sample_distance, hemisphere_cameras

from .figure_set import Footprint

SIZE_PX = (1920, 1080)


def run(request: Footprint) -> xr.Dataset:
    """Return the length of a pixel on an object at each distance."""
    focal_px = request.focal_length_mm / request.sensor_width_mm * SIZE_PX[0]
    overhead = ([0.0], [np.pi / 2])
    lengths_mm = [
        1000 * ground_sample_distance(hemisphere_cameras(d / 1000, *overhead, focal_px, SIZE_PX))
        for d in request.distances_mm
    ]
    names = [f"pixel at {d:g} mm" for d in request.distances_mm]
    return xr.Dataset(
        {"value": ("quantity", lengths_mm), "unit": ("quantity", ["mm"] * len(names))},
        coords={"quantity": names, "distance": ("quantity", request.distances_mm, {"units": "mm"})},
    )
