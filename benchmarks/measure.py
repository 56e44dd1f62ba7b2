"""What is timed: triangulation beside its reference, the beam studies, growth, commands."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.reference import svd_triangulate
from thesis_lib import studies
from thesis_lib.cameras import hemisphere_cameras, pixelate, project
from thesis_lib.parameters import STUDIES, validate
from thesis_lib.triangulation import triangulate

Array = NDArray[np.float64]
SIZE = (320, 180)
FOCAL_PX = 24 / 36 * SIZE[0]


@dataclass(frozen=True)
class Comparison:
    """Triangulation of the same images by the library and by the reference.

    Rates are medians in million points per second; ratios are medians over interleaved pairs.
    """

    n_cameras: int
    rate: float
    rate_svd: float
    rate_thin: float
    ratio_svd: float
    ratio_thin: float
    difference: float
    memory: float


def images(n_cameras: int, n_points: int) -> tuple[Array, Array]:
    """Cameras over an arc of 100° at 500 mm, and whole-pixel images of points on a moving beam."""
    rng = np.random.default_rng(0)
    azimuth = np.radians(np.linspace(-50, 50, n_cameras))
    elevation = np.radians(np.linspace(15, 40, n_cameras))
    P = hemisphere_cameras(0.5, azimuth, elevation, FOCAL_PX, SIZE).P
    limits = np.array([0.312, 0.015, 0.0055])[:, None]
    points = rng.uniform(-limits, limits, (3, n_points))
    return P, pixelate(project(P, points))


def seconds(work: Callable[[], object]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def peak_memory(work: Callable[[], object]) -> float:
    """Largest traced allocation of one call, result included, in MiB."""
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 2**20


def compare_triangulation(
    n_cameras: int, n_points: int = 100_000, repetitions: int = 5
) -> Comparison:
    """Library and both variants of the reference, one after the other, several times.

    The library is so much shorter that each time it is called five times for one median, lest
    one interruption decide.
    """
    P, uv = images(n_cameras, n_points)
    calls: tuple[Callable[[], Array], ...] = (
        lambda: triangulate(P, uv),
        lambda: svd_triangulate(P, uv),
        lambda: svd_triangulate(P, uv, full_matrices=False),
    )
    results = [call() for call in calls]  # also warms up
    times = np.array(
        [
            [statistics.median(seconds(calls[0]) for _ in range(5)), *map(seconds, calls[1:])]
            for _ in range(repetitions)
        ]
    )
    rate, rate_svd, rate_thin = (n_points / np.median(times, axis=0) / 1e6).tolist()
    ratio_svd, ratio_thin = np.median(times[:, 1:] / times[:, :1], axis=0).tolist()
    return Comparison(
        n_cameras,
        rate,
        rate_svd,
        rate_thin,
        ratio_svd,
        ratio_thin,
        difference=max(float(np.max(np.abs(results[0] - other))) for other in results[1:]),
        memory=peak_memory(calls[0]),
    )


def study_seconds(trials: int = 200) -> dict[str, float]:
    """Seconds to compute each beam study."""
    times = {}
    for name in STUDIES:
        if name.startswith("beam-"):
            study = validate(name, {"trials": trials})
            start = time.perf_counter()
            studies.run(study)
            times[name] = time.perf_counter() - start
    return times


@dataclass(frozen=True)
class Growth:
    """Time against size."""

    what: str
    sizes: list[int]
    seconds: list[float]

    @property
    def exponent(self) -> float:
        """Slope of the straight line through the logarithms."""
        return float(np.polyfit(np.log(self.sizes), np.log(self.seconds), 1)[0])


def grow(what: str, sizes: list[int], prepare: Callable[[int], Callable[[], object]]) -> Growth:
    """Median of three calls at every size, after one that warms up."""
    times = []
    for size in sizes:
        work = prepare(size)
        work()
        times.append(statistics.median(seconds(work) for _ in range(3)))
    return Growth(what, sizes, times)


def growth() -> list[Growth]:
    """Time against points (4 cameras), cameras (10 000 points) and trials (case 1)."""

    def triangulation(n_cameras: int, n_points: int) -> Callable[[], object]:
        P, uv = images(n_cameras, n_points)
        return lambda: triangulate(P, uv)

    def study(trials: int) -> Callable[[], object]:
        parameters = validate("beam-distance", {"trials": trials})
        return lambda: studies.run(parameters)

    return [
        grow("points", [10**3, 10**4, 10**5, 10**6], lambda n: triangulation(4, n)),
        grow("cameras", [2, 6, 20, 60, 200], lambda n: triangulation(n, 10_000)),
        grow("trials", [10, 30, 100, 300, 1000, 3000], study),
    ]


def command_seconds(*arguments: str, repetitions: int = 5) -> tuple[float, int]:
    """Median wall time of a ``thesis`` command, and its exit status."""
    command = [sys.executable, "-m", "thesis_lib", *arguments]
    times, status = [], 0
    for _ in range(repetitions):
        start = time.perf_counter()
        status = subprocess.run(command, capture_output=True, check=False).returncode
        times.append(time.perf_counter() - start)
    return statistics.median(times), status
