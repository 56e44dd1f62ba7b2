"""What is timed of the laboratory: rendering, tracking, adjustment, the chapter from nothing."""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from thesis_lib.facts import setups
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.experiment.parameters import ExperimentResolution
from thesis_lib.files import project_root
from thesis_lib.laboratory.render import BeamView
from thesis_lib.laboratory.rig import Rig, default_rig
from thesis_lib.measure.calibration.bundle_adjustment import adjust
from thesis_lib.measure.tracking.homography import find_view
from thesis_lib.measure.tracking.tracker import Tracker, sharpen
from thesis_lib.vision import lens


def rig() -> Rig:
    """The default rig: four cameras of 1920×1080."""
    return default_rig(setups.beam(), list(ExperimentResolution().directions_deg.values()))


@dataclass(frozen=True)
class Frames:
    """Frames per second that are rendered, still and with motion blur; ms to track one."""

    still: float
    blurred: float
    tracking: float


def frames(count: int = 30) -> Frames:
    """Render and track one camera's frames on one core."""
    cv2.setNumThreads(1)
    setup = rig()
    station = setup.stations[0]
    rates, pictures = {}, []
    for samples in (1, 8):
        sensor = replace(station.sensor, samples=samples)
        view = BeamView(station.camera, setup.markers, setup.motion, sensor)
        times = setup.motion.start + np.arange(count + 1) / station.frame_rate
        pictures = [view.frame(times[0], setup.generator(1, 0, 0))]
        start = time.perf_counter()
        pictures += [view.frame(t, setup.generator(1, 0, k)) for k, t in enumerate(times[1:], 1)]
        rates[samples] = count / (time.perf_counter() - start)
    view_of_beam = sharpen(pictures[0], find_view(pictures[0], station.camera, setup.markers))
    tracker = Tracker(view_of_beam)
    spent = []
    for picture in pictures:
        start = time.perf_counter()
        tracker.centres(picture)
        spent.append(time.perf_counter() - start)
    return Frames(rates[1], rates[8], 1000 * statistics.median(spent))


def adjustment_seconds(repetitions: int = 5) -> float:
    """Seconds to adjust four cameras and twelve boards of 64 corners."""
    setup = rig()
    rng = np.random.default_rng(0)
    corners = setup.board.corners
    seen = np.array(
        [
            [
                lens.project(camera, R @ corners + t[:, None])
                for R, t in zip(setup.rotations, setup.translations, strict=True)
            ]
            for camera in setup.cameras
        ]
    )
    seen += 0.005 * rng.standard_normal(seen.shape)
    rough = [
        replace(camera, K=camera.K * np.array([[1.01, 1, 1], [1, 1.01, 1], [1, 1, 1]]))
        for camera in setup.cameras
    ]
    spent = []
    for _ in range(repetitions):
        start = time.perf_counter()
        adjust(seen, corners, rough)
        spent.append(time.perf_counter() - start)
    return statistics.median(spent)


def chapter(*parameters: str) -> tuple[float, float, float]:
    """Both notebooks from nothing.

    Returns
    -------
    tuple of float
        Seconds; the largest resident memory of a process in MiB; the error of the harmonic fit
        with four cameras at 1920×1080 in %.
    """
    cache = project_root() / "build" / "cache"
    before = set(cache.glob("laboratory-*"))
    seed = int(time.time())  # never filmed before
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "thesis_lib", "run", "ch5"]
        for parameter in (f"seed={seed}", *parameters):
            command += ["-p", parameter]
        start = time.perf_counter()
        subprocess.run([*command, "--out", str(Path(folder) / "ch5")], check=True,
                       capture_output=True)  # fmt: skip
        seconds = time.perf_counter() - start
        cube = cube_file.read(Path(folder) / "ch5" / "experiment-cameras.nc")
    for left in set(cache.glob("laboratory-*")) - before:
        left.unlink()
    chosen = (cube["case"].values == "harmonic") & (cube["n_cameras"].values == 4)
    error = float(cube["mean_error"].values[chosen, 0, 0][0])
    return seconds, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024, error
