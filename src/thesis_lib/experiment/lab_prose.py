"""What the book's page on faster vibrations and the plate includes, from their cubes."""

from __future__ import annotations

import numpy as np
import xarray as xr

from thesis_lib import figures
from thesis_lib.cubes import percent_text
from thesis_lib.experiment.lab_tables import neighbour_correlation
from thesis_lib.markdown import table


def modes_results(cube: xr.Dataset) -> str:
    """Median errors of the four ways, by mode and frame rate."""
    cases = list(dict.fromkeys(cube["case"].values.tolist()))
    rows = []
    for m, mode in enumerate(cube["mode"].values):
        for r, rate in enumerate(cube["frame_rate"].values):
            row = [str(mode), f"{rate:g}", f"{cube['alias_frequency'].values[m, r]:.1f}"]
            for case in cases:
                part = figures.select(cube, case, int(mode))
                drawn = part["mean_error"].transpose("setting", "trial").values[r, 1:]
                row.append(percent_text(float(np.median(drawn))))
            rows.append(row)
    header = ["mode", "frames per second", "shows at, Hz", *(f"*{case}*, %" for case in cases)]
    known = figures.select(cube, "known", int(cube["mode"].values[-1]))
    torsion, error = (
        [1e6 * float(known[name].values[i]) for i in (0, -1)]
        for name in ("torsion_standard_error", "bending_standard_error")
    )
    return table(header, rows) + (
        "\nMedian over the trials of the rms error, in % of the largest deflection. In mode "
        f"{cube['mode'].values[-1]} the standard errors of bending and torsion are {error[0]:.2f} "
        f"and {torsion[0]:.2f} µm with {known['label'].values[0]}, {error[1]:.2f} and "
        f"{torsion[1]:.2f} µm with {known['label'].values[-1]}, for as many frames.\n"
    )


def plate_results(cube: xr.Dataset) -> str:
    """First and last setting of each case in expectation, filmed and with whole pixels."""
    mode = int(cube["mode"].values[0])
    plane = str(cube["plane"].values[0])
    rows = []
    for case in dict.fromkeys(cube["case"].values.tolist()):
        part = figures.select(cube, case, mode)
        labels = part["label"].values
        drawn = part["mean_error"].transpose("setting", "trial").values[:, 1:]
        heard = part["plane_error"].sel(plane=plane).transpose("setting", "trial").values[:, 1:]
        pairs = (
            np.median(drawn, axis=1),
            np.median(heard, axis=1),
            part["rounded_error"].values,
            part["rounded_plane_error"].sel(plane=plane).values,
        )
        cells = [f"{percent_text(v[0])} → {percent_text(v[-1])}" for v in pairs]
        rows.append([case, f"{labels[0]} → {labels[-1]}", *cells])
    header = ["varied", "from → to", "deflection, %", f"pressure {plane}, %",
              "whole pixels: deflection, %", f"pressure {plane}, %"]  # fmt: skip
    filmed = cube["mean_error"].isel(trial=0) / cube["predicted_error"]
    fine = filmed.isel(setting=np.flatnonzero(cube["width_px"].values >= 640))
    return table(header, rows) + (
        f"\nMode {mode}: median over the trials, and what the law of rounding says of the same "
        "cameras with whole pixels. Over all modes, and settings with frames at least 640 pixels "
        f"wide, what was filmed has {float(fine.min()):.2f} to {float(fine.max()):.2f} times the "
        "error that the noise of the centres predicts, and the errors of neighbouring markers are "
        f"correlated by {neighbour_correlation(cube)}.\n"
    )
