"""Variables and coordinates that the cubes of many figure sets have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from thesis_lib.acoustics.planes import Plane
from thesis_lib.facts.setups import Setting
from thesis_lib.studies.request import Study
from thesis_lib.vibration.structure import Structure

Array = NDArray[np.float64]


# Dimensions beside `setting`, type on disk, units, long name. Float64 where rounding matters.
VARIABLES: dict[str, tuple[tuple[str, ...], str, str, str]] = {
    "measured_deflection": (
        ("mode", "trial", "point"), "float32", "m", "measured deflection of the markers"),
    "mean_error": (
        ("mode", "trial"), "float64", "percent", "rms error over the markers"),
    "max_point_error": (
        ("mode", "trial"), "float64", "percent", "largest error of a marker"),
    "point_error": (
        ("mode", "point"), "float64", "percent", "error of each marker in trial 0"),
    "predicted_error": (
        ("mode",), "float64", "percent", "rms error over the trials by the law of rounding"),
    "mac": (("mode", "trial"), "float64", "1", "modal assurance criterion with the reference"),
    "in_view": ((), "float64", "1", "share of camera x marker x mode images on the sensor"),
    "ground_sample_distance": ((), "float64", "m/px", "length of a pixel at the origin"),
}  # fmt: skip


CAMERAS = {"camera_distance": "m", "camera_azimuth": "degree", "camera_elevation": "degree"}


def extremes(plate_cube: xr.Dataset) -> dict[str, list[tuple[int, int]]]:
    """Per case and mode the settings with the lowest and highest deflection error of trial 0."""
    literal = plate_cube["mean_error"].isel(trial=0).values
    result: dict[str, list[tuple[int, int]]] = {}
    for case in dict.fromkeys(plate_cube["case"].values.tolist()):
        rows = np.flatnonzero(plate_cube["case"].values == case)
        result[case] = [
            (int(rows[np.argmin(literal[rows, m])]), int(rows[np.argmax(literal[rows, m])]))
            for m in range(literal.shape[1])
        ]
    return result


def field_coordinates(planes: tuple[Plane, ...], cases: list[str]) -> dict[str, Any]:
    """Coordinates of fields on planes, and of the extreme settings of each case."""
    return {
        "case_name": (
            "case",
            np.array(cases),
            {"long_name": "cases in the order of `case`", "units": "1"},
        ),
        "plane": (
            "plane",
            np.array([plane.name for plane in planes]),
            {"long_name": "plane", "units": "1"},
        ),
        "extreme": (
            "extreme",
            np.array(["best", "worst"]),
            {"long_name": "setting of a case", "units": "1"},
        ),
        "u": ("u", planes[0].u, {"units": "m", "long_name": "X on plane XZ, Y on plane YZ"}),
        "z": ("z", planes[0].z, {"units": "m", "long_name": "height above the plate"}),
    }


def add_cameras(cube: xr.Dataset, settings: list[Setting]) -> None:
    """Add distance, azimuth and elevation of every setting's cameras to a cube."""
    table = _camera_table(settings)
    for column, (name, units) in enumerate(CAMERAS.items()):
        cube[name] = (
            ("setting", "camera"), table[:, :, column],
            {"units": units, "long_name": name.replace("_", " ")},
        )  # fmt: skip


def _camera_table(settings: list[Setting]) -> Array:
    """Distance in m, azimuth and elevation in degrees: (settings, cameras, 3), NaN-padded."""
    most = max(len(setting.directions_deg) for setting in settings)
    table = np.full((len(settings), most, 3), np.nan)
    for row, setting in zip(table, settings, strict=True):
        row[: len(setting.directions_deg), 0] = setting.distance_mm / 1000
        row[: len(setting.directions_deg), 1:] = setting.directions_deg
    return table


def coordinates(
    study: Study, modes: Sequence[int], structure: Structure, settings: list[Setting]
) -> dict[str, Any]:
    """Coordinates of a study's cube: settings, modes, trials, points."""
    x, y = structure.markers
    hertz = structure.angular_frequencies(max(modes)) / (2 * np.pi)

    def on_setting(values: list[Any], long_name: str, units: str = "1") -> Any:
        return "setting", np.array(values), {"long_name": long_name, "units": units}

    varied_units = {"distance_mm": "mm", "aperture_deg": "degree", "elevation_deg": "degree"}.get(
        study.varied, "1"
    )
    return {
        "case": on_setting([s.case for s in settings], "case of the thesis, or layout"),
        "parameter": on_setting([study.varied] * len(settings), "varied parameter"),
        "value": on_setting(
            [float(s.value) for s in settings], "value of the varied parameter", varied_units
        ),
        "label": on_setting([s.label for s in settings], "value with its unit"),
        "n_cameras": on_setting([len(s.directions_deg) for s in settings], "number of cameras"),
        "width_px": on_setting([s.resolution_px[0] for s in settings], "width of the sensor"),
        "height_px": on_setting([s.resolution_px[1] for s in settings], "height of the sensor"),
        "pair_order": on_setting([s.pair_order for s in settings], "order of adding pairs"),
        "mode": ("mode", np.array(modes), {"long_name": "mode number", "units": "1"}),
        "frequency": (
            "mode", hertz[np.array(modes) - 1],
            {"long_name": "natural frequency", "units": "Hz"},
        ),
        "trial": (
            "trial", np.arange(study.trials + 1),
            {"long_name": "random shift of the pixel grids, 0 for the literal run", "units": "1"},
        ),
        "x": ("point", x, {"long_name": "marker position along the length", "units": "m"}),
        "y": ("point", y, {"long_name": "marker position across", "units": "m"}),
    }  # fmt: skip
