"""Recordings of fast vibrations without pictures: exact projections, and noise of a known size."""

import numpy as np

from thesis_lib.figure_sets.lab_modes import compute as beam_films
from thesis_lib.figure_sets.lab_plate import compute as plate_films
from thesis_lib.laboratory import replicates as lab_films
from thesis_lib.laboratory.experiment import join_replicates
from thesis_lib.laboratory.tracking import TrackedCentres
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.vision import lens

NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # of an exposure, from −1 to 1


def look(sigma=0.0, seed=0):
    """What films a rig: markers where they are in the mean of the exposure, with noise in px."""

    def one(rig):
        found = []
        for number, station in enumerate(rig.stations):
            times = station.start + np.arange(int(rig.duration * station.frame_rate)) / (
                station.frame_rate
            )
            exposure = station.sensor.exposure * np.sqrt(1 - 1 / lab_films.EXPOSURE_SAMPLES**2)
            points = rig.markers.centres

            def images(at, points=points, camera=station.camera, rig=rig):
                world = on_surface(
                    rig.markers.extent, points[:, None], rig.motion.deflection(points, at)
                )
                return lens.project_points(camera, world).swapaxes(0, 1)

            truth = images(times)
            seen = [images(times + node * exposure / 2) for node in NODES]
            centres = np.tensordot(WEIGHTS / 2, seen, axes=1)
            rng = np.random.default_rng([seed, rig.seed, number])
            found.append(
                TrackedCentres(times, centres + sigma * rng.standard_normal(truth.shape), truth)
            )
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
        data = lab_films.record_tracks(rigs, study.frames, look(sigma, seed))[["tracks"]]
        replicates.append(data.merge(estimate(study, data, number)))
    return join_replicates(replicates, ("tracks",))
