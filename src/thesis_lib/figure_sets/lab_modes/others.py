"""Other recordings of ``lab-modes``: the motions that follow from each, in every way."""

from __future__ import annotations

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.figure_sets.lab_modes import spectra
from thesis_lib.figure_sets.lab_modes.methods import Recording, found_frequency, measured_motion
from thesis_lib.figure_sets.lab_modes.parameters import LabModes
from thesis_lib.figure_sets.lab_modes.recordings import beam_rig
from thesis_lib.laboratory import direct
from thesis_lib.laboratory.another import again, of_every_setting, put_up_again, windowed
from thesis_lib.laboratory.recordings import kept


def film(study: LabModes, number: int) -> xr.Dataset:
    """Recording `number` of every setting, see :func:`.another.of_every_setting`."""
    other = again(study, number)
    every = {
        (mode, rate): _motions(study, _filmed(other, mode, rate))
        for mode in study.modes
        for rate in study.frame_rates_hz
    }
    results = []
    for setting in study.settings():
        own = [every[mode, setting.value][setting.case] for mode in study.modes]
        motions, deviations = zip(*own, strict=True)
        results.append((np.array(motions), np.array(deviations)))
    return of_every_setting(results)


def _filmed(study: LabModes, mode: int, rate: float) -> Recording:
    rig = windowed(put_up_again(beam_rig(study, study.seed, mode, rate)))
    found = [kept(own, study.frames) for own in direct.seen(rig)]
    return Recording(rig, found, study.exposure_ms / 1000)


def _motions(study: LabModes, film: Recording) -> dict[str, tuple[ComplexArray, Array]]:
    """Motions of the markers and their deviations, m, by the way in which they are measured."""
    read = spectra.read_frequency(*film.steady, film.rate)
    found, _ = found_frequency(film, read, study.highest_hz)
    presumed = {"instant": film.frequency, "known": film.frequency, "read": read, "found": found}
    return {case: measured_motion(film, case, presumed[case])[:2] for case in study.cases}
