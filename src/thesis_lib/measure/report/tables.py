"""Tables of the report."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.measure.fitting.models import rms


def cameras(data: xr.Dataset) -> pd.DataFrame:
    """Lens and place of each camera, with standard deviations."""
    centre = 1e3 * data["camera_centre"].values
    distance = np.linalg.norm(centre, axis=1)
    return pd.DataFrame(
        {
            "camera": data["camera"].values,
            "focal length in px": texts(data["K"].values[:, 0, 0], ".2f"),
            "± px": texts(data["focal_deviation"].values, ".2g"),
            "k₁": texts(data["distortion"].values[:, 0], ".4f"),
            "board pictures": data["shots_used"].values,
            "rms alone in px": texts(data["single_rms"].values, ".3f"),
            "distance in mm": texts(distance, ".1f"),
            "± mm": texts(1e3 * data["centre_deviation"].values, ".2g"),
            "azimuth in °": texts(np.degrees(np.arctan2(centre[:, 0], centre[:, 1])), ".1f"),
            "elevation in °": texts(np.degrees(np.arcsin(centre[:, 2] / distance)), ".1f"),
        }
    )


def tracking(data: xr.Dataset) -> pd.DataFrame:
    """What each camera saw of the markers."""
    return pd.DataFrame(
        {
            "camera": data["camera"].values,
            "frames": data["frames"].values,
            "lost in %": texts(100 * data["missing"].mean("marker").values, ".2f"),
            "markers never found": (data["missing"].values > 0.999).sum(axis=1),
            "scatter of centres in px": texts(map(rms, data["centre_scatter"].values), ".3f"),
            "start in ms": texts(1e3 * data["delay"].values, "+.3f"),
        }
    )


def texts(values: Iterable[float], form: str) -> list[str]:
    """Numbers as texts of a form; a dash for one that is unknown."""
    return ["—" if np.isnan(value) else format(float(value), form) for value in values]
