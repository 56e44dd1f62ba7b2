"""A film at another frame rate, packet by packet, so that nothing is encoded again."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from thesis_lib.arrays import IntArray
from thesis_lib.files import whole_file
from thesis_lib.measure.recordings.check import rate_of
from thesis_lib.measure.recordings.media import read_frames, write_video
from thesis_lib.measure.recordings.media_info import (
    UNTIMED,
    MediaError,
    file_address,
    frame_clock,
    open_media,
    video_track,
)

TIME_UNIT_S = Fraction(1, 1_000_000)  # s, unit of the times of frames that come unevenly


def retime(source: Path, target: Path, rate: float) -> int:
    """Write the frames of a film or of a raw stream to a video that plays at another rate.

    Sound is left out: it does not go with frames that were taken at another rate. Frames are copied
    as they are; what a .mov cannot hold is encoded without loss of grey levels of eight bits.

    Parameters
    ----------
    source : Path
        Any video, or a raw stream of packets without time stamps, such as ``.h264``.
    target : Path
        File to write, ending in .mov.
    rate : float
        Mean rate of the frames in Hz, from now on.

    Returns
    -------
    int
        Number of frames.

    Raises
    ------
    MediaError
        If the source cannot be read, is the target, or can neither be copied nor is even.
    """
    if source.resolve() == target.resolve():
        raise MediaError(f"{target}: given the source itself, allowed: another file")
    order, timed = _presentation_order(source)
    clock = frame_clock(source) if timed else np.arange(len(order)) / rate
    pace = rate_of(clock, rate) / rate if timed else 1.0
    even = len(clock) < 3 or bool(np.ptp(np.diff(clock)) < 1e-9)
    if len(clock) == len(order):  # else some are hidden, or cannot be decoded
        unit = 1 / Fraction(rate).limit_denominator(1001) if even else TIME_UNIT_S
        stamps = np.rint(order if even else clock[order] * pace / float(TIME_UNIT_S)).astype(int)
        try:
            whole_file(target, lambda part: _copy(source, part, stamps, unit))
        except (av.FFmpegError, ValueError):  # a codec that .mov does not hold, such as VP8
            pass
        else:
            return len(order)
    if not even:
        raise MediaError(
            f"{source}: its frames come unevenly and cannot be copied into a .mov, allowed: "
            f"the video as it is, with captured_hz: {rate:g} in the manifest"
        )
    frames = read_frames(source, clock=clock)
    write_video(target, frames, rate, None, codec="h264", crf=0)
    return len(clock)


def _presentation_order(source: Path) -> tuple[IntArray, bool]:
    """Return the place of each packet among the frames shown, and whether it has a time stamp."""
    stamps: list[float] = []
    with open_media(source) as file:
        stream = video_track(file, source)
        for packet in file.demux(stream):
            if packet.size:
                stamps.append(np.nan if packet.pts is None else packet.pts)
        timed = file.format.name not in UNTIMED and bool(np.isfinite(stamps).all())
    if timed:
        return np.argsort(np.argsort(stamps)), True
    shown: list[int] = []
    with open_media(source) as file:  # the decoder tells which packet each frame is of
        stream = video_track(file, source)
        for number, packet in enumerate(file.demux(stream)):
            packet.pts = packet.dts = number
            shown += [frame.pts for frame in packet.decode() if frame.pts is not None]
    return np.argsort(shown), False


def _copy(source: Path, target: Path, stamps: IntArray, unit: Fraction) -> None:
    """Copy the packets of a film to a .mov, each with a time of presentation in some unit."""
    ordered = np.sort(stamps)
    # A packet is decoded before it is shown, and packets are decoded in their order.
    decoded = ordered - int(np.max(ordered - stamps))
    with open_media(source) as file, av.open(file_address(target), "w", format="mov") as new:
        stream = video_track(file, source)
        track = new.add_stream_from_template(stream)
        track.time_base = unit
        packets = (packet for packet in file.demux(stream) if packet.size)
        for packet, shown, first in zip(packets, stamps, decoded, strict=True):
            packet.stream, packet.time_base = track, unit
            packet.pts, packet.dts, packet.duration = int(shown), int(first), 0
            new.mux(packet)
