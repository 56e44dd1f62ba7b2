"""Marker tracks of recordings of any length, written to disk frame by frame.

The file of centres is read back in parts: memory does not grow with the number of frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from thesis_lib.arrays import Array, IntArray
from thesis_lib.files import whole_file
from thesis_lib.measure.recordings import board, manifest, media, validation
from thesis_lib.measure.tracking import follow, homography
from thesis_lib.measure.tracking.tracker import Tracker
from thesis_lib.vision.pinhole import Camera, undistort_tracks

CHUNK_FRAMES = 512  # frames that are read back at once


@dataclass(frozen=True)
class Recording:
    """One camera, its clock and its tracks."""

    camera: Camera  #: Calibrated
    rate: float  #: Frames per second
    delay: float  #: Start after that of the reference camera, s
    exposure: float  #: Exposure time in s
    #: Time from the first row's exposure to the last row's, s; a frame's time is the middle row's
    readout: float
    #: File of the centres (frames, 2, markers) in px, lens distortion included, NaN where missing
    path: Path
    notes: Sequence[str] = ()  #: Warnings from tracking
    stamps: Array | None = None  #: Times of the frames by the camera's own clock, s; None: k / rate
    pace: float = 1.0  #: Seconds of the reference clock per second of the camera's clock
    #: Indices of the frames that repeat the one before
    repeats: IntArray = field(default_factory=lambda: np.zeros(0, int))

    @property
    def times(self) -> Array:
        """Return the times of all frames on the reference's clock, s."""
        own = self.stamps if self.stamps is not None else np.arange(len(self.centres)) / self.rate
        return own * self.pace + self.delay

    def scale_clock(self, pace: float, at: float) -> Recording:
        """Return the recording with its times scaled by `pace` about the time `at`."""
        return replace(self, pace=self.pace * pace, delay=at + (self.delay - at) * pace)

    @property
    def centres(self) -> Array:
        """Return the centres, memory-mapped from the file."""
        return np.load(self.path, mmap_mode="r")

    def between(self, begin: float, end: float) -> tuple[int, int]:
        """Return the first frame between two times of the reference clock, and the end index."""
        slack = 1e-6 / self.rate
        first, last = np.searchsorted(self.times, [begin - slack, end + slack])
        return int(first), int(last)

    def parts(self, begin: float, end: float) -> Iterator[tuple[Array, Array]]:
        """Yield times (n,) in s and undistorted centres (n, 2, markers), in chunks of frames."""
        first, last = self.between(begin, end)
        times, centres = self.times, self.centres
        for start in range(first, last, CHUNK_FRAMES):
            stop = min(start + CHUNK_FRAMES, last)
            yield times[start:stop], undistort_tracks(self.camera, centres[start:stop])

    def read_tracks(self, begin: float, end: float) -> tuple[Array, Array]:
        """Return times (n,) in s and undistorted centres (n, 2, markers), all frames at once."""
        first, last = self.between(begin, end)
        return self.times[first:last], undistort_tracks(self.camera, self.centres[first:last])


def record_track(
    files: manifest.CameraFiles,
    folder: Path,
    clock: Array,
    camera: Camera,
    markers: board.Markers,
    turn: float,
    path: Path,
    tick: Callable[[int], object],
    shares: Sequence[float] = (),
) -> tuple[list[str], IntArray]:
    """Track the markers in a camera's video; write the file of centres whole or not at all.

    The video is in the manifest's folder; `clock` (frames,) are the times of its frames after the
    first, s. Centres are written to `path` (``.npy``). `tick` is called with the number of finished
    frames. `turn` and `shares` are those of :func:`~.follow.make_trackers`. With shares the file is
    of shape (frames, 2 shares, 2, markers): the centres at each width, then those from template
    matching alone, where Appendix F stops. Returns the notes of :func:`~.follow.make_trackers`, and
    the indices of the frames that repeat the one before.
    """
    video = folder / files.video
    first = homography.darken_markers(next(media.read_frames(video, 0, 1)), markers)
    try:
        trackers, notes = follow.make_trackers(
            first, camera, markers, files.corners_px, turn, shares
        )
    except homography.TrackingError as error:
        remedy = "The corners given may be more than a pixel or two off: click them again"
        if files.corners_px is None:
            remedy = "In uneven light give corners_px: click them"
        raise homography.TrackingError(
            f"{video}: frame 0: {error}; are structure.markers as filmed? {remedy} in the "
            "page that thesis measure --check writes"
        ) from None
    shape = (len(clock), *([2 * len(shares)] if shares else []), 2, markers.count)
    steps, across = np.zeros((2, len(clock)))

    def write_centres(part: Path) -> None:
        header = {"descr": "<f8", "fortran_order": False, "shape": shape}
        with part.open("wb") as file:  # not mapped: a full disk would kill the process
            np.lib.format.write_array_header_1_0(file, header)
            frames = media.read_frames(video, stop=len(clock), clock=clock)
            for done, image in enumerate(validation.note_changes(frames, steps, across), 1):
                pictures = follow.reduce_frames(homography.darken_markers(image, markers), shares)
                pairs = zip(trackers, pictures, strict=True)
                found = [tracker.centres(picture) for tracker, picture in pairs]
                found += [tracker.matched for tracker in trackers if isinstance(tracker, Tracker)]
                file.write(np.array(found, "<f8").tobytes())
                tick(done)

    whole_file(path, write_centres)
    return notes, validation.find_repeats(steps, across)
