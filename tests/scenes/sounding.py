"""Recordings of structures that sound, which nobody rendered: errors of a known size."""

import numpy as np
import xarray as xr

from thesis_lib.acoustics.sources import AIR
from thesis_lib.figure_sets.lab_radiation.recordings import ROWS, VARIABLES, most_markers
from thesis_lib.figure_sets.lab_radiation.sound import Heard
from thesis_lib.figure_sets.lab_radiation.structures import driven
from thesis_lib.studies.variables import labelled


def sounding(study, sigma=3e-6, common=1e-3, stated=1.0, seed=0):
    """What rendering would give if markers had white noise of `sigma` in m, and all a wrong size.

    That is drawn with a relative standard deviation of `common`; what is stated of either is
    `stated` times as large.
    """
    cases, trials = study.recordings.cases, study.recordings.trials + 1
    sizes = {"point": most_markers(study.recordings), "row": ROWS}
    values = {
        name: np.full((len(cases), trials, *(sizes[dim] for dim in one.dims)), np.nan)
        for name, one in VARIABLES.items()
    }
    for c, case in enumerate(cases):
        shape = Heard(driven(case), AIR).without_noise(study.amplitude_mm / 1000)
        n, draw = len(shape), np.random.default_rng([seed, c])
        noise = sigma * draw.standard_normal((2, trials, n))
        wrong = 1 + common * draw.standard_normal((trials, 1))
        found = wrong * shape + noise[0] + 1j * noise[1]
        values["amplitude_real"][c, :, :n] = found.real
        values["amplitude_imag"][c, :, :n] = found.imag
        values["scatter"][c, :, :n] = stated * sigma
        rows = stated * common * np.stack([shape, 0 * shape])
        values["shared_real"][c, :, :, :n] = rows.real
        values["shared_imag"][c, :, :, :n] = rows.imag
    values["missing"][:], values["centre_scatter"][:] = 0.0, 0.011
    return xr.Dataset(labelled(values, VARIABLES, over=("case", "trial"))).astype("float32")
