"""Tables of the notebooks of chapter 5.

Their figures are those of all beams (:func:`thesis_lib.plotting.panels.beam_figure`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr


def _harmonic(cube: xr.Dataset) -> dict[str, Any]:
    """Return the last setting of the harmonic fit, and the drive-point mobilities."""
    part = cube.isel(setting=np.flatnonzero(cube["case"].values == "harmonic"), mode=0)
    if part.sizes["setting"] == 0:
        return {"last": None}
    last = part.isel(setting=-1)
    return {
        "last": last,
        "every_fourth": slice(None, None, 4),
        "found": complex(last["mobility_real"].item(), last["mobility_imag"].item()),
        "model": complex(*cube["mobility_reference"].values),
    }


TEXTS = {"harmonic": _harmonic}  # of the notebooks, from a cube
