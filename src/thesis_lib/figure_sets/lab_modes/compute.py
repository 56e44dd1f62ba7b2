"""The cube of ``lab-modes``, from the recordings of the beam."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.lab_modes import spectra
from thesis_lib.figure_sets.lab_modes.methods import (
    CYCLES,
    Recording,
    case_results,
    detuned_errors,
    found_frequency,
    recordings,
)
from thesis_lib.figure_sets.lab_modes.parameters import LabModes
from thesis_lib.measure.fitting import aliasing
from thesis_lib.studies.labels import VARIABLES, coordinates, drawn_by, filmed, of_settings
from thesis_lib.studies.variables import declared, labelled
from thesis_lib.vibration.structure import resonance
from thesis_lib.vibration.torsion import twist

ASIDE = 0.010  # m beside the axis at which a force of 1 N is asked what it twists
SETTLED = 0.01  # of the transient that is left when the vibration counts as steady


def run(study: LabModes, data: xr.Dataset, others: xr.Dataset | None = None) -> xr.Dataset:
    """The cube of ``lab-modes``, from the dataset of its recordings.

    `others` are what :func:`.lab_modes.others.film` makes of other recordings.
    """
    films = recordings(study, data)  # mode after mode, rate after rate
    settings = study.settings()
    rates = study.frame_rates_hz
    reads = [[_read(film) for film in of_mode] for of_mode in films]
    founds = [
        [found_frequency(film, read, study.highest_hz) for film, read in zip(*pair, strict=True)]
        for pair in zip(films, reads, strict=True)
    ]
    results: list[dict[str, Any]] = []
    again = None if others is None else _motions(study, others)
    for setting in settings:
        r = rates.index(setting.value)
        presumed = {
            "instant": [of_mode[r].frequency for of_mode in films],
            "known": [of_mode[r].frequency for of_mode in films],
            "read": [of_mode[r] for of_mode in reads],
            "found": [of_mode[r][0] for of_mode in founds],
        }[setting.case]
        each = [
            case_results(
                of_mode[r],
                setting.case,
                frequency,
                study.trials,
                study.seed,
                study.starts == "together",
                None if again is None else again[setting.case, setting.value][:, m],
            )
            for m, (of_mode, frequency) in enumerate(zip(films, presumed, strict=True))
        ]
        results.append({name: np.array([one[name] for one in each]) for name in each[0]})
    cube = _frame(study, films, settings, others)
    focal = study.focal_length_mm / study.sensor_width_mm * study.width_px
    for result in results:
        result["in_view"] = 1.0  # others are refused
        result["ground_sample_distance"] = study.distance_mm / 1000 / focal
    cube = cube.assign(of_settings(settings, results, _VARIABLES))
    return _with_rates(cube, films, reads, founds)


_VARIABLES = VARIABLES | declared("""
    predicted_error(mode) [percent] rms error by the noise of the centres alone
    missing(mode, trial) [1] share of markers that no two cameras see
    quadrature_deflection(mode, point) [m] deflection a quarter of a period before, as filmed
    centre_scatter(mode) [px] scatter of the centres about the harmonic
    signal_over_noise(mode) [1] largest deflection over the noise of one frame's deflections
    frequency_used(mode) [Hz] frequency that the shape was made with
    bending_amplitude(mode, trial) [m] amplitude of bending at the tip
    torsion_amplitude(mode, trial) [m] amplitude of torsion at the tip's edges
    torsion_phase(mode, trial) [degree] phase by which torsion is ahead of bending
    bending_standard_error(mode) [m] standard error of bending's amplitude
    torsion_standard_error(mode) [m] standard error of torsion's amplitude
""")

_TRUTH = declared("""
    reference_deflection(mode, point) [m] true deflection at the maximum of bending
    reference_quadrature(mode, point) [m] true deflection a quarter of a period before
    bending_reference(mode) [m] true amplitude of bending at the tip
    torsion_reference() [m] true amplitude of torsion at the tip's edges
    torsion_of_force(mode) [m] deflection of the tip's edges by 1 N that acts 10 mm beside the axis
    exposure_loss(mode) [1] share of an amplitude that the exposure takes
    settling_time(mode) [s] time until a transient has fallen to a hundredth
""")
_RATES = declared("""
    frame_rate(frame_rate) [Hz] frames per second
    cycles(cycles) [1] periods in a recording by which a frequency is wrong
    alias_frequency(mode, frame_rate) [Hz] where the vibration shows below half of the frame rate
    read_frequency(mode, frame_rate) [Hz] the frequency that the tracks show
    found_frequency(mode, frame_rate) [Hz] the frequency at which the cameras agree
    candidate_frequency(mode, frame_rate, candidate) [Hz] frequencies that these frames cannot tell
        apart
    misfit(mode, frame_rate, candidate) [1] how far the cameras disagree, over what noise makes them
    spectrum_frequency(frame_rate, bin) [Hz] trial frequency
    spectrum(mode, frame_rate, bin) [1] share of the scatter that a harmonic explains
    detuned_error(mode, frame_rate, cycles) [percent] mean error if the known frequency is wrong
    detuned_prediction(mode, cycles) [percent] mean error by the loss of amplitude alone
""")


def _read(film: Recording) -> float:
    return spectra.read_frequency(*film.steady, film.rate)


def _motions(study: LabModes, others: xr.Dataset) -> dict[tuple[str, float], ComplexArray]:
    """Motions (recordings, modes, markers) of other recordings, by case and frame rate."""
    motions = others["deflection"].values + 1j * others["quadrature"].values
    keys = [(setting.case, setting.value) for setting in study.others.settings()]
    return {key: motions[:, number] for number, key in enumerate(keys)}


def _frame(
    study: LabModes,
    films: list[list[Recording]],
    settings: list[Any],
    others: xr.Dataset | None,
) -> xr.Dataset:
    """Coordinates, and what is true."""
    beam = setups.beam()
    hertz = [of_mode[0].frequency for of_mode in films]
    drawn = "draw of starts and noise, 0 for what was rendered"
    coords = filmed(coordinates(study, study.modes, beam, settings), hertz, drawn, others)
    x, y = films[0][0].rig.markers.centres
    for name, values in (("x", x), ("y", y)):
        coords[name] = ("point", values, coords[name][2])
    truth = np.array([of_mode[0].truth for of_mode in films])
    natural = [resonance(beam, mode) for mode in study.modes]
    losses = [1 - np.sinc(of_mode[0].frequency * of_mode[0].exposure) for of_mode in films]
    values = {
        "reference_deflection": truth.real,
        "reference_quadrature": truth.imag,
        "bending_reference": study.peaks_m,
        "torsion_reference": np.float64(study.torsion_mm / 1000),
        "torsion_of_force": [twist(beam, ASIDE, w) for w in natural],
        "exposure_loss": losses,
        "settling_time": [-np.log(SETTLED) / (beam.damping * w) for w in natural],
    }
    return xr.Dataset(coords=coords, attrs=drawn_by(others)).assign(labelled(values, _TRUTH))


def _with_rates(
    cube: xr.Dataset,
    films: list[list[Recording]],
    reads: list[list[float]],
    founds: list[list[tuple[float, Array]]],
) -> xr.Dataset:
    """A cube with what belongs to a mode and a frame rate, whatever is made of the tracks."""
    rates = [film.rate for film in films[0]]
    frames = len(films[0][0].steady[0][0])
    grids = [aliasing.scan(rate, frames) for rate in rates]
    shown = [
        [spectra.explained(grid, *film.steady) for grid, film in zip(grids, of_mode, strict=True)]
        for of_mode in films
    ]
    most = max(table.shape[1] for of_mode in founds for _, table in of_mode)
    tables = np.full((len(films), len(rates), 2, most), np.nan)
    for m, of_mode in enumerate(founds):
        for r, (_, table) in enumerate(of_mode):
            tables[m, r, :, : table.shape[1]] = table
    aliases = [[aliasing.alias(film.frequency, film.rate) for film in one] for one in films]
    values = {
        "frame_rate": rates,
        "cycles": list(CYCLES),
        "alias_frequency": np.array(aliases, float),
        "read_frequency": reads,
        "found_frequency": [[frequency for frequency, _ in one] for one in founds],
        "candidate_frequency": tables[:, :, 0],
        "misfit": tables[:, :, 1],
        "spectrum_frequency": grids,
        "spectrum": shown,
        "detuned_error": [[detuned_errors(film) for film in one] for one in films],
        "detuned_prediction": _detuned(films, frames),
    }
    return cube.assign(labelled(values, _RATES))


def _detuned(films: list[list[Recording]], frames: int) -> Array:
    shapes = [of_mode[0].truth.real for of_mode in films]
    rms = [100 * np.sqrt(np.mean(shape**2)) / np.abs(shape).max() for shape in shapes]
    return np.outer(rms, aliasing.detuning_loss(CYCLES, frames))
