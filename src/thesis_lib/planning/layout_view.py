"""The cameras of plans in a picture that can be turned, in any page and without a kernel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.planning.camera_table import camera_table
from thesis_lib.plotting.style import COLORS
from thesis_lib.studies.cubes import percent_text
from thesis_lib.web.fragment import VIEWER_CSS, joined, static_html

WITHOUT = "This picture needs JavaScript to be turned; the ones beside it show the same cameras."


def layout_view(plans: Sequence[tuple[str, xr.Dataset, int]]) -> str:
    """Plans as a self-contained HTML fragment.

    Parameters
    ----------
    plans : sequence of (str, xarray.Dataset, int)
        Name, options with their cameras, as in a plan's cube, and which option is shown first.
    """
    data = {"plans": [_plan(*one) for one in plans], "tints": list(COLORS)}
    return static_html(joined("layout"), VIEWER_CSS, {"data": data}, WITHOUT)


def _plan(name: str, cube: xr.Dataset, chosen: int) -> dict[str, Any]:
    outline = _finite(cube["outline"].values)
    return {
        "name": name,
        "chosen": chosen,
        "centre": ((outline.max(axis=0) + outline.min(axis=0)) / 2).tolist(),
        "outline": outline.tolist(),
        "markers": cube["marker"].values.tolist() if "marker" in cube else [],
        "options": [_option(cube, i) for i in range(cube.sizes["option"])],
    }


def _option(cube: xr.Dataset, index: int) -> dict[str, Any]:
    one = cube.isel(option=index)
    label = f"{int(one['n_cameras'])} of {int(one['width_px'])}×{int(one['height_px'])} px"
    error, simulated = (
        percent_text(float(one[f"{name}_error"].max())) for name in ("predicted", "simulated")
    )
    errors = f"{error} % predicted, {simulated} % simulated, in the worst mode."
    return {
        "label": label,
        "words": f"{label} at {float(one['frame_rate']):g} Hz: {errors}",
        "table": camera_table(cube, index),
    }


def _finite(points: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Points (points, 3) without the rows that only fill up."""
    return points[np.isfinite(points).all(axis=1)]
