"""What is timed of the analytic centre: points, beside least squares the direct way."""

from __future__ import annotations

import statistics
from dataclasses import dataclass

import numpy as np

from benchmarks.measure import images, peak_memory, seconds
from benchmarks.reference import svd_triangulate
from thesis_lib.vision.analytic_centre import analytic_centre, joint_centre
from thesis_lib.vision.triangulation import triangulate


@dataclass(frozen=True)
class CentreComparison:
    """Times of the same images' points in µs each, medians; the ratio is one of interleaved pairs.

    `joint` is the time of a pair of images with common x and y; `memory` that of one call in MiB.
    """

    n_cameras: int
    centre: float
    joint: float
    least_squares: float
    svd: float
    ratio_svd: float
    memory: float


def compare(n_cameras: int, n_points: int = 20_000, repetitions: int = 5) -> CentreComparison:
    """Analytic centre, joint centre, least squares and batched SVD, one after the other."""
    P, uv = images(n_cameras, n_points)
    pairs = np.repeat(uv[:, :, None, : n_points // 2], 2, axis=2)
    calls = (
        lambda: analytic_centre(P, uv),
        lambda: joint_centre(P, pairs),
        lambda: triangulate(P, uv),
        lambda: svd_triangulate(P, uv),
    )
    for call in calls:
        call()
    times = np.array([[seconds(call) for call in calls] for _ in range(repetitions)])
    ratio = statistics.median((times[:, 0] / times[:, 3]).tolist())
    times[:, 1] *= 2  # half as many points
    centre, joint, least_squares, svd = (1e6 * np.median(times, axis=0) / n_points).tolist()
    memory = peak_memory(calls[0])
    return CentreComparison(n_cameras, centre, joint, least_squares, svd, ratio, memory)
