"""Viewers of a report: the measured shape and the sound field in motion, without a network."""

from __future__ import annotations

import numpy as np
import xarray as xr

from thesis_lib.measure.exchange.mesh import marker_edges, marker_faces
from thesis_lib.measure.radiation.radiated import complex_of
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.plotting.style import DIVERGING_COLORS
from thesis_lib.plotting.viewer_data import encode_field
from thesis_lib.web.fragment import VIEWER_CSS, join_modules, read_asset, static_html

_NO_SHAPE = "This figure needs JavaScript to move; the figure below shows the same shape."
_NO_SOUND = "This figure needs JavaScript; radiated.nc has the same field."


def view_shape(data: xr.Dataset, extent: tuple[float, float]) -> str:
    """Return the markers with a result as a moving surface: a self-contained HTML fragment.

    Parameters
    ----------
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.fitting.result.shape_result` returns. The image begins at
        the maximum of the deflection.
    extent : tuple of float
        Length and width of the structure in m.
    """
    turned = data["deflection"].values + 1j * data["quadrature"].values
    known = np.isfinite(turned)
    x, y = data["x"].values[known], data["y"].values[known]
    long, wide = (1e3 * side / 2 for side in extent)
    state = {
        "points": np.column_stack([1e3 * x - long, 1e3 * y - wide]).tolist(),
        "real": (1e3 * turned.real[known]).tolist(),
        "imag": (1e3 * turned.imag[known]).tolist(),
        "error": (1e3 * np.nan_to_num(data["standard_error"].values[known])).tolist(),
        "faces": marker_faces(x, y).tolist(),
        "edges": marker_edges(x, y).tolist(),
        "frequency": float(data["frequency"]),
        "colormap": list(DIVERGING_COLORS),
        "outline": [[-long, -wide], [long, -wide], [long, wide], [-long, wide]],
    }
    css = VIEWER_CSS + read_asset("measured.css")
    return static_html(join_modules("measured"), css, {"data": state}, _NO_SHAPE)


def view_sound(one: xr.Dataset, manifest: Manifest) -> str:
    """Return the sound field of one tone in motion: a self-contained HTML fragment."""
    u, z = 1000 * one["u"].values, 1000 * one["z"].values
    field = complex_of(one, "field")
    names = [str(name) for name in one["plane"].values]
    halves = {"X": manifest.structure.length_mm / 2, "Y": manifest.structure.width_mm / 2}
    share = float(np.sqrt(np.mean(one["field_error"].values ** 2)) / np.abs(field).max())
    extent = {
        "u_mm": [float(u[0]), float(u[-1])],
        "z_mm": [float(z[0]), float(z[-1])],
        "shape": [len(u), len(z)],
    }
    state = {
        "planes": [{"name": name, **extent} for name in names],
        "fields": [encode_field(part) for part in field],
        "halves": [halves[name[0]] for name in names],
        "frequency": float(one["frequency"]),
        "colormap": list(DIVERGING_COLORS),
        "words": f"Sound pressure at {float(one['frequency']):.4g} Hz above the structure in a "
        "rigid wall, in two planes through its centre. Its standard error is "
        f"{100 * share:.2g} % of the largest pressure (rms).",
    }
    return static_html(join_modules("radiated"), VIEWER_CSS, {"data": state}, _NO_SOUND)
