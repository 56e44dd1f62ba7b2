"""Markers followed through the same frames by the library and by its peers, with known truth.

One rendered camera of 1280×720: a beam at rest, a ramp, and steady frames, without noise, with it,
as H.264 leaves them, and with a hand before some markers. Times are processor time, one thread;
trackers take turns and have what they need once a video ready. Peers are told where the markers
are in the first frame.
"""

from __future__ import annotations

import datetime
import tempfile
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.limits import processor_seconds
from thesis_lib.arrays import Array, Image
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment.figure_set import ExperimentResolution
from thesis_lib.laboratory.render import BeamView
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.tracking.follow import Follower
from thesis_lib.measure.tracking.homography import View, find_view
from thesis_lib.measure.tracking.tracker import Tracker, sharpen_view
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vision import pinhole

SIZE, RATE, REST, RAMP = (1280, 720), 60.0, 2, 15  # px, Hz, frames
HAND = slice(500, 640)  # columns of pixels
LOST = 0.1  # px by which an amplitude may be off before it counts as lost
FILMS: dict[str, dict[str, Any]] = {
    "without noise": {"noise": False},
    "with noise": {},
    "H.264, crf 23": {"crf": 23},
    "markers covered": {"covered": True},
}
WINDOWS = ((17, 31), (21, 21), (9, 9))  # rows and columns that Lucas and Kanade's method sees


@dataclass(frozen=True)
class Filmed:
    """Frames, how the camera sees the beam, times in s and true centres (frames, 2, markers)."""

    frames: list[Image]
    view: View
    times: Array
    truth: Array

    @property
    def first(self) -> Array:
        """Centres in the first frame as they are found there."""
        return Tracker(self.view).centres(self.frames[0])


Prepare = Callable[[Filmed], Callable[[], Array]]


def filmed(
    steady: int,
    noise: bool = True,
    crf: int | None = None,
    covered: bool = False,
    tip: float = Component.amplitude,
) -> Filmed:
    """The recording; `crf` is that of H.264, None for lossless frames; `tip` in m."""
    setup = default_rig(setups.thesis_beam(), list(ExperimentResolution().directions_deg.values()))
    station, markers = setup.stations[0], setup.markers
    motion = Motion(setups.thesis_beam(), (Component(amplitude=tip),), 0.0, RAMP / RATE)
    camera = pinhole.resize_camera(station.camera, SIZE)
    light = BeamView(camera, markers, motion, station.sensor)
    times = np.arange(-REST, RAMP + steady) / RATE
    rng = np.random.default_rng(0) if noise else None
    frames = [light.frame(t, rng) for t in times]
    if covered:  # for a third of the steady frames, as a hand would, some of the picture's width
        for frame in frames[-2 * steady // 3 : -steady // 3]:
            frame[:, HAND] = 90
    if crf is not None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "film.mkv"
            media.write_video(path, frames, RATE, np.zeros(800), codec="h264", crf=crf)
            frames = list(media.read_frames(path))
    points = markers.centres
    world = on_surface(markers.extent, points[:, None], motion.deflection(points, times))
    truth = pinhole.project_points(camera, world).swapaxes(0, 1)
    return Filmed(
        frames, sharpen_view(frames[0], find_view(frames[0], camera, markers)), times, truth
    )


def follower(f: Filmed) -> Callable[[], Array]:
    turn = 2 * np.pi * Component().frequency / RATE
    at_rest = Follower(Tracker(f.view, turn), f.frames[0])

    def follow() -> Array:
        own = copy(at_rest)
        return np.array([own.centres(frame) for frame in f.frames])

    return follow


def _pyramid(f: Filmed) -> Callable[[], Array]:
    """OpenCV's pyramidal Lucas–Kanade, from the first frame to each, begun where it was before."""
    first = f.first
    start = (first.T - pinhole.HALF_PIXEL).astype(np.float32)[:, None]

    def follow() -> Array:
        found: list[Array] = []
        places: Any = start
        for frame in f.frames:
            places, seen, _ = cv2.calcOpticalFlowPyrLK(
                f.frames[0], frame, start, places.copy(), winSize=(21, 21),
                flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            )  # fmt: skip
            found.append(np.where(seen.ravel() > 0, places[:, 0].T, np.nan) + pinhole.HALF_PIXEL)
        return np.array(found, float)

    return follow


def _pyidi(window: tuple[int, int]) -> Prepare:
    def prepare(f: Filmed) -> Callable[[], Array]:
        import numba
        from pyidi import LucasKanade, VideoReader

        numba.set_num_threads(1)
        first = f.first
        method = LucasKanade(VideoReader(np.array(f.frames), root=tempfile.mkdtemp()))
        method.set_points((first - pinhole.HALF_PIXEL)[::-1].T)
        method.configure(roi_size=window, verbose=0, show_pbar=False)

        def follow() -> Array:
            moved = method.get_displacements(autosave=False)
            return np.asarray(first + moved.transpose(1, 2, 0)[:, ::-1])

        return follow

    return prepare


@dataclass(frozen=True)
class Followed:
    """One tracker on one recording."""

    film: str
    by: str
    milliseconds: list[float]  #: Of a marker and frame, one a round
    amplitude_error: float  #: rms over the markers that are not lost, px
    told: float  #: Share of the amplitudes that are NaN
    untold: float  #: Share that are lost, see :data:`LOST`, without a word


def contenders() -> dict[str, Prepare]:
    """Trackers that are installed, by name."""
    found: dict[str, Prepare] = {"thesis_lib": follower, "OpenCV PyrLK, 21×21": _pyramid}
    try:
        import pyidi  # noqa: F401
    except ImportError:
        return found
    for rows, columns in WINDOWS:
        found[f"pyIDI Lucas–Kanade, {rows}×{columns}"] = _pyidi((rows, columns))
    return found


def compare(steady: int = 90, rounds: int = 5) -> Iterator[Followed]:
    """All trackers on all films."""
    cv2.setNumThreads(1)
    for film, how in FILMS.items():
        f = filmed(steady, **how)
        calls = {name: prepare(f) for name, prepare in contenders().items()}
        found = {name: call() for name, call in calls.items()}  # warms up, too
        spent: dict[str, list[float]] = {name: [] for name in calls}
        images = len(f.frames) * f.truth.shape[2]
        for _ in range(rounds):
            for name, call in calls.items():
                spent[name].append(1e3 * processor_seconds(call) / images)
        true = amplitudes(f, f.truth)
        for name, tracks in found.items():
            off = np.hypot(*np.abs(amplitudes(f, tracks) - true))
            kept = off < LOST
            yield Followed(
                film, name, spent[name], float(np.sqrt(np.mean(off[kept] ** 2))),
                float(np.mean(np.isnan(off))), float(np.mean(off >= LOST)),
            )  # fmt: skip


def amplitudes(f: Filmed, tracks: Array) -> Array:
    """Complex amplitudes (2, markers) of the steady part in px; NaN if a frame is missing."""
    steady = slice(REST + RAMP, None)
    angle = 2 * np.pi * Component().frequency * f.times[steady]
    basis = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    _, c, s = np.tensordot(np.linalg.pinv(basis), tracks[steady], axes=1)
    return np.asarray(c - 1j * s)


def run() -> dict[str, Any]:
    """What was measured, for the book."""
    found = [asdict(one) for one in compare()]
    return {"tracking": {"date": datetime.datetime.now(datetime.UTC).date().isoformat(),
                         "rows": found}}  # fmt: skip
