"""The measured shape in motion, to be turned, in a page that loads nothing."""

from __future__ import annotations

import numpy as np
import xarray as xr

from thesis_lib.measure.exchange.mesh import edges, faces
from thesis_lib.plotting.style import DIVERGING
from thesis_lib.web.fragment import VIEWER_CSS, asset, joined, static_html

WITHOUT = "This picture needs JavaScript to move; the figure below shows the same shape."


def shape_view(data: xr.Dataset, extent: tuple[float, float]) -> str:
    """The markers with a result as a moving surface: a self-contained HTML fragment.

    Parameters
    ----------
    data : xarray.Dataset
        What :func:`~thesis_lib.measure.fitting.result.result` returns. The picture begins at the
        maximum of the deflection.
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
        "faces": faces(x, y).tolist(),
        "edges": edges(x, y).tolist(),
        "frequency": float(data["frequency"]),
        "colormap": list(DIVERGING),
        "outline": [[-long, -wide], [long, -wide], [long, wide], [-long, wide]],
    }
    css = VIEWER_CSS + asset("measured.css")
    return static_html(joined("measured"), css, {"data": state}, WITHOUT)
