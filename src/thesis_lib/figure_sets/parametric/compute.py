"""Parametric studies: from validated parameters to a labelled cube (thesis 3.3).

For every setting the markers are projected at rest and in each deflection shape, rounded to whole
pixels on the grid of each trial, triangulated, and compared with the reference. Shifting a pixel
grid by s is ``rint(uv + s) − s`` with unchanged cameras, so all trials, all shapes and the rest
image of a setting are one batch of points.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.studies import schema, workers
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision import pinhole, rounding, simulation


def block_results(block: workers.Block, points: Array, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Compute some trials of a setting: a value for each of ``VARIABLES``.

    Results without trials are included where the block has the nominal run. `asked` are the plain
    values of the study's request, which are sent to workers.
    """
    cameras = block.load.cameras(asked["focal_length_mm"], asked["sensor_width_mm"])
    trials, reference, noise_px = block.trials, points[2, 1:], asked["noise_px"]
    drawn = asked["seed"], trials.stop - 1
    shifts = rounding.grid_shifts(*drawn, len(cameras), trials.start)
    shifts += asked["principal_offset_px"]
    known, noise = asked["rest"] == "known", None
    if noise_px:
        markers = points.shape[2]
        noise = noise_px * rounding.image_noise(
            *drawn, asked["modes"], len(cameras), markers, trials.start
        )
    measured = simulation.measure_deflections(
        cameras, points, shifts, known, asked["estimator"], noise=noise, noise_px=noise_px
    )
    point, mean, largest = simulation.percent_errors(measured, reference)
    results = {
        "measured_deflection": measured.astype("float32"),
        "mean_error": mean,
        "max_point_error": largest,
        "mac": simulation.assurance_criterion(measured, reference[:, None]),
    }
    if trials.start > 0:
        return results
    variance = rounding.deflection_variance(
        cameras.P, points[:, :1], points[:, 1:], known, noise_px=noise_px
    )
    scale = 100 / np.max(np.abs(reference), axis=-1)
    return results | {
        "point_error": point[:, 0],
        "predicted_error": np.sqrt(np.mean(variance, axis=-1)) * scale,
        "in_view": np.mean(
            pinhole.on_sensor(pinhole.project(cameras.P, points[:, 1:]), cameras.size)
        ),
        "ground_sample_distance": pinhole.ground_sample_distance(cameras),
    }


def run(
    study: CameraStudy,
    scheduler: str = "",
    only: Sequence[Setting] | None = None,
    shapes: Sequence[Array] = (),
) -> xr.Dataset:
    """Compute the cube of a camera study block by block.

    `only` selects some of its settings; `shapes` are deflections in m that replace its modes.
    """
    structure, settings = study.structure, list(study.settings() if only is None else only)
    reference = np.array(
        shapes
        or [
            deflection_shape(structure, mode, structure.markers, peak)
            for mode, peak in zip(study.modes, study.peaks_m, strict=True)
        ]
    )
    points = world_points(structure, np.concatenate([np.zeros_like(reference[:1]), reference]))
    cube = xr.Dataset(coords=schema.study_coordinates(study, study.modes, structure, settings))
    values = {
        name: np.empty(
            (len(settings), *(cube.sizes[dim] for dim in one.dims)),
            schema.SHORT_TYPES.get(name, "float64"),
        )
        for name, one in schema.VARIABLES.items()
    }
    work = partial(block_results, points=points, asked=study.request)
    blocks = (
        workers.Block(index, run, setting)
        for index, setting in enumerate(settings)
        for run in workers.runs_of_trials(
            study.trials, 16 * len(setting.directions_deg) * points[0].size
        )
    )
    for block, results in workers.compute_blocks(work, blocks, scheduler):
        for name, result in results.items():
            of_trials = "trial" in schema.VARIABLES[name].dims
            values[name][block.place if of_trials else block.setting] = result
    cube = cube.assign(
        schema.label_values({"reference_deflection": reference}, schema.REFERENCE_VARIABLE)
    )
    cube = cube.assign(schema.label_values(values, schema.VARIABLES, over=["setting"]))
    cube["predicted_error"].attrs["long_name"] = study.law
    return cube.assign(schema.camera_places(settings))
