"""What is timed of the analytic centre: points, beside posterior means and least squares."""

from __future__ import annotations

import statistics
from dataclasses import dataclass

import numpy as np

from benchmarks.measure import images, peak_memory, seconds
from benchmarks.reference import svd_triangulate
from thesis_lib.vision.analytic_centre import analytic_centre, joint_centre
from thesis_lib.vision.interval import interval
from thesis_lib.vision.triangulation import triangulate


@dataclass(frozen=True)
class CentreComparison:
    """Times of the same images' points in µs each, medians; ratios are of interleaved pairs.

    `joint` is the time of a pair of images with common x and y; `ratio_svd` centre over SVD,
    `ratio_centre` interval over centre; `memory` that of one call in MiB.
    """

    n_cameras: int
    centre: float
    joint: float
    least_squares: float
    svd: float
    interval: float
    ratio_svd: float
    ratio_centre: float
    memory: float


def compare(n_cameras: int, n_points: int = 20_000, repetitions: int = 5) -> CentreComparison:
    """Analytic and joint centre, least squares, batched SVD, posterior mean: in turns."""
    P, uv = images(n_cameras, n_points)
    pairs = np.repeat(uv[:, :, None, : n_points // 2], 2, axis=2)
    calls = (
        lambda: analytic_centre(P, uv),
        lambda: joint_centre(P, pairs),
        lambda: triangulate(P, uv),
        lambda: svd_triangulate(P, uv),
        lambda: interval(P, uv),
    )
    for call in calls:
        call()
    times = np.array([[seconds(call) for call in calls] for _ in range(repetitions)])
    to_svd, to_centre = (
        statistics.median((times[:, i] / times[:, j]).tolist()) for i, j in ((0, 3), (4, 0))
    )
    times[:, 1] *= 2  # half as many points
    middle, joint, least_squares, svd, mean = (1e6 * np.median(times, axis=0) / n_points).tolist()
    memory = peak_memory(calls[0])
    return CentreComparison(
        n_cameras, middle, joint, least_squares, svd, mean, to_svd, to_centre, memory
    )
