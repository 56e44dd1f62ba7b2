"""Parametric studies: from validated parameters to a labelled cube (thesis 3.3).

For every setting the markers are projected at rest and in each deflection shape, rounded to whole
pixels on the grid of each trial, triangulated, and compared with the reference. Shifting a pixel
grid by s is ``rint(uv + s) − s`` with unchanged cameras, so all trials, all shapes and the rest
image of a setting are one batch of points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from thesis_lib import rounding
from thesis_lib.camera_study import LEAST_SQUARES
from thesis_lib.cameras import (
    CameraArray,
    ground_sample_distance,
    on_sensor,
    pixelate,
    project,
)
from thesis_lib.chunks import PIECE_BYTES, Block, Outline, computed, runs_of_trials
from thesis_lib.parameters import CameraStudy, Study
from thesis_lib.polytope import analytic_centre
from thesis_lib.setups import Setting
from thesis_lib.structures import Structure, deflection_shape
from thesis_lib.triangulation import triangulate

Array = NDArray[np.float64]


def world_points(structure: Structure, deflections: Array) -> Array:
    """World coordinates of the markers for deflections (..., markers) in m, shape (3, ...)."""
    centre = np.array(structure.extent) / 2
    x, y = structure.markers - centre[:, None]
    return np.stack(np.broadcast_arrays(x, y, deflections))


def heights(P: Array, uv: Array, estimator: str, normals: Array | None = None) -> Array:
    """Heights in m of points from rounded images (cameras, 2, ...), by one of the estimators.

    They are Z, or what points (3, ..., markers) have along the markers' normals (3, markers).
    """
    centre = estimator == "analytic-centre"
    points = analytic_centre(P, uv).points if centre else triangulate(P, uv)
    return points[2] if normals is None else np.einsum("k...m,km->...m", points, normals)


def measure(
    cameras: CameraArray,
    points: Array,
    shifts: Array,
    rest_is_known: bool = False,
    estimator: str = LEAST_SQUARES,
    normals: Array | None = None,
) -> Array:
    """Deflections that cameras with whole pixels measure.

    Parameters
    ----------
    cameras : CameraArray
        The cameras.
    points : ndarray, shape (3, 1 + modes, markers)
        Marker positions in m: at rest, then deflected.
    shifts : ndarray, shape (trials, cameras, 2)
        Shift of each camera's pixel grid in px.
    rest_is_known : bool
        Subtract the true rest position instead of the rebuilt one.
    estimator : str
        ``least-squares`` or ``analytic-centre``: the centre of the slabs that the rounded images
        leave, which a shifted grid moves along.
    normals : ndarray, shape (3, markers), optional
        Unit vectors along which deflections are measured, in place of Z.

    Returns
    -------
    ndarray, shape (modes, trials, markers)
        Measured deflections in m.
    """
    P = cameras.P
    shift = np.moveaxis(shifts, 0, 2)[:, :, None, :, None]
    if rest_is_known:
        images = project(P, points[:, 1:])[:, :, :, None] + shift
        rest = points[2, 0] if normals is None else np.sum(points[:, 0] * normals, axis=0)
        return heights(P, pixelate(images) - shift, estimator, normals) - rest
    images = project(P, points)[:, :, :, None] + shift
    height = heights(P, pixelate(images) - shift, estimator, normals)
    return height[1:] - height[0]


def percent_errors(measured: Array, reference: Array) -> tuple[Array, Array, Array]:
    """Point, mean (rms) and largest error in % of the largest reference deflection.

    Equations 3.22 and 3.23; `measured` is (modes, trials, markers), `reference` (modes, markers).
    """
    scale = 100 / np.max(np.abs(reference), axis=-1)
    point = np.abs(measured - reference[:, None]) * scale[:, None, None]
    return point, np.sqrt(np.mean(point**2, axis=-1)), np.max(point, axis=-1)


def modal_assurance(measured: Array, reference: Array) -> Array:
    """Modal assurance criterion |mᵀr|² / (mᵀm · rᵀr), from 0 to 1; NaN if nothing moves."""
    cross = np.einsum("mtp,mp->mt", measured, reference)
    norms = np.einsum("mtp,mtp->mt", measured, measured)
    with np.errstate(invalid="ignore"):
        result: Array = cross**2 / (norms * np.sum(reference**2, axis=-1)[:, None])
    return result


def block_results(
    block: Block,
    *,
    points: Array,
    focal_length_mm: float,
    sensor_width_mm: float,
    seed: int,
    principal_offset_px: float,
    rest_is_known: bool,
    estimator: str,
) -> dict[str, Any]:
    """What some trials of a setting give: a value for each of ``VARIABLES``.

    Those without trials are there where the block has the literal run.
    """
    cameras = block.load.cameras(focal_length_mm, sensor_width_mm)
    trials = block.trials
    shifts = rounding.grid_shifts(seed, trials.stop - 1, len(cameras), trials.start)
    shifts += principal_offset_px
    reference = points[2, 1:]
    measured = measure(cameras, points, shifts, rest_is_known, estimator)
    point, mean, largest = percent_errors(measured, reference)
    results = {
        "measured_deflection": measured.astype("float32"),
        "mean_error": mean,
        "max_point_error": largest,
        "mac": modal_assurance(measured, reference),
    }
    if trials.start > 0:
        return results
    variance = rounding.deflection_variance(cameras.P, points[:, :1], points[:, 1:], rest_is_known)
    scale = 100 / np.max(np.abs(reference), axis=-1)
    return results | {
        "point_error": point[:, 0],
        "predicted_error": np.sqrt(np.mean(variance, axis=-1)) * scale,
        "in_view": np.mean(on_sensor(project(cameras.P, points[:, 1:]), cameras.size)),
        "ground_sample_distance": ground_sample_distance(cameras),
    }


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


def run(study: CameraStudy, scheduler: str = "") -> xr.Dataset:
    """The cube of a camera study, in memory.

    Parameters
    ----------
    study : CameraStudy
        Validated parameters.
    scheduler : str
        Workers that compute it (:func:`thesis_lib.schedulers.checked`), else this process does.

    Returns
    -------
    xarray.Dataset
        Dimensions ``setting``, ``mode``, ``trial``, ``point``, ``camera``; every variable has
        ``units`` and ``long_name``.
    """
    return outline(study, scheduler).in_memory()


def outline(study: CameraStudy, scheduler: str = "", piece_bytes: int = PIECE_BYTES) -> Outline:
    """The cube of a camera study, to be filled in block by block."""
    structure, settings = study.structure, study.settings()
    shapes = [
        deflection_shape(structure, mode, structure.markers, peak)
        for mode, peak in zip(study.modes, study.peaks_m, strict=True)
    ]
    reference = np.array(shapes)
    points = world_points(structure, np.concatenate([np.zeros_like(reference[:1]), reference]))
    cube = xr.Dataset(coords=coordinates(study, study.modes, structure, settings))
    cube["reference_deflection"] = (
        ("mode", "point"), reference,
        {"units": "m", "long_name": "reference deflection of the markers"},
    )  # fmt: skip
    add_cameras(cube, settings)
    order = ("reference_deflection", *VARIABLES, *CAMERAS)
    large = {
        name: (("setting", *dims), dtype, {"units": units, "long_name": long_name})
        for name, (dims, dtype, units, long_name) in VARIABLES.items()
    }
    large["predicted_error"][2]["long_name"] = study.law
    work = partial(
        block_results,
        points=points,
        focal_length_mm=study.focal_length_mm,
        sensor_width_mm=study.sensor_width_mm,
        seed=study.seed,
        principal_offset_px=study.principal_offset_px,
        rest_is_known=study.rest == "known",
        estimator=study.estimator,
    )

    def fill(values: Mapping[str, Any]) -> None:
        blocks = _blocks(settings, study.trials, points[0].size)
        for block, results in computed(work, blocks, scheduler, piece_bytes):
            for name, result in results.items():
                of_trials = "trial" in VARIABLES[name][0]
                values[name][block.place if of_trials else block.setting] = result

    return Outline(cube, large, fill, order)


def _blocks(settings: list[Setting], trials: int, n_points: int) -> Iterator[Block]:
    """Blocks of a study whose cameras see that many points, modes times markers, in a trial."""
    for index, setting in enumerate(settings):
        trial_bytes = 16 * len(setting.directions_deg) * n_points
        for run in runs_of_trials(trials, trial_bytes):
            yield Block(index, run, (run.stop - run.start) * trial_bytes, setting)


CAMERAS = {"camera_distance": "m", "camera_azimuth": "degree", "camera_elevation": "degree"}


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
