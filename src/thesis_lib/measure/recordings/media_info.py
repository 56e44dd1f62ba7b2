"""What a video file says about itself: size, rate, length, presentation times."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import av
import numpy as np
from av.audio.stream import AudioStream
from av.container import InputContainer
from av.video.stream import VideoStream

from thesis_lib.arrays import Array

ROUNDING = 1.001e-3  # s that time stamps may be off an even rate: Matroska's unit
# Formats that FFmpeg opens and that hold no recording themselves, by its names for them
NOT_RECORDINGS = {"tty": "a text"} | dict.fromkeys(
    ("concat", "dash", "hls", "imf"), "a list of other files"
)


class MediaError(ValueError):
    """A video, picture or audio track that cannot be used; the message is one line."""


@dataclass(frozen=True)
class VideoInfo:
    """What a video says about itself."""

    size: tuple[int, int]  #: Width and height in px
    frame_rate: float  #: Mean frame rate in Hz
    frames: int | None  #: Number of frames, None if the file does not say
    duration: float | None  #: Length of the video track in s, None if the file does not say
    #: When the sound ends after the first frame, s, None if the file does not say
    sound_end: float | None
    codec: str  #: Name of the video codec
    sample_rate: int | None  #: Audio sample rate in Hz, None without audio
    channels: int  #: Audio channels, 0 without audio
    #: Whether even and odd lines of a frame were taken at different times
    interlaced: bool = False

    @property
    def has_audio(self) -> bool:
        """Whether there is an audio track."""
        return self.channels > 0


def file_address(path: Path) -> str:
    """Return the address of a file for FFmpeg, which takes `12:30:05.mkv` for a protocol `12`."""
    return f"file:{path.absolute()}"


@contextmanager
def open_media(path: Path) -> Iterator[InputContainer]:
    """Open a video or sound file for reading; no other file, and no network, is ever read for it.

    Raises
    ------
    MediaError
        If there is no such file, or it is no recording.
    """
    if not path.is_file():
        raise MediaError(f"{path}: {'a folder, not a file' if path.is_dir() else 'no such file'}")
    options = {"protocol_whitelist": "file", "pattern_type": "none"}  # a % in a name is a %
    try:
        file = av.open(file_address(path), options=options)
    except (av.FFmpegError, OSError):
        raise MediaError(f"{path}: not a video, or cut off before its index") from None
    with file:
        if file.format.name in NOT_RECORDINGS:
            raise MediaError(f"{path}: {NOT_RECORDINGS[file.format.name]}, not a recording")
        yield file


def video_track(file: InputContainer, path: Path) -> VideoStream:
    """The first video track, decoded by as many threads as there are cores."""
    if not file.streams.video:
        raise MediaError(f"{path}: no video track")
    stream = file.streams.video[0]
    if stream.codec_context is None:  # an SVG, for one
        raise MediaError(f"{path}: no decoder for its video track")
    stream.thread_type = "AUTO"
    return stream


def _seconds(text: str) -> float:
    """Seconds of Matroska's ``hours:minutes:seconds``."""
    hours, minutes, seconds = text.split(":")
    return 3600 * int(hours) + 60 * int(minutes) + float(seconds)


def start_of(stream: VideoStream | AudioStream) -> float:
    """Time of the first frame in s."""
    return float((stream.start_time or 0) * (stream.time_base or 0))


def _end_of(stream: VideoStream | AudioStream) -> float | None:
    """Time in s at which a track ends, None if the file does not say."""
    if stream.duration is not None and stream.time_base is not None:
        return start_of(stream) + float(stream.duration * stream.time_base)
    return _seconds(stream.metadata["DURATION"]) if "DURATION" in stream.metadata else None


def info_of(file: InputContainer, path: Path) -> VideoInfo:
    """What an open file says about itself."""
    video = video_track(file, path)
    rate = video.average_rate or video.guessed_rate
    if not rate or not video.width:
        raise MediaError(f"{path}: the video track says no frame rate or size")
    end = _end_of(video)
    duration = None if end is None else end - start_of(video)
    counts = [video.frames] if video.frames else []
    if duration is not None:
        counts.append(round(duration * rate))
    sound = file.streams.audio[0] if file.streams.audio else None
    heard = None if sound is None else _end_of(sound)
    return VideoInfo(
        size=(video.width, video.height),
        frame_rate=float(rate),
        frames=min(counts, default=None),  # an edit list may hide stored frames
        duration=duration,
        sound_end=None if heard is None else heard - start_of(video),
        codec=video.codec_context.name,
        sample_rate=sound.sample_rate if sound else None,
        channels=sound.channels if sound else 0,
    )


def probe(path: Path) -> VideoInfo:
    """What a video and its first frame say about it; the size is that of the picture as shown.

    Raises
    ------
    MediaError
        If there is no such file, it is not a video, or has no video track.
    """
    with open_media(path) as file:
        info = info_of(file, path)
        try:
            first = next(file.decode(video_track(file, path)), None)
        except (av.FFmpegError, OSError):  # told when the frames are read
            first = None
        if first is None:
            return info
        size = info.size[::-1] if round(first.rotation / 90) % 2 else info.size
        return replace(info, size=size, interlaced=first.interlaced_frame)


def frame_clock(path: Path) -> Array:
    """When each frame was taken after the first, shape (frames,), s, by the video's own clock.

    Time stamps that agree with the rate which the file states, to within their rounding, are those
    of a constant rate; others count as they stand.

    Raises
    ------
    MediaError
        As :func:`frame_times`, or if two frames have one time.
    """
    times = frame_times(path)
    even = np.arange(len(times)) / probe(path).frame_rate
    if np.abs(times - even).max() <= ROUNDING:
        return even
    slope, offset = np.polyfit(np.arange(len(times)), times, 1)
    even = np.arange(len(times)) * slope
    if np.abs(times - even - offset).max() <= ROUNDING:
        return even
    for k in np.flatnonzero(np.diff(times) <= 0):
        raise MediaError(f"{path}: frames {k} and {k + 1} have the same time stamp")
    return times


def frame_times(path: Path) -> Array:
    """Presentation times of all frames after the first, shape (frames,), s; decodes nothing.

    Matroska rounds them to 1 ms.

    Raises
    ------
    MediaError
        As :func:`probe`, or if the video has no presentation times.
    """
    with open_media(path) as file:
        stream = video_track(file, path)
        times = []
        try:
            for packet in file.demux(stream):
                if packet.size and not packet.is_discard:
                    if packet.pts is None or packet.time_base is None:
                        raise MediaError(f"{path}: its frames have no presentation times")
                    times.append(float(packet.pts * packet.time_base))
        except (av.FFmpegError, OSError):
            raise MediaError(f"{path}: damaged after frame {len(times)}") from None
        if not times:
            raise MediaError(f"{path}: no frames")
        return np.sort(times) - min(times)
