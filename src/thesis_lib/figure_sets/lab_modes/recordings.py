"""The rigs that render the beam."""

from __future__ import annotations

import numpy as np
import xarray as xr

from thesis_lib.facts import setups
from thesis_lib.figure_sets.lab_modes.parameters import BeamMotions, BeamRecordings
from thesis_lib.laboratory.recordings import film_rig, film_seed, record, settled
from thesis_lib.laboratory.rig import Rig
from thesis_lib.vibration.motion import Component
from thesis_lib.vibration.structure import resonance


def beam_rig(film: BeamMotions, seed: int, mode: int, rate: float) -> Rig:
    """The beam and its four cameras, for one mode and frame rate."""
    beam = setups.beam()
    peak = film.peaks_m[film.modes.index(mode)]
    hertz = resonance(beam, mode) / (2 * np.pi)
    phase = np.radians(film.torsion_phase_deg)
    components = (
        Component("bending", mode, hertz, peak),
        Component("torsion", 1, hertz, film.torsion_mm / 1000, float(phase)),
    )
    rig = film_rig(
        film,
        beam,
        film.directions_deg,
        film.distance_mm,
        film.width_px,
        rate,
        components,
        film_seed(seed, mode, rate),
    )
    offsets = np.zeros(len(rig.stations))
    if film.starts == "free":
        offsets = np.random.default_rng([seed, 6]).random(len(rig.stations))
    return settled(rig, offsets.tolist(), film.frames)


def beam_rigs(film: BeamMotions, seed: int) -> list[Rig]:
    """All recordings of the beam: mode after mode, rate after rate."""
    return [beam_rig(film, seed, mode, rate) for mode in film.modes for rate in film.frame_rates_hz]


def run(request: BeamRecordings) -> xr.Dataset:
    """Render and track everything, see :func:`~thesis_lib.laboratory.recordings.record`."""
    return record(beam_rigs(request, request.seed), request.frames)
