"""Markers followed through a recording of any length, on disk as they are found.

Centres go to a file that is read back in parts; beside it stands how far the tracker has come and
what it knew there, so that a recording that was stopped in the middle goes on from there.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.files import whole_text
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.board import Markers
from thesis_lib.measure.recordings.manifest import CameraFiles
from thesis_lib.measure.recordings.media_info import MediaError
from thesis_lib.measure.tracking.follow import pictures_of, trackers_of
from thesis_lib.measure.tracking.homography import TrackingError, as_dark
from thesis_lib.measure.tracking.tracker import Tracker
from thesis_lib.vision.pinhole import Camera, undistort_tracks

FRAMES_PER_STATE = 100  # frames after which the state is written
CHUNK_FRAMES = 512  # frames that are read back at once


@dataclass(frozen=True)
class Recording:
    """One camera, its clock and its tracks."""

    camera: Camera  #: Calibrated
    rate: float  #: Frames per second
    delay: float  #: Start after the reference camera's, s
    exposure: float  #: Exposure time in s
    #: Time from the first row's exposure to the last row's, s; a frame's time is the middle row's
    readout: float
    #: File of the centres (frames, 2, markers) in px, lens distortion included, NaN where missing
    path: Path
    notes: Sequence[str] = ()  #: What went wrong on the way
    stamps: Array | None = None  #: Times of the frames by the camera's own clock, s; None: k / rate
    pace: float = 1.0  #: Seconds of the reference's clock for one of its own

    @property
    def times(self) -> Array:
        """Return the times of all frames on the reference's clock, s."""
        own = self.stamps if self.stamps is not None else np.arange(len(self.centres)) / self.rate
        return own * self.pace + self.delay

    def paced(self, pace: float, at: float) -> Recording:
        """Return the recording with a clock that runs this much slower, and is right at a time."""
        return replace(self, pace=self.pace * pace, delay=at + (self.delay - at) * pace)

    @property
    def centres(self) -> Array:
        """The centres, mapped from the file."""
        return np.load(self.path, mmap_mode="r")

    def between(self, begin: float, end: float) -> tuple[int, int]:
        """Return the first frame from a time on and the last before another, reference clock."""
        slack = 1e-6 / self.rate
        first, last = np.searchsorted(self.times, [begin - slack, end + slack])
        return int(first), int(last)

    def parts(self, begin: float, end: float) -> Iterator[tuple[Array, Array]]:
        """Yield times (n,) in s and undistorted centres (n, 2, markers), some frames at once."""
        first, last = self.between(begin, end)
        for start in range(first, last, CHUNK_FRAMES):
            stop = min(start + CHUNK_FRAMES, last)
            uv = undistort_tracks(self.camera, self.centres[start:stop])
            yield self.times[start:stop], uv

    def read_tracks(self, begin: float, end: float) -> tuple[Array, Array]:
        """Return times (n,) in s and undistorted centres (n, 2, markers), all frames at once."""
        first, last = self.between(begin, end)
        return self.times[first:last], undistort_tracks(self.camera, self.centres[first:last])


def record_track(
    files: CameraFiles,
    folder: Path,
    clock: Array,
    camera: Camera,
    markers: Markers,
    turn: float,
    path: Path,
    key: str,
    tick: Callable[[int], object],
    shares: Sequence[float] = (),
) -> list[str]:
    """Follow the markers through a camera's video into a file, from where an earlier run stopped.

    The video is in the manifest's folder; `clock` (frames,) are the times of its frames after the
    first, s. Centres go to `path` (``.npy``), and `key` is that of all that they depend on: what a
    run with another key has left is not used. `tick` is called with the number of frames done since
    the last call.

    `turn` and `shares`, and the notes returned, are those of :func:`~.follow.trackers_of`. With
    shares the file holds (frames, 2 shares, 2, markers): the centres at each width, then those by
    the template match alone, where Appendix F stops.

    Raises
    ------
    MediaError
        If the video cannot be read.
    TrackingError
        If the structure or its markers are not found in the first frame.
    """
    video, count = folder / files.video, len(clock)
    note = path.with_suffix(".json")
    shape = (*([2 * len(shares)] if shares else []), 2, markers.count)
    frame = 8 * math.prod(shape)  # bytes
    state = _state(note, path, key, count, frame)
    done = state["done"] if state else 0
    tick(done)
    if done == count:
        return list(state["notes"]) if state else []
    first = as_dark(next(media.read_frames(video, 0, 1)), markers)
    try:
        trackers, notes = trackers_of(first, camera, markers, files.corners_px, turn, shares)
    except TrackingError as error:
        advice = "are structure.markers and corners_px as filmed?"
        if not files.corners_px:
            advice = (
                "are structure.markers as filmed? If so, the light may be uneven: click the "
                "corners in the page that thesis measure --check writes, and give corners_px"
            )
        raise TrackingError(f"{video}: frame 0: {error}; {advice}") from None
    if state:
        for tracker, moved, before in zip(trackers, state["moved"], state["before"], strict=True):
            tracker.moved, tracker.before = np.array(moved), np.array(before)
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
        note.unlink(missing_ok=True)
        np.lib.format.open_memmap(path, "w+", np.float64, shape=(count, *shape))
    written = _digest(path, (count - done) * frame)
    with path.open("r+b") as file:  # not mapped: a full disk would kill the process
        file.seek((done - count) * frame, os.SEEK_END)
        for image in islice(media.read_frames(video, done, clock=clock), count - done):
            pictures = pictures_of(as_dark(image, markers), shares)
            found = [own.centres(picture) for own, picture in zip(trackers, pictures, strict=True)]
            found += [tracker.matched for tracker in trackers if isinstance(tracker, Tracker)]
            centres = np.array(found).tobytes()
            file.write(centres)
            written.update(centres)
            done += 1
            tick(1)
            if done % FRAMES_PER_STATE == 0 or done == count:
                file.flush()
                os.fsync(file.fileno())
                so_far = {
                    "key": key,
                    "done": done,
                    "notes": notes,
                    "moved": [tracker.moved.tolist() for tracker in trackers],
                    "before": [tracker.before.tolist() for tracker in trackers],
                    "digest": written.hexdigest(),
                }
                whole_text(note, json.dumps(so_far))
    if done < count:
        raise MediaError(f"{video}: ends before frame {done}, the file lists {count}")
    return notes


def share_lost(recording: Recording) -> Array:
    """Return the share of the frames in which each marker is missing, shape (markers,)."""
    missing, count = np.zeros(recording.centres.shape[2]), len(recording.centres)
    for start in range(0, count, CHUNK_FRAMES):
        missing += np.isnan(recording.centres[start : start + CHUNK_FRAMES, 0]).sum(axis=0)
    return missing / count


def _state(note: Path, path: Path, key: str, count: int, frame: int) -> dict[str, Any] | None:
    """Return the state of an earlier run, if it is of the same key and undamaged."""
    try:
        state = json.loads(note.read_text(encoding="utf-8"))
        fits = state["key"] == key and len(np.load(path, mmap_mode="r")) == count
        if not (fits and 0 < state["done"] <= count):
            return None
        left = (count - state["done"]) * frame
        return state if _digest(path, left).hexdigest() == state["digest"] else None
    except (OSError, EOFError, ValueError, KeyError, TypeError):
        return None


def _digest(path: Path, left: int) -> Any:
    """Return SHA-256 of a file but for its last bytes, to be continued by what is written there."""
    digest, size = hashlib.sha256(), path.stat().st_size - left
    with path.open("rb") as file:
        while piece := file.read(min(size, 1 << 20)):
            digest.update(piece)
            size -= len(piece)
    return digest
