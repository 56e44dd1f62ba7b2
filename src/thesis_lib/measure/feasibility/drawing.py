"""Where the cameras of a manifest stand, and how exactly they would measure each marker."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.measure.feasibility.assess import CENTRE_NOISE_PX
from thesis_lib.measure.feasibility.outlook import errors_of, sight_of
from thesis_lib.measure.recordings.manifest import ManifestError
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report.figures import cameras
from thesis_lib.plotting.style import in_style, subplots


def drawings(manifest: Manifest) -> dict[str, Figure]:
    """The cameras from above and from the side, and a map of standard errors, by name.

    Raises
    ------
    ManifestError
        If fewer than two cameras have a lens and a place.
    """
    with np.errstate(all="ignore"):  # what is not given is NaN
        sight = sight_of(manifest, 0.0)
        _, fit, _ = errors_of(manifest, sight, np.nan, CENTRE_NOISE_PX)
    there = sight.located
    if there.sum() < 2:
        raise ManifestError(
            f"--out: given {int(there.sum())} cameras with focal_length_mm, sensor_width_mm, "
            "distance_mm, azimuth_deg and elevation_deg, allowed: two or more, to draw them"
        )
    placed = xr.Dataset(
        {
            "camera_centre": (("camera", "axis"), sight.optics[there, 2:3] / 1000
                              * sight.directions[there]),
            "rest_position": (("axis", "marker"), sight.points),
        },
        {"camera": [c.name for c, known in zip(manifest.cameras, there, strict=True) if known]},
    )  # fmt: skip
    return {"cameras": cameras(placed, manifest), "errors": _errors(manifest, fit)}


def _errors(manifest: Manifest, error: Array) -> Figure:
    """Standard errors of the harmonic fit over the structure, mm."""
    length, width = manifest.structure.length_mm, manifest.structure.width_mm
    x, y = 1000 * manifest.structure.marker_points
    with in_style():
        figure, axes = subplots(
            figsize=(7.6, min(7.6 * width / length + 1.5, 6)), layout="constrained"
        )
        drawn = axes.scatter(x, y, c=error, s=24, cmap="viridis")
        axes.set(
            xlim=(0, length), ylim=(0, width), aspect="equal", xlabel="x in mm", ylabel="y in mm",
            title="standard error of the deflection by the harmonic fit",
        )  # fmt: skip
        figure.colorbar(drawn, ax=axes, label="mm", orientation="horizontal", fraction=0.1)
    return figure
