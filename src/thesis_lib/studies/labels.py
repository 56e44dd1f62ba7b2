"""Variables and coordinates that the cubes of many figure sets have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.acoustics.planes import Plane
from thesis_lib.facts.setups import Setting
from thesis_lib.studies import cubes
from thesis_lib.studies.request import Study
from thesis_lib.studies.variables import Variable, declared, labelled
from thesis_lib.studies.vocabulary import unit
from thesis_lib.vibration.structure import Structure

VARIABLES = declared("""
    measured_deflection(mode, trial, point) [m] measured deflection of the markers
    mean_error(mode, trial) [percent] rms error over the markers
    max_point_error(mode, trial) [percent] largest error of a marker
    point_error(mode, point) [percent] error of each marker in trial 0
    predicted_error(mode) [percent] rms error over the trials by the law of rounding
    mac(mode, trial) [1] modal assurance criterion with the reference
    in_view() [1] share of camera x marker x mode images on the sensor
    ground_sample_distance() [m/px] length of a pixel at the origin
""")
"""What every setting of a camera study has; beside these dimensions each is over ``setting``."""
FIELD_COORDINATES = declared("""
    case_name(case) [1] cases in the order of `case`
    plane(plane) [1] plane
    extreme(extreme) [1] setting of a case
    u(u) [m] X on plane XZ, Y on plane YZ
    z(z) [m] height above the plate
""")
SHORT = {"measured_deflection": "float32"}
"""Type on disk where it is not float64, in which rounding would not matter."""
CAMERAS = declared("""
    camera_distance(setting, camera) [m] camera distance
    camera_azimuth(setting, camera) [degree] camera azimuth
    camera_elevation(setting, camera) [degree] camera elevation
""")
REFERENCE = declared("reference_deflection(mode, point) [m] reference deflection of the markers")


def extremes(plate_cube: xr.Dataset) -> dict[str, list[tuple[int, int]]]:
    """Per case and mode the settings with the lowest and highest typical deflection error."""
    error = cubes.typical(plate_cube["mean_error"])
    result: dict[str, list[tuple[int, int]]] = {}
    for case in dict.fromkeys(plate_cube["case"].values.tolist()):
        rows = np.flatnonzero(plate_cube["case"].values == case)
        result[case] = [
            (int(rows[np.argmin(error[rows, m])]), int(rows[np.argmax(error[rows, m])]))
            for m in range(error.shape[1])
        ]
    return result


def field_coordinates(planes: tuple[Plane, ...], cases: list[str]) -> dict[str, Any]:
    """Coordinates of fields on planes, and of the extreme settings of each case."""
    values = {
        "case_name": cases,
        "plane": [plane.name for plane in planes],
        "extreme": ["best", "worst"],
        "u": planes[0].u,
        "z": planes[0].z,
    }
    return labelled(values, FIELD_COORDINATES)


def of_settings(
    settings: list[Setting], results: Sequence[Mapping[str, Any]], table: Mapping[str, Variable]
) -> dict[str, Any]:
    """The results of settings as variables, in the order of a table, and where cameras stand."""
    values = {
        name: np.array([one[name] for one in results]).astype(SHORT.get(name, "float64"))
        for name in table
    }
    return labelled(values, table, over=["setting"]) | camera_places(settings)


def camera_places(settings: list[Setting]) -> dict[str, Any]:
    """Distance, azimuth and elevation of every setting's cameras as variables, NaN-padded."""
    most = max(len(setting.directions_deg) for setting in settings)
    table = np.full((3, len(settings), most), np.nan)
    for i, setting in enumerate(settings):
        there = slice(len(setting.directions_deg))
        table[0, i, there] = setting.distance_mm / 1000
        table[1:, i, there] = np.transpose(setting.directions_deg)
    return labelled(dict(zip(CAMERAS, table, strict=True)), CAMERAS)


def filmed(
    coords: dict[str, Any], hertz: Sequence[float], others: xr.Dataset | None = None
) -> dict[str, Any]:
    """Return coordinates of modes rendered at these frequencies; trials are recordings."""
    words = {"long_name": "frequency of the vibration", "units": "Hz"}
    coords["frequency"] = ("mode", np.array(hertz), words)
    count = 0 if others is None else others.sizes["recording"]
    words = {"long_name": "recording, 0 for the one whose tracks are stored", "units": "1"}
    coords["trial"] = ("trial", np.arange(1 + count), words)
    return coords


def drawn_by(others: xr.Dataset | None) -> dict[str, str]:
    """Return the attribute of a rendered cube that says how many other recordings it has."""
    return {"draws": f"{0 if others is None else others.sizes['recording']} recordings"}


def coordinates(
    study: Study, modes: Sequence[int], structure: Structure, settings: list[Setting]
) -> dict[str, Any]:
    """Coordinates of a study's cube: settings, modes, trials, points."""
    x, y = structure.markers
    hertz = structure.angular_frequencies(max(modes)) / (2 * np.pi)
    words = "random shift of the pixel grids, 0 for the literal run"

    def on(dim: str, values: Any, long_name: str, units: str = "1") -> Any:
        return dim, np.array(values), {"long_name": long_name, "units": units}

    def each(long_name: str, of: Callable[[Setting], Any], units: str = "1") -> Any:
        return on("setting", [of(setting) for setting in settings], long_name, units)

    varied = {"mm": "mm", "°": "degree"}.get(unit(study.varied), "1")
    return {
        "case": each("case of the thesis, or layout", lambda s: s.case),
        "parameter": each("varied parameter", lambda _: study.varied),
        "value": each("value of the varied parameter", lambda s: float(s.value), varied),
        "label": each("value of the varied parameter, with unit", lambda s: s.label),
        "n_cameras": each("number of cameras", lambda s: len(s.directions_deg)),
        "width_px": each("width of the sensor", lambda s: s.resolution_px[0]),
        "height_px": each("height of the sensor", lambda s: s.resolution_px[1]),
        "pair_order": each("order of adding pairs", lambda s: s.pair_order),
        "mode": on("mode", modes, "mode number"),
        "frequency": on("mode", hertz[np.array(modes) - 1], "natural frequency", "Hz"),
        "trial": on("trial", range(study.trials + 1), words),
        "x": on("point", x, "marker position along the length", "m"),
        "y": on("point", y, "marker position across", "m"),
    }
