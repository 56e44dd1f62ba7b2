"""Recordings of fast vibrations without pictures: exact projections, and noise of a known size."""

import numpy as np

from thesis_lib.figure_sets.lab_modes import compute as beam_films
from thesis_lib.figure_sets.lab_plate import compute as plate_films
from thesis_lib.laboratory.experiment import join_replicates
from thesis_lib.laboratory.rig import EXPOSURE_SAMPLES
from thesis_lib.laboratory.tracking import TrackedCentres, frame_times, record_tracks, true_centres

NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # of an exposure, from −1 to 1


def look(sigma=0.0, seed=0):
    """What films a rig: markers where they are in the mean of the exposure, with noise in px."""

    def one(rig):
        found = []
        for number, station in enumerate(rig.stations):
            times = frame_times(rig, station)
            exposure = station.sensor.exposure * np.sqrt(1 - 1 / EXPOSURE_SAMPLES**2)
            seen = [true_centres(rig, station, times + node * exposure / 2) for node in NODES]
            centres = np.tensordot(WEIGHTS / 2, seen, axes=1)
            noise = np.random.default_rng([seed, rig.seed, number]).standard_normal(centres.shape)
            found.append(TrackedCentres(times, centres + sigma * noise))
        return found

    return one


def films(study, sigma=0.0, seed=0):
    """Return the replicates that a study of ``lab-modes`` or ``lab-plate`` needs."""
    if study.study == "modes":
        rigs_of, estimate = beam_films.rigs_of, beam_films.estimate_motions
    else:
        rigs_of, estimate = plate_films.rigs_of, plate_films.estimate_deflections
    replicates = []
    for number in range(study.trials + 1):
        rigs = rigs_of(study, number)
        data = record_tracks(rigs, study.frames, look(sigma, seed))
        replicates.append(data.merge(estimate(study, data, number)))
    return join_replicates(replicates, ("tracks",))
