"""The cube of ``lab-modes``, from the recordings of the beam."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
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
from thesis_lib.studies.labels import VARIABLES, add_cameras, coordinates
from thesis_lib.vibration.structure import resonance
from thesis_lib.vibration.torsion import twist

ASIDE = 0.010  # m beside the axis at which a force of 1 N is asked what it twists
SETTLED = 0.01  # of the transient that is left when the vibration counts as steady


def run(study: LabModes, data: xr.Dataset) -> xr.Dataset:
    """The cube of ``lab-modes``.

    Parameters
    ----------
    study : LabModes
        Validated parameters.
    data : xarray.Dataset
        The recordings, as :func:`~thesis_lib.figure_sets.lab_modes.recordings.run` gives them.
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
    for setting in settings:
        r = rates.index(setting.value)
        presumed = {
            "instant": [of_mode[r].frequency for of_mode in films],
            "known": [of_mode[r].frequency for of_mode in films],
            "read": [of_mode[r] for of_mode in reads],
            "found": [of_mode[r][0] for of_mode in founds],
        }[setting.case]
        each = [
            case_results(of_mode[r], setting.case, frequency, study.trials, study.seed,
                         study.starts == "together")
            for of_mode, frequency in zip(films, presumed, strict=True)
        ]  # fmt: skip
        results.append({name: np.array([one[name] for one in each]) for name in each[0]})
    cube = _frame(study, films, settings)
    focal = study.focal_length_mm / study.sensor_width_mm * study.width_px
    for result in results:
        result["in_view"] = 1.0  # others are refused
        result["ground_sample_distance"] = study.distance_mm / 1000 / focal
    for name, (dims, dtype, units, long_name) in _VARIABLES.items():
        values = np.array([result[name] for result in results]).astype(dtype)
        cube[name] = (("setting", *dims), values, {"units": units, "long_name": long_name})
    add_cameras(cube, settings)
    _add_rates(cube, films, reads, founds)
    return cube


_VARIABLES: dict[str, tuple[tuple[str, ...], str, str, str]] = {
    **VARIABLES,
    "predicted_error": (
        ("mode",), "float64", "percent", "rms error by the noise of the centres alone"),
    "missing": (("mode", "trial"), "float64", "1", "share of markers that no two cameras see"),
    "quadrature_deflection": (
        ("mode", "point"), "float64", "m", "deflection a quarter of a period before, as filmed"),
    "centre_scatter": (("mode",), "float64", "px", "scatter of the centres about the harmonic"),
    "signal_over_noise": (
        ("mode",), "float64", "1", "largest deflection over the noise of one frame's deflections"),
    "frequency_used": (("mode",), "float64", "Hz", "frequency that the shape was made with"),
    "bending_amplitude": (("mode", "trial"), "float64", "m", "amplitude of bending at the tip"),
    "torsion_amplitude": (
        ("mode", "trial"), "float64", "m", "amplitude of torsion at the tip's edges"),
    "torsion_phase": (
        ("mode", "trial"), "float64", "degree", "phase by which torsion is ahead of bending"),
    "bending_standard_error": (("mode",), "float64", "m", "standard error of bending's amplitude"),
    "torsion_standard_error": (("mode",), "float64", "m", "standard error of torsion's amplitude"),
}  # fmt: skip


def _read(film: Recording) -> float:
    return spectra.read_frequency(*film.steady, film.rate)


def _frame(study: LabModes, films: list[list[Recording]], settings: list[Any]) -> xr.Dataset:
    """Coordinates, and what is true."""
    beam = setups.beam()
    coords = coordinates(study, study.modes, beam, settings)
    x, y = films[0][0].rig.markers.centres
    for name, values in (("x", x), ("y", y)):
        coords[name] = ("point", values, coords[name][2])
    cube = xr.Dataset(coords=coords)
    cube["frequency"] = ("mode", [of_mode[0].frequency for of_mode in films],
                         {"long_name": "frequency of the vibration", "units": "Hz"})  # fmt: skip
    cube["trial"].attrs["long_name"] = "draw of starts and noise, 0 for what was filmed"
    truth = np.array([of_mode[0].truth for of_mode in films])
    natural = [resonance(beam, mode) for mode in study.modes]
    for name, dims, values, units, text in (
        ("reference_deflection", ("mode", "point"), truth.real, "m",
         "true deflection at the maximum of bending"),
        ("reference_quadrature", ("mode", "point"), truth.imag, "m",
         "true deflection a quarter of a period before"),
        ("bending_reference", ("mode",), np.array(study.peaks_m), "m",
         "true amplitude of bending at the tip"),
        ("torsion_reference", (), np.float64(study.torsion_mm / 1000), "m",
         "true amplitude of torsion at the tip's edges"),
        ("torsion_of_force", ("mode",), np.array([twist(beam, ASIDE, w) for w in natural]), "m",
         "deflection of the tip's edges by 1 N that acts 10 mm beside the axis"),
        ("exposure_loss", ("mode",),
         1 - np.array([np.sinc(of_mode[0].frequency * of_mode[0].exposure) for of_mode in films]),
         "1", "share of an amplitude that the exposure takes"),
        ("settling_time", ("mode",),
         np.array([-np.log(SETTLED) / (beam.damping * w) for w in natural]), "s",
         "time until a transient has fallen to a hundredth"),
    ):  # fmt: skip
        cube[name] = (dims, values, {"units": units, "long_name": text})
    return cube


def _add_rates(
    cube: xr.Dataset,
    films: list[list[Recording]],
    reads: list[list[float]],
    founds: list[list[tuple[float, Array]]],
) -> None:
    """What belongs to a mode and a frame rate, whatever is made of the tracks."""
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
    both = ("mode", "frame_rate")
    cube["frame_rate"] = ("frame_rate", rates, {"units": "Hz", "long_name": "frames per second"})
    cube["cycles"] = ("cycles", list(CYCLES), {"units": "1"})
    cube["cycles"].attrs["long_name"] = "periods in a recording by which a frequency is wrong"
    for name, dims, values, units, text in (
        ("alias_frequency", both, np.array(aliases, float), "Hz",
         "where the vibration shows below half of the frame rate"),
        ("read_frequency", both, np.array(reads), "Hz", "the frequency that the tracks show"),
        ("found_frequency", both, np.array([[f for f, _ in one] for one in founds]), "Hz",
         "the frequency at which the cameras agree"),
        ("candidate_frequency", (*both, "candidate"), tables[:, :, 0], "Hz",
         "frequencies that these frames cannot tell apart"),
        ("misfit", (*both, "candidate"), tables[:, :, 1], "1",
         "how far the cameras disagree, over what noise makes them"),
        ("spectrum_frequency", ("frame_rate", "bin"), np.array(grids), "Hz", "trial frequency"),
        ("spectrum", (*both, "bin"), np.array(shown), "1",
         "share of the scatter that a harmonic explains"),
        ("detuned_error", (*both, "cycles"),
         np.array([[detuned_errors(film) for film in one] for one in films]), "percent",
         "mean error if the known frequency is wrong"),
        ("detuned_prediction", ("mode", "cycles"), _detuned(films, frames), "percent",
         "mean error by the loss of amplitude alone"),
    ):  # fmt: skip
        cube[name] = (dims, values, {"units": units, "long_name": text})


def _detuned(films: list[list[Recording]], frames: int) -> Array:
    shapes = [of_mode[0].truth.real for of_mode in films]
    rms = [100 * np.sqrt(np.mean(shape**2)) / np.abs(shape).max() for shape in shapes]
    return np.outer(rms, aliasing.detuning_loss(CYCLES, frames))
