"""Tables of the experiment's notebooks."""

from __future__ import annotations

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.web.markdown import markdown_table


def tracking_table(cube: xr.Dataset) -> Markdown:
    """How tracking fares at every width: missing, taken for another, and how exact the rest is."""
    rows = [
        [
            f"{width}×{round(width * 9 / 16)}",
            f"{missing:.1%}",
            "—" if np.isnan(wrong) else f"{wrong:.1%}",
            "—" if np.isnan(error) else f"{error:.3f}",
        ]
        for width, missing, wrong, error in zip(
            *(
                cube[f"tracked_{name}" if name == "width" else f"tracking_{name}"].values
                for name in ("width", "missing", "wrong", "error")
            ),
            strict=True,
        )
    ]
    header = [
        "frames",
        "missing",
        "of those found, off by more than 1 px",
        "rms error of the rest, px",
    ]
    note = "All marker images of all cameras and frames."
    if "shots_used" in cube:
        used = ", ".join(f"{int(n)}" for n in cube["shots_used"].values)
        note += f" Pictures of the board that calibration could use, by camera: {used}."
    return markdown_table(header, rows, note)


def harmonic_table(cube: xr.Dataset, case: str = "harmonic") -> Markdown:
    """Amplitude, phase and standard error of some markers, and the drive-point mobility."""
    part = cube.isel(setting=np.flatnonzero(cube["case"].values == case), mode=0)
    if part.sizes["setting"] == 0:
        return Markdown("The harmonic fit was not asked for.")
    last = part.isel(setting=-1)
    reference = cube["reference_deflection"].values[0] * 1000
    rows = [
        [
            f"{1000 * float(last['x'][i]):.1f}",
            f"{1000 * float(last['amplitude'][i]):.4f}",
            f"{1e6 * float(last['standard_error'][i]):.2f}",
            f"{abs(reference[i]):.4f}",
            f"{float(last['phase'][i]):.2f}",
        ]
        for i in (*range(0, last.sizes["point"], 4),)
    ]
    model = complex(*cube["mobility_reference"].values)
    found = complex(float(last["mobility_real"]), float(last["mobility_imag"]))
    note = (
        f"{last['label'].item()}. Drive-point mobility: {1000 * found.real:.3f} "
        f"{1000 * found.imag:+.3f}j mm/(N s), of the model {1000 * model.real:.3f} "
        f"{1000 * model.imag:+.3f}j: {100 * abs(found / model - 1):.2f} % apart."
    )
    header = ["x, mm", "amplitude, mm", "standard error, µm", "true, mm", "phase to the force, °"]
    return markdown_table(header, rows, note)
