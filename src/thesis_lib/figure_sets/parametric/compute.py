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

from thesis_lib.arrays import Array
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.studies.blocks import PIECE_BYTES, Block, Outline, computed, runs_of_trials
from thesis_lib.studies.schema import (
    CAMERAS,
    REFERENCE,
    SHORT,
    VARIABLES,
    camera_places,
    coordinates,
    labelled,
)
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision import rounding
from thesis_lib.vision.pinhole import ground_sample_distance, on_sensor, project
from thesis_lib.vision.simulation import measure, modal_assurance, percent_errors


def block_results(
    block: Block,
    *,
    points: Array,
    modes: list[int],
    focal_length_mm: float,
    sensor_width_mm: float,
    seed: int,
    principal_offset_px: float,
    rest_is_known: bool,
    estimator: str,
    noise_px: float,
) -> dict[str, Any]:
    """Compute some trials of a setting: a value for each of ``VARIABLES``.

    Results without trials are included where the block has the nominal run.
    """
    cameras = block.load.cameras(focal_length_mm, sensor_width_mm)
    trials = block.trials
    shifts = rounding.grid_shifts(seed, trials.stop - 1, len(cameras), trials.start)
    shifts += principal_offset_px
    reference = points[2, 1:]
    noise = None
    if noise_px:
        markers = points.shape[2]
        noise = noise_px * rounding.image_noise(
            seed, trials.stop - 1, modes, len(cameras), markers, trials.start
        )
    measured = measure(
        cameras, points, shifts, rest_is_known, estimator, noise=noise, noise_px=noise_px
    )
    point, mean, largest = percent_errors(measured, reference)
    results = {
        "measured_deflection": measured.astype("float32"),
        "mean_error": mean,
        "max_point_error": largest,
        "mac": modal_assurance(measured, reference),
    }
    if trials.start > 0:
        return results
    variance = rounding.deflection_variance(
        cameras.P, points[:, :1], points[:, 1:], rest_is_known, noise_px=noise_px
    )
    scale = 100 / np.max(np.abs(reference), axis=-1)
    return results | {
        "point_error": point[:, 0],
        "predicted_error": np.sqrt(np.mean(variance, axis=-1)) * scale,
        "in_view": np.mean(on_sensor(project(cameras.P, points[:, 1:]), cameras.size)),
        "ground_sample_distance": ground_sample_distance(cameras),
    }


def run(study: CameraStudy, scheduler: str = "") -> xr.Dataset:
    """Compute the cube of a camera study in memory: that of :func:`outline`, filled in."""
    return outline(study, scheduler).in_memory()


def outline(
    study: CameraStudy,
    scheduler: str = "",
    piece_bytes: int = PIECE_BYTES,
    only: Sequence[Setting] | None = None,
) -> Outline:
    """Outline the cube of a camera study, or of some settings, to be filled in by blocks."""
    structure, settings = study.structure, list(study.settings() if only is None else only)
    shapes = [
        deflection_shape(structure, mode, structure.markers, peak)
        for mode, peak in zip(study.modes, study.peaks_m, strict=True)
    ]
    reference = np.array(shapes)
    points = world_points(structure, np.concatenate([np.zeros_like(reference[:1]), reference]))
    values = labelled({"reference_deflection": reference}, REFERENCE) | camera_places(settings)
    cube = xr.Dataset(values, coordinates(study, study.modes, structure, settings))
    order = (*REFERENCE, *VARIABLES, *CAMERAS)
    large = {
        name: (("setting", *one.dims), SHORT.get(name, "float64"), one.attributes)
        for name, one in VARIABLES.items()
    }
    large["predicted_error"][2]["long_name"] = study.law
    work = partial(
        block_results,
        points=points,
        modes=study.modes,
        focal_length_mm=study.focal_length_mm,
        sensor_width_mm=study.sensor_width_mm,
        seed=study.seed,
        principal_offset_px=study.principal_offset_px,
        rest_is_known=study.rest == "known",
        estimator=study.estimator,
        noise_px=study.noise_px,
    )

    def fill(values: Mapping[str, Any]) -> None:
        blocks = _blocks(settings, study.trials, points[0].size)
        for block, results in computed(work, blocks, scheduler, piece_bytes):
            for name, result in results.items():
                of_trials = "trial" in VARIABLES[name].dims
                values[name][block.place if of_trials else block.setting] = result

    return Outline(cube, large, fill, order)


def _blocks(settings: list[Setting], trials: int, n_points: int) -> Iterator[Block]:
    """Blocks of a study whose cameras see that many points, modes times markers, in a trial."""
    for index, setting in enumerate(settings):
        trial_bytes = 16 * len(setting.directions_deg) * n_points
        for run in runs_of_trials(trials, trial_bytes):
            yield Block(index, run, (run.stop - run.start) * trial_bytes, setting)
