"""Numbers on the page of the law of rounding: a worked one, and how far single runs lie from it."""

from __future__ import annotations

import numpy as np

from thesis_lib.book.conclusions.strengths import Cubes
from thesis_lib.book.pieces.opened import of_subject
from thesis_lib.figure_sets.parametric.parameters import camera_study
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.rounding import deflection_variance, difference_variance
from thesis_lib.vision.triangulation import gain
from thesis_lib.web.markdown import table

SET = "beam-distance"


def example(opened: Cubes) -> str:
    """The last marker in the first mode, at the first setting of ``beam-distance``."""
    cube, study = opened[SET].isel(setting=0, mode=0, point=-1), camera_study(SET)
    setting, structure = study.settings()[0], study.structure
    cameras = setting.cameras(study.focal_length_mm, study.sensor_width_mm)
    shape = deflection_shape(structure, 1, structure.markers, study.peaks_m[0])
    rest, deflected = (world_points(structure, w)[:, -1] for w in (0 * shape, shape))
    moved = project(cameras.P, deflected) - project(cameras.P, rest)
    variance, g = difference_variance(moved), 1e3 * gain(cameras.P, deflected)[2]
    rows = [
        [f"camera {i + 1}, {axis}"]
        + [f"{v:.3f}".replace("-", "−") for v in (moved[i, j], variance[i, j], g[i, j])]
        + [f"{g[i, j] ** 2 * variance[i, j]:.3f}"]
        for i in range(len(moved))
        for j, axis in enumerate("uv")
    ]
    header = ["coordinate", "δ, px", "f(1 − f), px²", "g, mm/px", "g² f(1 − f), mm²"]
    law = 1e3 * np.sqrt(deflection_variance(cameras.P, rest, deflected))
    errors = 1e3 * (cube["measured_deflection"] - cube["reference_deflection"]).values[1:]
    drawn = np.sqrt(np.mean(errors**2))
    return (
        f"Marker {len(shape)} of the beam, near its tip, moves by {1e3 * shape[-1]:.2f} mm in the "
        f"first mode. Two cameras see it from {setting.distance_mm:g} mm "
        f"({{doc}}`case 1 <executed/{SET}>`).\n\n" + table(header, rows) + "\n"
        f"The last column adds up to {np.sum(g**2 * variance):.3f} mm². The law therefore gives "
        f"{law:.3f} mm, with the small change of *g* that the program keeps. The rms of the "
        f"{len(errors)} trials in the cube is {drawn:.3f} mm; so few know it to a few percent.\n"
    )


def scatter(opened: Cubes) -> str:
    """How far the trials' errors of beam and plate lie from the law."""
    rows = []
    for subject in ("beam", "plate"):
        cubes = of_subject(opened, subject)
        if not cubes:  # of another chapter's book
            continue
        ratios = [(c["mean_error"][..., 1:] / c["predicted_error"]).values.ravel() for c in cubes]
        shares = np.nanquantile(np.concatenate(ratios), [0.05, 0.5, 0.95])
        rows.append([subject, *(f"{share:.2f}" for share in shares)])
    header = ["error / law", "5 % of trials below", "half below", "95 % below"]
    return table(header, rows) if rows else ""


PIECES = {"rounding-example": example, "rounding-scatter": scatter}
