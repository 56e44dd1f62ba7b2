"""Recordings from any place without pictures: exact centres, and noise of a known size."""

import numpy as np

from thesis_lib.figure_sets.lab_layout import recordings as film
from thesis_lib.laboratory.direct import times_of, true_centres


def layouts(study, sigma=0.0, seed=0, lost=()):
    """What filming would give if centres were exact but for white noise of `sigma` px.

    `lost` are numbers of recordings in which the markers are not found.
    """
    rigs = [film.rig_of(study, recording) for recording in study.filmed_settings()]

    def of(job):
        recording, camera = job
        rig = rigs[recording]
        station = rig.stations[camera]
        times = times_of(rig, station)
        truth = true_centres(rig, station, times)
        if recording in lost:
            return np.full((2, *truth.shape), np.nan)
        rng = np.random.default_rng([seed, camera])
        still = (times < rig.motion.start) | (times >= rig.motion.steady)
        quiet = np.where(still[:, None, None], truth, np.nan)
        return truth + sigma * rng.standard_normal(truth.shape), quiet

    return film.dataset(rigs, of)
