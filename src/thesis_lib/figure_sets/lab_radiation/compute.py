"""The cube of ``lab-radiation``: the sound of every recording, with its error and the stated one.

Each recording has the power, the efficiency and the field on a plane by its own amplitudes and
their covariance, as :mod:`thesis_lib.measure.radiation.radiated` has them. The truth is the sound
of the true motion by the same law of radiation, on a finer grid; that law is tested against closed
forms.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy.stats import chi2

from thesis_lib.acoustics.estimates import Amplitudes, circular
from thesis_lib.acoustics.sources import Medium
from thesis_lib.arrays import Array, ComplexArray, Image
from thesis_lib.figure_sets.lab_radiation import tap
from thesis_lib.figure_sets.lab_radiation.parameters import LabRadiation
from thesis_lib.figure_sets.lab_radiation.recordings import rig_of
from thesis_lib.figure_sets.lab_radiation.sound import PLANE, Heard, Truth, truth, with_grid
from thesis_lib.figure_sets.lab_radiation.structures import driven
from thesis_lib.laboratory.outlined import OutlinedView, cropped
from thesis_lib.measure.radiation.between import spacing
from thesis_lib.studies.variables import declared, labelled

TWICE = 2.0  # standard errors that 95.45 % of the errors should be within
BAND = (0.05, 0.95)
GRIDS = ((5, 4), (6, 4), (7, 5), (8, 6), (10, 7), (12, 8), (14, 9))
QUANTITIES = ("power", "efficiency")
_VARIABLES = declared("""
    power(structure, trial) [W] sound power as measured
    power_error(structure, trial) [W] its stated standard error
    true_power(structure) [W] sound power of the true motion
    efficiency(structure, trial) [1] radiation efficiency as measured
    efficiency_error(structure, trial) [1] its stated standard error
    true_efficiency(structure) [1] radiation efficiency of the true motion
    shape_error(structure, trial) [percent] rms error of what markers show, over the
        largest deflection
    field_error(structure, trial) [percent] rms error of the pressure over the plane, over its
        largest true size
    field_stated(structure, trial) [percent] the same by the stated errors
    unexplained(structure, trial) [1] what the fitted modes leave of the markers' motion, over what
        errors make of it
    missing(structure, trial) [1] share of the marker images that are missing
    centre_scatter(structure, trial) [px] scatter of the centres about their harmonics
    by_calibration(structure) [percent] share of the calibration in the variance of the power
    interpolation(structure) [percent] error of the power by what markers do not tell, without
        any noise
    markers(structure) [1] number of markers
    modes(structure) [1] modes of the model that are fitted
    spacing(structure) [m] largest distance to the next marker, along or across
    tone(structure) [Hz] frequency of the force
    within(quantity_of, group) [1] recordings whose error is within two stated standard errors
    count(group) [1] recordings
    ratio(quantity_of, group) [1] rms error over the stated one
    ratio_band(quantity_of, group, end) [1] 5 and 95 % of that ratio, of as many recordings
    bias(quantity_of, group) [percent] mean error
    bias_error(quantity_of, group) [percent] its standard error, by the scatter of recordings
    field_real(source, structure, u, z) [Pa] pressure, true and of the first recording, real part
    field_imag(source, structure, u, z) [Pa] the same, imaginary part
    picture(structure, row, column) [1] first frame of the first camera, grey values from 0 to 255
    grid_spacing(grid) [m] largest distance to the next marker, of more and more markers on the
        plate between its modes
    grid_markers(grid) [1] how many these are
    grid_interpolation(grid) [percent] error of the power by what they do not tell, without noise
    grid_left(grid) [percent] what the fitted modes leave of their motion
""")
_COORDINATES = declared("""
    structure(structure) [1] what vibrates
    name(structure) [1] what vibrates, in words
    trial(trial) [1] recording
    quantity_of(quantity_of) [1] what errs
    group(group) [1] a structure, or all of them
    end(end) [1] quantile
    source(source) [1] true, or as measured
    u(u) [m] X on the plane
    z(z) [m] height above the structure
""")
_LISTED = declared("""
    quantity(quantity) [1] what a value is
    value(quantity) [1] value, in the unit beside it
    unit(quantity) [1] unit of the value
""")


def run(study: LabRadiation, data: xr.Dataset) -> xr.Dataset:
    """The cube of ``lab-radiation``, from the dataset of its recordings."""
    medium = Medium(study.speed_of_sound_m_s, study.air_density_kg_m3)
    filmed = study.recordings.cases
    results = [
        _of_case(study, case, data.isel(case=filmed.index(case)), medium) for case in study.cases
    ]
    pictures = _padded([one.pop("picture") for one in results])
    values = {name: np.stack([one[name] for one in results]) for name in results[0]}
    for name in ("field_real", "field_imag"):
        values[name] = np.moveaxis(values[name], 1, 0).astype("float32")
    values |= _judged(values) | _over_grids(study, medium) | {"picture": pictures}
    values |= tap.of_tap(study, float(np.nanmean(data["centre_scatter"])), medium)
    coords = {
        "structure": study.cases,
        "name": [driven(case).name for case in study.cases],
        "trial": np.arange(study.trials + 1),
        "quantity_of": list(QUANTITIES),
        "group": [*study.cases, "all"],
        "end": np.array(BAND),
        "source": ["true", "measured"],
        "u": PLANE.u,
        "z": PLANE.z,
    }
    variables = _VARIABLES | tap.VARIABLES
    cube = xr.Dataset(
        labelled({name: values[name] for name in variables}, variables),
        labelled(coords, _COORDINATES),
    )
    return cube.assign(labelled(_listed(cube), _LISTED))


def _of_case(study: LabRadiation, case: str, own: xr.Dataset, medium: Medium) -> dict[str, Any]:
    """The sound of every recording of one structure."""
    moving, peak = driven(case), study.amplitude_mm / 1000
    real, heard = truth(moving, peak, medium), Heard(moving, medium)
    recordings = [
        own.isel(trial=k, point=slice(moving.markers.count)) for k in range(study.trials + 1)
    ]
    rows = [_of_recording(heard, real, one, peak) for one in recordings]
    each = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    first = (heard.matrix @ _amplitudes(recordings[0]).value).reshape(PLANE.shape)
    fields = np.stack([real.field.reshape(PLANE.shape), first])
    alone = circular(heard.without_noise(peak), np.zeros(moving.markers.count))
    return each | {
        "true_power": real.power,
        "true_efficiency": real.efficiency,
        "missing": own["missing"].values[: len(rows)],
        "centre_scatter": own["centre_scatter"].values[: len(rows)],
        "by_calibration": 100 * np.nanmean(each.pop("calibration")),
        "interpolation": 100 * (float(heard.power(alone).value) / real.power - 1),
        "markers": moving.markers.count,
        "modes": heard.between.modes,
        "spacing": spacing(moving.markers.centres),
        "tone": moving.frequency,
        "field_real": fields.real,
        "field_imag": fields.imag,
        "picture": _picture(study, case),
    }


def _amplitudes(one: xr.Dataset, calibration: bool = True) -> Amplitudes:
    """The amplitudes of a recording's markers, and the covariance of their errors."""
    value = one["amplitude_real"].values + 1j * one["amplitude_imag"].values
    rows = one["shared_real"].values + 1j * one["shared_imag"].values
    variance = one["scatter"].values.astype(float) ** 2
    return circular(value, variance, rows if calibration else None)


def _of_recording(heard: Heard, real: Truth, one: xr.Dataset, peak: float) -> dict[str, float]:
    """What one recording says of the sound, and how far that is off."""
    shape = _amplitudes(one)
    power, efficiency = heard.power(shape), heard.efficiency(shape)
    by_scatter = heard.power(_amplitudes(one, calibration=False))
    largest = float(np.abs(real.field).max())
    left, noise = heard.between.left(shape)
    markers = heard.without_noise(peak)
    return {
        "power": float(power.value),
        "power_error": float(power.error),
        "efficiency": float(efficiency.value),
        "efficiency_error": float(efficiency.error),
        "shape_error": 100 * _rms(shape.value - markers) / peak,
        "field_error": 100 * _rms(heard.matrix @ shape.value - real.field) / largest,
        "field_stated": 100 * heard.field_error(shape) / largest,
        "unexplained": left / noise,
        "calibration": 1 - float(by_scatter.error / power.error) ** 2,
    }


def _rms(values: ComplexArray) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def _judged(values: dict[str, Any]) -> dict[str, Any]:
    """Errors held against the stated ones, by structure and of all together."""
    z, off = [], []
    for name in QUANTITIES:
        wrong = values[name] - values[f"true_{name}"][:, None]
        z.append(_grouped(wrong / values[f"{name}_error"]))
        off.append(_grouped(100 * wrong / values[f"true_{name}"][:, None]))
    count = np.array([np.count_nonzero(np.isfinite(one)) for one in z[0]])
    ratio = np.array([[np.sqrt(np.nanmean(one**2)) for one in row] for row in z])
    spread = np.sqrt(chi2.ppf(BAND, count[:, None]) / count[:, None])
    return {
        "within": [[np.count_nonzero(np.abs(one) <= TWICE) for one in row] for row in z],
        "count": count,
        "ratio": ratio,
        "ratio_band": ratio[..., None] / spread[:, ::-1],
        "bias": [[np.nanmean(one) for one in row] for row in off],
        "bias_error": [
            [np.nanstd(one, ddof=1) / np.sqrt(n) for one, n in zip(row, count, strict=True)]
            for row in off
        ],
    }


def _grouped(values: Array) -> list[Array]:
    """Values (cases, trials) by case, then all of them."""
    return [*values, values.ravel()]


def _over_grids(study: LabRadiation, medium: Medium) -> dict[str, Any]:
    """What more and more markers tell of a plate between its modes, without noise."""
    own, peak = driven("between"), study.amplitude_mm / 1000
    real = truth(own, peak, medium)
    rows = []
    for grid in GRIDS:
        heard = Heard(with_grid(own, grid), medium)
        shape = circular(heard.without_noise(peak), np.zeros(heard.own.markers.count))
        left = np.linalg.norm(heard.between.residual(shape.value)) / np.linalg.norm(shape.value)
        rows.append(
            {
                "grid_spacing": spacing(heard.own.markers.centres),
                "grid_markers": heard.own.markers.count,
                "grid_interpolation": 100 * (float(heard.power(shape).value) / real.power - 1),
                "grid_left": 100 * left,
            }
        )
    return {name: [row[name] for row in rows] for name in rows[0]}


def _picture(study: LabRadiation, case: str) -> Image:
    """The first frame that the first camera takes in the first recording, (rows, columns)."""
    rig = rig_of(study, case, 0)
    rig, _ = cropped(rig, rig.cameras)
    station = rig.stations[0]
    view = OutlinedView(rig, station, driven(case).corners)
    return view.frame(station.start, rig.generator(1, 0, 0))


def _padded(pictures: list[Image]) -> Image:
    """Pictures side by side in one array of the largest size, 0 beyond them."""
    size = np.max([one.shape for one in pictures], axis=0)
    beyond = [[(0, m - n) for m, n in zip(size, one.shape, strict=True)] for one in pictures]
    return np.stack([np.pad(*each) for each in zip(pictures, beyond, strict=True)])


def _listed(cube: xr.Dataset) -> dict[str, Any]:
    """What runs are compared by."""
    rows: list[tuple[str, float, str]] = []
    for case in cube["structure"].values.tolist():
        own = cube.sel(structure=case)
        words = str(own["name"].item())
        rows += [
            (f"{words}: sound power", float(own["true_power"]), "W"),
            (f"{words}: radiation efficiency", float(own["true_efficiency"]), "1"),
            (f"{words}: rms error of the field", _rms(own["field_error"].values), "percent"),
            (f"{words}: stated", _rms(own["field_stated"].values), "percent"),
        ]
    for group in cube["group"].values.tolist():
        words = group if group == "all" else str(cube["name"].sel(structure=group).item())
        for of in QUANTITIES:
            own = cube.sel(group=group, quantity_of=of)
            rows += [
                (f"{words}: {of} within two standard errors", float(own["within"]), "1"),
                (f"{words}: error of the {of} over the stated one", float(own["ratio"]), "1"),
                (f"{words}: mean error of the {of}", float(own["bias"]), "percent"),
            ]
    names, values, units = zip(*rows, strict=True)
    return {"quantity": list(names), "value": list(values), "unit": list(units)}
