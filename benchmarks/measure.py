"""What is timed: triangulation and sound beside their references, studies, growth, commands."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.reference import distances, field_of_distances, svd_triangulate
from thesis_lib.acoustics.planes import Plane, full_factor, operator, pistons
from thesis_lib.acoustics.radiation import rayleigh
from thesis_lib.acoustics.sources import AIR
from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric import sound
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.parameters import PlateSound, camera_study
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.vibration.structure import resonance
from thesis_lib.vision.pinhole import hemisphere_cameras, pixelate, project
from thesis_lib.vision.triangulation import triangulate

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


def _plate_of(study: PlateSound) -> CameraStudy:
    """The plate's study whose deflections a sound study takes."""
    name: str = study.name.replace("sound", "plate")  # type: ignore[attr-defined]
    return camera_study(name, study.plate_request)


def study_seconds(subject: str, trials: int = 200) -> dict[str, float]:
    """Seconds to compute each study of a structure; of sound, given the plate's cubes."""
    times = {}
    for name in STUDIES:
        if name.startswith(f"{subject}-"):
            study = camera_study(name, {"trials": trials})
            plate = studies.run(_plate_of(study)) if isinstance(study, PlateSound) else None
            start = time.perf_counter()
            if plate is None:
                studies.run(study)
            else:
                sound.run(study, plate)
            times[name] = time.perf_counter() - start
    return times


@dataclass(frozen=True)
class PlaneErrors:
    """All plane errors of a sound study, and the same by building every trial's field.

    Seconds of the versions that build fields are those of a sample of the fields, scaled; the
    difference is the largest over that sample, relative to the error.
    """

    fields: int
    sampled: int
    seconds: float
    direct_seconds: float
    kernel_seconds: float
    difference: float


def compare_plane_errors(trials: int = 200, sample: int = 12) -> PlaneErrors:
    """Plane errors of `sound-distance` from the factor of each plane, and from fields.

    The factors, and the operators that they come of, are part of the time. One field at a time
    is built by Rayleigh's integral as the library has it, or from the plane's ready operator.
    """
    study = camera_study("sound-distance", {"trials": trials})
    assert isinstance(study, PlateSound)
    plate = setups.plate(study.grid)
    cube = studies.run(_plate_of(study))
    reference = cube["reference_deflection"].values
    errors = cube["measured_deflection"].values.astype(float) - reference[:, None]
    omegas = [resonance(plate, mode) for mode in study.modes]

    def by_factors() -> Array:
        rms = np.empty((*errors.shape[:3], 2))
        for m, omega in enumerate(omegas):
            for p, plane in enumerate(study.planes):
                factor = full_factor(operator(plate, plane, omega))
                rms[:, m, :, p] = omega * np.linalg.norm(errors[:, m] @ factor.T, axis=-1)
        return rms

    by_factors()
    fast = statistics.median(seconds(by_factors) for _ in range(5))
    result = by_factors()
    rng = np.random.default_rng(0)
    chosen = [tuple(rng.integers(result.shape)) for _ in range(sample)]
    parts = pistons(plate)
    direct, kernel, apart = [], [], []
    for s, m, t, p in chosen:
        plane, omega, v = study.planes[p], omegas[m], 1j * omegas[m] * errors[s, m, t]
        ready, points = operator(plate, plane, omega), plane.points
        start = time.perf_counter()
        rms = _rms(rayleigh(parts, v, points, omega))
        middle = time.perf_counter()
        _rms(ready.field(v))
        direct.append(middle - start)
        kernel.append(time.perf_counter() - middle)
        apart.append(abs(rms / result[s, m, t, p] - 1))
    return PlaneErrors(
        fields=result.size,
        sampled=sample,
        seconds=fast,
        direct_seconds=statistics.median(direct) * result.size,
        kernel_seconds=statistics.median(kernel) * result.size,
        difference=max(apart),
    )


def _rms(pressure: ComplexArray) -> float:
    return float(np.sqrt(np.mean(np.abs(pressure) ** 2)))


@dataclass(frozen=True)
class FieldComparison:
    """Field of one velocity vector on one plane: milliseconds, ratios, difference over peak."""

    plane: str
    direct: float
    operator: float
    rayleigh: float
    ratio_operator: float
    ratio_rayleigh: float
    difference: float


def compare_field(name: str, repetitions: int = 15) -> FieldComparison:
    """Operator and its field, and plain Rayleigh, beside the direct expression with R given."""
    plate = setups.plate()
    plane = Plane("XZ" if name == "XZ" else "YZ", 0.334, 0.0445, 0.443, (149, 99))
    omega, parts, points = resonance(plate, 1), pistons(plate), plane.points
    rng = np.random.default_rng(0)
    v = rng.normal(size=(2, 150)).T @ np.array([1, 1j])
    R = distances(parts, points)
    calls: tuple[Callable[[], ComplexArray], ...] = (
        lambda: field_of_distances(parts, R, v, omega, AIR),
        lambda: operator(plate, plane, omega).field(v),
        lambda: rayleigh(parts, v, points, omega),
    )
    exact, *others = [call() for call in calls]
    times = np.array([[seconds(call) for call in calls] for _ in range(repetitions)])
    direct, folded, plain = (1000 * np.median(times, axis=0)).tolist()
    ratio_operator, ratio_rayleigh = np.median(times[:, :1] / times[:, 1:], axis=0).tolist()
    return FieldComparison(
        name,
        direct,
        folded,
        plain,
        ratio_operator,
        ratio_rayleigh,
        difference=max(float(np.max(np.abs(p - exact)) / np.max(np.abs(exact))) for p in others),
    )


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
        parameters = camera_study("beam-distance", {"trials": trials})
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
