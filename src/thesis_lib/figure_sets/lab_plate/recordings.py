"""The rigs that render the plate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from thesis_lib.figure_sets.lab_plate.parameters import PlateRecordings, Plates, Stand
from thesis_lib.laboratory.recordings import film_rig, film_seed, record, settled
from thesis_lib.laboratory.rig import Rig
from thesis_lib.vibration.motion import Component
from thesis_lib.vibration.structure import resonance


def plate_rig(film: Plates, seed: int, mode: int, stands: Sequence[Stand]) -> Rig:
    """The plate and some cameras, each filming as it would by itself, for one mode."""
    plate = film.plate
    hertz = resonance(plate, mode) / (2 * np.pi)
    components = (Component("bending", mode, hertz, film.peaks_m[film.modes.index(mode)]),)
    rigs, offsets = [], []
    for stand in stands:
        direction, distance, width = stand
        own = film_seed(seed, mode, stand)
        rigs.append(
            film_rig(film, plate, [direction], distance, width, film.frame_rate_hz, components, own)
        )
        offsets.append(float(np.random.default_rng([own, 6]).random()))
    together = replace(rigs[0], stations=tuple(rig.stations[0] for rig in rigs))
    return settled(together, offsets, film.frames)


def plate_rigs(film: Plates, seed: int) -> list[Rig]:
    """All recordings of the plate, one camera each: mode after mode, stand after stand."""
    return [plate_rig(film, seed, mode, [stand]) for mode in film.modes for stand in film.stands]


def run(request: PlateRecordings) -> xr.Dataset:
    """Render and track everything, see :func:`~thesis_lib.laboratory.recordings.record`."""
    return record(plate_rigs(request, request.seed), request.frames)
