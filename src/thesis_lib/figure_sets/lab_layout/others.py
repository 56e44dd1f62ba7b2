"""Other recordings of ``lab-elevation`` and ``lab-layout``: the deflections from each."""

from __future__ import annotations

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.lab_layout.fits import chosen
from thesis_lib.figure_sets.lab_layout.parameters import Layouts
from thesis_lib.figure_sets.lab_layout.recordings import rig_of, tracks
from thesis_lib.laboratory.another import again, of_every_setting, put_up_again
from thesis_lib.laboratory.direct import Seen, fit_of, times_of
from thesis_lib.laboratory.rig import Rig
from thesis_lib.measure.fitting.harmonics import Fitted, amplitude, deviation
from thesis_lib.measure.fitting.reconstruction import real_shape
from thesis_lib.vibration.motion import amplitudes


def film(study: Layouts, number: int) -> xr.Dataset:
    """Recording `number` of every setting, see :func:`.another.of_every_setting`."""
    films = {whole: _filmed(again(study, number), whole) for whole in study.filmed_settings()}
    return of_every_setting([_shape(study, setting, films) for setting in study.settings()])


def _filmed(study: Layouts, setting: Setting) -> tuple[Rig, Fitted | None]:
    rig = put_up_again(rig_of(study, setting))
    found = []
    for index, station in enumerate(rig.stations):
        centres, _ = tracks(rig, index, both=False)
        found.append(Seen(times_of(rig, station), centres, centres))
    try:
        return rig, fit_of(rig, found, 2 * np.pi * study.frequency_hz)
    except ValueError:  # too few markers at rest
        return rig, None


def _shape(
    study: Layouts, setting: Setting, films: dict[Setting, tuple[Rig, Fitted | None]]
) -> tuple[Array, Array]:
    """Deflections of the middle row by a setting's cameras, and their deviations, (1, n), m."""
    whole = study.recorded(setting)
    rig, fit = films[whole]
    own = chosen(fit, rig, [whole.directions_deg.index(each) for each in setting.directions_deg])
    row = rig.markers.middle_row
    if own is None:
        unknown = np.full((1, rig.markers.centres[0, row].size), np.nan)
        return unknown, unknown
    omega, exposure = 2 * np.pi * study.frequency_hz, study.exposure_ms / 1000
    truth = amplitudes(rig.motion, rig.markers.centres, study.frequency_hz)[row]
    shape = real_shape(amplitude(own, omega, exposure), float(np.angle(truth[-1])))
    return shape[None, row], deviation(own, omega, exposure)[None, row]
