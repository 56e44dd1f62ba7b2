"""Times of the library alone and next to direct implementations; nothing of them is published.

Calls that are compared take turns, so that a busy minute slows all of them; ratios are medians
over the rounds.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from benchmarks.reference import distances, field_of_distances, svd_triangulate
from thesis_lib.acoustics.planes import Plane, full_factor, plane_operator, plate_pistons
from thesis_lib.acoustics.radiation import AIR, rayleigh_pressure
from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment.figure_set import ExperimentResolution
from thesis_lib.figure_sets.parametric import compute as studies, sound
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.figure_set import PlateSoundStudy, camera_study
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.laboratory.render import BeamView
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.measure.calibration.bundle_adjustment import adjust_bundle
from thesis_lib.measure.tracking.homography import find_view
from thesis_lib.measure.tracking.tracker import Tracker, sharpen_view
from thesis_lib.vibration.structure import resonance_frequency
from thesis_lib.vision import pinhole
from thesis_lib.vision.analytic_centre import analytic_centre, joint_centre
from thesis_lib.vision.interval import interval_estimate
from thesis_lib.vision.pinhole import hemisphere_cameras, pixelate, project
from thesis_lib.vision.triangulation import triangulate

SIZE = (320, 180)
FOCAL_PX = 24 / 36 * SIZE[0]

Calls = Mapping[str, Callable[[], object]]
Line = tuple[str, float, str]  # a name, seconds, and a remark


def images(n_cameras: int, n_points: int) -> tuple[Array, Array]:
    """Cameras over an arc of 100° at 500 mm, and whole-pixel images of points on a moving beam."""
    rng = np.random.default_rng(0)
    azimuth = np.radians(np.linspace(-50, 50, n_cameras))
    elevation = np.radians(np.linspace(15, 40, n_cameras))
    P = hemisphere_cameras(0.5, azimuth, elevation, FOCAL_PX, SIZE).P
    limits = np.array([0.312, 0.015, 0.0055])[:, None]
    points = rng.uniform(-limits, limits, (3, n_points))
    return P, pixelate(project(P, points))


def time_call(work: Callable[[], object]) -> float:
    """Wall time of one call in s."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def compare(calls: Calls, repetitions: int = 5) -> Iterator[Line]:
    """Median time of each call, how many times as long as the first, and its peak memory."""
    for call in calls.values():
        call()
    spent = np.array([[time_call(c) for c in calls.values()] for _ in range(repetitions)])
    ratios = np.median(spent / spent[:, :1], axis=0)
    for (name, call), seconds, ratio in zip(
        calls.items(), np.median(spent, 0), ratios, strict=True
    ):
        yield name, float(seconds), f"× {ratio:.3g}, {peak_memory(call):.0f} MiB"


def peak_memory(work: Callable[[], object]) -> float:
    """Largest traced allocation of one call, result included, in MiB."""
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 2**20


def triangulation_calls(n_cameras: int, n_points: int = 100_000) -> Calls:
    """The library and the reference, which has either all left factors of the SVD or few."""
    P, uv = images(n_cameras, n_points)
    return {
        f"{n_points} points in {n_cameras} cameras": lambda: triangulate(P, uv),
        "by SVD": lambda: svd_triangulate(P, uv),
        "by SVD without full matrices": lambda: svd_triangulate(P, uv, full_matrices=False),
    }


def centre_calls(n_cameras: int, n_points: int = 20_000) -> Calls:
    """Analytic centre, least squares, SVD, posterior mean; and centres of pairs of images."""
    P, uv = images(n_cameras, n_points)
    pairs = np.repeat(uv[:, :, None, : n_points // 2], 2, axis=2)
    return {
        f"analytic centre of {n_points} points in {n_cameras} cameras": lambda: analytic_centre(
            P, uv
        ),
        "joint centre of half as many pairs": lambda: joint_centre(P, pairs),
        "least squares": lambda: triangulate(P, uv),
        "by SVD": lambda: svd_triangulate(P, uv),
        "interval": lambda: interval_estimate(P, uv),
    }


def field_calls(name: str) -> Calls:
    """The field of one velocity vector on a plane; the distances are given to the direct way."""
    plate = setups.thesis_plate()
    plane = Plane("XZ" if name == "XZ" else "YZ", 0.334, 0.0445, 0.443, (149, 99))
    omega, parts, points = resonance_frequency(plate, 1), plate_pistons(plate), plane.points
    v = np.random.default_rng(0).normal(size=(2, 150)).T @ np.array([1, 1j])
    R = distances(parts, points)
    return {
        f"field on plane {name}, directly": lambda: field_of_distances(parts, R, v, omega, AIR),
        "by the plane's operator": lambda: plane_operator(plate, plane, omega).field(v),
        "by Rayleigh's integral": lambda: rayleigh_pressure(parts, v, points, omega),
    }


def plate_of(study: PlateSoundStudy) -> CameraStudy:
    """The plate's study whose deflections a sound study takes."""
    name: str = study.name.replace("sound", "plate")  # type: ignore[attr-defined]
    return camera_study(name, study.plate_request)


def plane_error_calls(trials: int = 200) -> Calls:
    """All plane errors of ``sound-distance`` from factors, and one of their fields in two ways."""
    study = camera_study("sound-distance", {"trials": trials})
    assert isinstance(study, PlateSoundStudy)
    plate, cube = setups.thesis_plate(study.grid), studies.run(plate_of(study))
    reference = cube["reference_deflection"].values
    errors = cube["measured_deflection"].values.astype(float) - reference[:, None]
    omegas = [resonance_frequency(plate, mode) for mode in study.modes]

    def by_factors() -> None:
        for m, omega in enumerate(omegas):
            for plane in study.planes:
                factor = full_factor(plane_operator(plate, plane, omega))
                np.linalg.norm(errors[:, m] @ factor.T, axis=-1)

    plane, v = study.planes[0], 1j * omegas[0] * errors[0, 0, 0]
    ready, parts = plane_operator(plate, plane, omegas[0]), plate_pistons(plate)
    fields = errors[..., 0].size * len(study.planes)
    return {
        f"all {fields} plane errors of sound-distance": by_factors,
        "one of their fields by Rayleigh's integral": lambda: rayleigh_pressure(
            parts, v, plane.points, omegas[0]
        ),
        "one of their fields by the ready operator": lambda: ready.field(v),
    }


def time_studies(trials: int = 200) -> Iterator[Line]:
    """Each study of a structure with so many trials; of sound, given the plate's cubes."""
    for name in STUDIES:
        if name.startswith(("beam-", "plate-", "sound-")):
            study = camera_study(name, {"trials": trials})
            if isinstance(study, PlateSoundStudy):
                plate = studies.run(plate_of(study))
                seconds = time_call(partial(sound.run, study, plate))
            else:
                seconds = time_call(partial(studies.run, study))
            yield name, seconds, f"{trials} trials"


def time_laboratory(frames: int = 30) -> Iterator[Line]:
    """Render and track one camera's frames of 1920×1080, and adjust four cameras, on one core."""
    cv2.setNumThreads(1)
    setup = default_rig(setups.thesis_beam(), list(ExperimentResolution().directions_deg.values()))
    station = setup.stations[0]
    pictures = []
    for samples in (1, 8):
        sensor = replace(station.sensor, samples=samples)
        view = BeamView(station.camera, setup.markers, setup.motion, sensor)
        times = setup.motion.start + np.arange(frames) / station.frame_rate
        start = time.perf_counter()
        pictures = [view.frame(t, setup.generator(1, 0, k)) for k, t in enumerate(times)]
        seconds = (time.perf_counter() - start) / frames
        yield "a frame rendered", seconds, f"{samples} positions within the exposure"
    found = find_view(pictures[0], station.camera, setup.markers)
    tracker = Tracker(sharpen_view(pictures[0], found))
    spent = [time_call(partial(tracker.centres, frame)) for frame in pictures]
    yield "its markers tracked", statistics.median(spent), f"{setup.markers.centres.shape[1]}"
    corners, rng = setup.board.corners, np.random.default_rng(0)
    poses = list(zip(setup.rotations, setup.translations, strict=True))
    seen = np.array(
        [
            [pinhole.project_points(c, R @ corners + t[:, None]) for R, t in poses]
            for c in setup.cameras
        ]
    )
    seen += 0.005 * rng.standard_normal(seen.shape)
    off = np.array([[1.01, 1, 1], [1, 1.01, 1], [1, 1, 1]])
    rough = [replace(camera, K=camera.K * off) for camera in setup.cameras]
    spent = [time_call(lambda: adjust_bundle(seen, corners, rough)) for _ in range(5)]
    yield "4 cameras and 12 boards adjusted", statistics.median(spent), ""


def time_commands() -> Iterator[Line]:
    """Commands that compute nothing, chapter 5 never rendered before, and an own recording."""
    with tempfile.TemporaryDirectory() as parent:
        example, chapter = Path(parent, "example"), Path(parent, "ch5")
        for arguments in (
            ["list"],
            ["run", "beam-distance", "-p", "trials=-1"],
            ["run", "ch5", "-p", f"seed={int(time.time())}", "--out", str(chapter)],
            ["measure", "--example", str(example)],
            ["measure", str(example / "manifest.yaml")],
            ["measure", str(example / "manifest.yaml")],
        ):
            yield f"thesis {' '.join(arguments[:3])}", *time_command(arguments)


def time_command(arguments: list[str]) -> tuple[float, str]:
    """Wall time of a command, with its exit status and largest resident memory."""
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "thesis_lib", *arguments],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    memory = f"{used.ru_maxrss / 1024:.0f} MiB"
    return time.perf_counter() - start, f"exit status {process.returncode}, {memory}"


def measure_growth() -> Iterator[tuple[str, list[int], list[float], float]]:
    """Time against points (4 cameras), cameras (10 000 points) and trials (case 1), exponent."""

    def points(n: int) -> Callable[[], object]:
        P, uv = images(4, n)
        return lambda: triangulate(P, uv)

    def cameras(n: int) -> Callable[[], object]:
        P, uv = images(n, 10_000)
        return lambda: triangulate(P, uv)

    def trials(n: int) -> Callable[[], object]:
        study = camera_study("beam-distance", {"trials": n})
        return partial(studies.run, study)

    for prepare, sizes in (
        (points, [10**3, 10**4, 10**5, 10**6]),
        (cameras, [2, 6, 20, 60, 200]),
        (trials, [10, 30, 100, 300, 1000, 3000]),
    ):
        spent = []
        for work in map(prepare, sizes):
            work()
            spent.append(statistics.median(time_call(work) for _ in range(3)))
        exponent = float(np.polyfit(np.log(sizes), np.log(spent), 1)[0])
        yield prepare.__name__, sizes, spent, exponent


def print_all() -> None:
    """Print all of these times."""
    parts: list[tuple[str, Iterator[Line]]] = [
        *(("Triangulation", compare(triangulation_calls(n))) for n in (2, 4, 12)),
        *(("Analytic centre", compare(centre_calls(n))) for n in (2, 4, 12, 64)),
        ("Studies", time_studies()),
        ("Plane errors", compare(plane_error_calls())),
        *(("Field of 149 × 99 points", compare(field_calls(n), 15)) for n in ("XZ", "YZ")),
        ("Laboratory", time_laboratory()),
        ("Commands", time_commands()),
    ]
    for title, lines in parts:
        print(f"\n{title}")
        for name, seconds, remark in lines:
            print(f"{1000 * seconds:>10.4g} ms  {name}  ({remark})")
    print("\nGrowth")
    for name, sizes, spent, exponent in measure_growth():
        pairs = zip(sizes, spent, strict=True)
        times = "  ".join(f"{size}: {1000 * seconds:.3g} ms" for size, seconds in pairs)
        print(f"{name:>8}^{exponent:.2f}   {times}")
