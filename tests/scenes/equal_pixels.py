"""Recordings at equal pixels per second that nobody filmed: errors of a known size."""

import numpy as np
import xarray as xr

from thesis_lib.figure_sets.lab_equal_pixels.compute import marker_loss
from thesis_lib.figure_sets.lab_equal_pixels.recordings import VARIABLES
from thesis_lib.studies.variables import labelled
from thesis_lib.vibration.structure import deflection_shape


def equal_pixels(study, sigma=lambda kind: 1e-6 * kind.count, common=0.0, seed=0):
    """What filming would give if deflections had white noise of `sigma(kind)` and an error in m."""
    plate, kinds, trials = study.plate, study.filmed_kinds, study.trials + 1
    shape = deflection_shape(plate, 1, plate.markers, study.amplitude_mm / 1000)
    sizes = {"part": 2, "point": len(shape)}
    values = {
        name: np.full((len(kinds), trials, *(sizes[dim] for dim in one.dims)), 0.01)
        for name, one in VARIABLES.items()
    }
    for i, kind in enumerate(kinds):
        noise = np.random.default_rng([seed, i]).standard_normal((trials, 2, len(shape)))
        truth = np.stack([shape * (1 - marker_loss(study, kind)) + common, 0 * shape])
        values["deflection"][i] = truth + sigma(kind) * noise
        values["known_deflection"][i] = values["deflection"][i] + sigma(kind) / 10
        values["deviation"][i] = sigma(kind)
    values["missing"][:] = 0
    return xr.Dataset(labelled(values, VARIABLES, over=("rig", "trial")))
