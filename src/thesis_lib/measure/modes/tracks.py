"""Tracks as the modal fit takes them: undistorted centres, each with the time it was seen at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.lens import Camera, undistorted_tracks


@dataclass(frozen=True)
class Track:
    """What one camera saw of the markers."""

    camera: Camera  #: Calibrated
    times: Array  #: Of the frames' middle rows, on the first camera's clock, s, shape (frames,)
    uv: Array  #: Centres without lens distortion, px, NaN where missing, (frames, 2, markers)
    exposure: float = 0.0  #: Exposure time in s
    readout: float = 0.0  #: Time from the first row's exposure to the last row's, s
    rows: Array | None = None  #: Rows with distortion, px, (frames, markers); None: those of `uv`

    @property
    def seen_rows(self) -> Array:
        """Rows in which the centres were seen, px, shape (frames, markers)."""
        return self.uv[:, 1] if self.rows is None else self.rows

    @property
    def late(self) -> Array:
        """By how much each centre was seen after its frame's time, s, shape (frames, markers)."""
        return np.asarray(self.readout * (self.seen_rows / self.camera.size[1] - 0.5), float)

    @property
    def usual(self) -> Array:
        """The mean of :attr:`late` over what is seen, s, shape (markers,)."""
        late = np.ma.masked_invalid(self.late)
        return np.asarray(late.mean(axis=0).filled(0.0), float)

    def shifted(self, seconds: float, pace: float = 1.0, at: float = 0.0) -> Track:
        """The same with a clock that starts later, and is slower about a time."""
        return replace(self, times=at + (self.times - at) * pace + seconds)


def tracks_of(recordings: Sequence[Recording], begin: float, end: float) -> list[Track]:
    """What all cameras saw from one time to another on the first camera's clock, s."""
    found = []
    for own in recordings:
        first, last = own.between(begin, end)
        centres = np.array(own.centres[first:last], float)
        uv = undistorted_tracks(own.camera, centres)
        found.append(
            Track(own.camera, own.times[first:last], uv, own.exposure, own.readout, centres[:, 1])
        )
    return found
