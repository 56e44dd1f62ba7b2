"""Numbers on the page of the law of rounding: a worked one, and how far single runs lie from it."""

from __future__ import annotations

import numpy as np

from thesis_lib.book.pieces.opened import Cubes, of_subject
from thesis_lib.figure_sets.parametric.parameters import camera_study
from thesis_lib.templates import render
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.rounding import deflection_variance, difference_variance
from thesis_lib.vision.triangulation import triangulation_gain

ROUNDING_SET = "beam-distance"


def describe_example(opened: Cubes) -> str:
    """Work the law out for the last marker, the first mode and setting of ``beam-distance``."""
    cube, study = opened[ROUNDING_SET].isel(setting=0, mode=0, point=-1), camera_study(ROUNDING_SET)
    setting, structure = study.settings()[0], study.structure
    cameras = setting.cameras(study.focal_length_mm, study.sensor_width_mm)
    shape = deflection_shape(structure, 1, structure.markers, study.peaks_m[0])
    rest, deflected = (world_points(structure, w)[:, -1] for w in (0 * shape, shape))
    moved = project(cameras.P, deflected) - project(cameras.P, rest)
    variance, g = difference_variance(moved), 1e3 * triangulation_gain(cameras.P, deflected)[2]
    rows = [
        dict(camera=i + 1, axis=axis, moved=moved[i, j], variance=variance[i, j], gain=g[i, j])
        for i in range(len(moved))
        for j, axis in enumerate("uv")
    ]
    errors = 1e3 * (cube["measured_deflection"] - cube["reference_deflection"]).values[1:]
    return render(
        __file__,
        "rounding-example",
        marker=len(shape),
        moves_mm=1e3 * shape[-1],
        distance_mm=setting.distance_mm,
        figure_set=ROUNDING_SET,
        rows=rows,
        total=np.sum(g**2 * variance),
        law_mm=1e3 * np.sqrt(deflection_variance(cameras.P, rest, deflected)),
        trials=len(errors),
        rms_mm=np.sqrt(np.mean(errors**2)),
    )


def tabulate_scatter(opened: Cubes) -> str:
    """Tabulate how far the trials' errors of beam and plate lie from the law."""
    rows = []
    for subject in ("beam", "plate"):
        if cubes := of_subject(opened, subject):  # none in the book of another chapter
            ratios = [
                (c["mean_error"][..., 1:] / c["predicted_error"]).values.ravel() for c in cubes
            ]
            rows.append((subject, np.nanquantile(np.concatenate(ratios), [0.05, 0.5, 0.95])))
    return render(__file__, "rounding-scatter", rows=rows)


PIECES = {"rounding-example": describe_example, "rounding-scatter": tabulate_scatter}
