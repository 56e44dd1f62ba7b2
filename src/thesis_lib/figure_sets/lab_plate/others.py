"""Other recordings of ``lab-plate``: the deflections that follow from each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.lab_plate.measured import at_maximum
from thesis_lib.figure_sets.lab_plate.parameters import PlateRecordings, Stand, stands_of
from thesis_lib.figure_sets.lab_plate.recordings import plate_rig
from thesis_lib.laboratory import direct
from thesis_lib.laboratory.another import again, of_every_setting, put_up_again, windowed
from thesis_lib.laboratory.direct import Seen
from thesis_lib.laboratory.recordings import kept
from thesis_lib.laboratory.rig import Rig
from thesis_lib.measure.fitting.harmonics import amplitude, deviation
from thesis_lib.vibration.structure import resonance

Films = dict[Stand, tuple[Rig, Seen]]


def film(study: PlateRecordings, number: int) -> xr.Dataset:
    """Recording `number` of every setting, see :func:`.another.of_every_setting`."""
    other = again(study, number)
    films = {mode: {s: _filmed(other, mode, s) for s in study.stands} for mode in study.modes}
    results = []
    for setting in study.settings():
        own = [_shape(study, setting, mode, films[mode]) for mode in study.modes]
        shapes, deviations = zip(*own, strict=True)
        results.append((np.array(shapes), np.array(deviations)))
    return of_every_setting(results)


def _filmed(study: PlateRecordings, mode: int, stand: Stand) -> tuple[Rig, Seen]:
    rig = windowed(put_up_again(plate_rig(study, study.seed, mode, [stand])))
    return rig, kept(direct.seen(rig)[0], study.frames)


def _shape(
    study: PlateRecordings, setting: Setting, mode: int, films: Films
) -> tuple[Array, Array]:
    """Deflections of the markers by the cameras of a setting, and their deviations, m."""
    rigs, found = zip(*(films[stand] for stand in stands_of(setting)), strict=True)
    rig = replace(rigs[0], stations=tuple(own.stations[0] for own in rigs))
    omega, exposure = resonance(study.plate, mode), study.exposure_ms / 1000
    fit = direct.fit_of(rig, list(found), omega, 1)
    noise = deviation(fit, omega, exposure)
    motion = np.where(np.isnan(noise), np.nan, amplitude(fit, omega, exposure))
    return at_maximum(study.plate, mode, motion), noise
