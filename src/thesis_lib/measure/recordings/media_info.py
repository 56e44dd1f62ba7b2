"""Metadata of video files: size, frame rate, duration, presentation times."""

import os
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.container import InputContainer
from av.stream import Disposition

from thesis_lib.arrays import Array
from thesis_lib.files import stat_file

MIN_DROP_RATIO = 1.75  # time between two frames over the usual one, if a frame between is missing
MAX_TIMESTAMP_ROUNDING_S = 1.001e-3  # deviation from an even rate by rounding: Matroska's unit
#: The same over the frame interval, for finer units: a lost frame shifts the others by half of it
MAX_ROUNDING_RATIO = 0.25
BIT_DEPTHS = (8, 10, 12, 14, 16)  # bits of a sensor's grey levels in a 16-bit format
SAMPLED_FRAMES, SAMPLED_PLACES = 16, 8  # frames per place, and places, to find the brightest pixel
#: Containers that store when a frame is decoded, but not when it is shown
UNTIMED_FORMATS = {"avi"}
_CAPTURE_RATE = re.compile(r"captur\w*[._ -]?(fps|frame[._ -]?rate)", re.IGNORECASE)  # Android's
_SONY_RATE = re.compile(rb'capture[Ff]ps="([0-9.]+)[pi]?"')  # in XML at the file's end
PACKED_FROM = "packed from "  # start of a packed video's title; the name of the source follows
SONY_BYTES = 1 << 16  # bytes at either end of a file that are searched for Sony's capture rate
# FFmpeg's names of formats that are texts or lists of other files
NOT_RECORDINGS = {"tty", "concat", "dash", "hls", "imf"}


class MediaError(ValueError):
    """A video, image or audio track that cannot be used; the message is one line."""


@dataclass(frozen=True)
class VideoInfo:
    """Metadata of a video."""

    size: tuple[int, int]  #: Width and height in px
    frame_rate: float  #: Mean frame rate in Hz
    frames: int | None  #: Number of frames, None if not stated
    duration: float | None  #: Length of the video track in s, None if not stated
    sound_end: float | None  #: End of the audio after the first frame, s, None if not stated
    has_audio: bool  #: Whether there is an audio track
    interlaced: bool  #: Whether even and odd lines of a frame were taken at different times
    start: float  #: Time of the first frame that can be decoded, by the file's clock, s
    depth: int  #: Bits that hold the grey levels
    captured_hz: float | None  #: Stated capture rate in Hz, None if not stated


def file_address(path: Path) -> str:
    """Return the address of a file for FFmpeg, which takes `12:30:05.mkv` for a protocol `12`."""
    return f"file:{path.absolute()}"


def check_is_file(path: Path) -> None:
    """Refuse a path at which there is no file."""
    if not os.path.isfile(path):  # noqa: PTH113 - pathlib raises where a name is too long
        why = "a folder, not a file" if os.path.isdir(path) else "no such file"  # noqa: PTH112
        raise MediaError(f"{path}: {why}")


@contextmanager
def open_media(path: Path) -> Iterator[InputContainer]:
    """Open a video or sound file for reading, without access to other files or the network.

    A :class:`MediaError` is raised if the file is missing or not a recording.
    """
    check_is_file(path)
    options = {"protocol_whitelist": "file", "pattern_type": "none"}  # a % in a name is a %
    try:
        file = av.open(file_address(path), options=options)
    except (av.FFmpegError, OSError):
        raise MediaError(f"{path}: not a video, or cut off before its index") from None
    with file:
        if file.format.name in NOT_RECORDINGS:
            raise MediaError(f"{path}: a text or a list of other files, not a recording")
        yield file


def video_track(file: InputContainer, path: Path) -> av.VideoStream:
    """Return the main video track, decoded by as many threads as there are cores.

    Attached images are ignored, and so are tracks of one frame if there are longer ones. Of several
    tracks the first with the most pixels is used. A :class:`MediaError` is raised without any.
    """
    still = Disposition.attached_pic | Disposition.timed_thumbnails
    tracks = [track for track in file.streams.video if not track.disposition & still]
    films = [track for track in tracks if track.codec_context is not None]  # None for an SVG
    if len(films) > 1:
        films = [film for film in films if _has_frames(path, film.index)] or films
    if not films:
        raise MediaError(f"{path}: no video track that can be decoded")
    stream = max(films, key=lambda film: film.width * film.height)
    stream.thread_type = "AUTO"
    return stream


def sound_tracks(file: InputContainer) -> list[av.AudioStream]:
    """Return the audio tracks that can be decoded."""
    return [track for track in file.streams.audio if track.codec_context is not None]


def _has_frames(path: Path, index: int) -> bool:
    """Return whether a track has two frames or more."""
    with open_media(path) as file:
        packets = (packet for packet in file.demux(file.streams[index]) if packet.size)
        with suppress(av.FFmpegError, OSError):
            return len(list(islice(packets, 2))) == 2
    return False


def decode_frames(
    file: InputContainer, stream: av.VideoStream, path: Path
) -> Iterator[av.VideoFrame]:
    """Decode the frames of a track in presentation order.

    Frames before the first decodable one, as in a video that was cut between key frames, are left
    out; a :class:`MediaError` is raised if a later frame cannot be decoded.
    """
    count, packets = 0, file.demux(stream)
    while True:
        try:
            frames = next(packets).decode()
        except StopIteration:
            return
        except (av.FFmpegError, OSError):
            if count:
                raise MediaError(f"{path}: damaged from frame {count} on") from None
            continue
        for frame in frames:
            if not frame.is_corrupt:
                count += 1
                yield frame
            elif count:
                raise MediaError(f"{path}: frame {count} is damaged")


def orientation_of(frame: av.VideoFrame) -> tuple[bool, bool, bool]:
    """Return the transformation of a frame to its display orientation, from its display matrix.

    Returns
    -------
    transposed, mirrored, flipped : bool
        To be applied in this order: exchange of rows and columns, of left and right, of top and
        bottom. Angles are rounded to quarter turns.
    """
    data: Any = frame.side_data  # its type stubs are wrong: they declare names
    matrix = data.get("DISPLAYMATRIX")
    if matrix is None:
        return False, False, False
    # A point (p, q) of the stored frame is shown at (a p + c q, b p + d q).
    a, b, _, c, d, *_ = np.frombuffer(matrix, np.int32).astype(float)
    if abs(a) + abs(d) >= abs(b) + abs(c):
        return False, bool(a < 0), bool(d < 0)
    return True, bool(c < 0), bool(b < 0)


def start_of(stream: av.VideoStream | av.AudioStream) -> float:
    """Return the time of a track's first frame in s, by the file's clock."""
    return float((stream.start_time or 0) * (stream.time_base or 0))


def _end_of(stream: av.VideoStream | av.AudioStream, start: float) -> float | None:
    """Return the time from `start` to the end of a track, s; None if not stated."""
    if stream.duration is not None and stream.time_base is not None:
        return start_of(stream) + float(stream.duration * stream.time_base) - start
    if "DURATION" not in stream.metadata:
        return None
    hours, minutes, seconds = stream.metadata["DURATION"].split(":")  # as Matroska has it
    return 3600 * int(hours) + 60 * int(minutes) + float(seconds) - start


def probe_media(path: Path) -> VideoInfo:
    """Return the metadata of a video and its first frames; the size is in display orientation.

    A :class:`MediaError` is raised if the file is missing, or not a video with a frame that can be
    decoded.
    """
    check_is_file(path)
    return _probe(path, stat_file(path))


@lru_cache(maxsize=256)
def _probe(path: Path, _as_it_is: tuple[int, ...]) -> VideoInfo:
    with open_media(path) as file:
        video = video_track(file, path)
        rate = video.average_rate or video.guessed_rate
        if not rate or not video.width:
            raise MediaError(f"{path}: the video track has no frame rate or size")
        first = next(decode_frames(file, video, path), None)
        if first is None:
            raise MediaError(f"{path}: no frame that can be decoded")
        start = start_of(video)
        if file.format.name not in UNTIMED_FORMATS and first.time is not None:
            start = first.time
        cut = start > start_of(video) + 0.5 / rate
        duration = _end_of(video, start)
        counts = [video.frames] if video.frames and not cut else []
        if duration is not None:
            counts.append(round(duration * rate))
        sound = next(iter(sound_tracks(file)), None)
        depth = max((part.bits for part in first.format.components), default=8)
        size = video.width, video.height
        return VideoInfo(
            size=size[::-1] if orientation_of(first)[0] else size,
            frame_rate=float(rate),
            frames=min(counts, default=None),  # an edit list may hide stored frames
            duration=duration,
            sound_end=None if sound is None else _end_of(sound, start),
            has_audio=sound is not None,
            interlaced=first.interlaced_frame,
            start=start,
            depth=_depth_of(path) if depth == 16 else depth,
            captured_hz=_capture_rate(file, video, path),
        )


def source_of_packed(path: Path) -> str | None:
    """Return the source of a .mov by ``thesis convert``, a file name; None for other files."""
    if path.suffix.lower() == ".mov":
        with suppress(MediaError), open_media(path) as file:
            title = file.metadata.get("title", "")
            return title.removeprefix(PACKED_FROM) if title.startswith(PACKED_FROM) else None
    return None


def first_frame_time(path: Path) -> float | None:
    """Return the time of a file's first frame by its own clock, s; None without frames."""
    with suppress(MediaError):  # a sound file, a cover alone, or frames that cannot be decoded
        return probe_media(path).start
    return None


def _depth_of(path: Path) -> int:
    """Return how many of 16 bits the grey levels of a video use, from a sample of its frames."""
    brightest = 0
    unread = MediaError, av.FFmpegError, OSError  # reported later, when the frames are read
    with open_media(path) as file, suppress(*unread):
        stream = video_track(file, path)
        span = file.duration or 0  # in FFmpeg's unit, as seek takes it
        for place in range(SAMPLED_PLACES if span else 1):
            if place:
                file.seek((file.start_time or 0) + place * span // SAMPLED_PLACES)
            for frame in islice(decode_frames(file, stream, path), SAMPLED_FRAMES):
                brightest = max(brightest, int(frame.to_ndarray(format="gray16le").max()))
    return depth_for(brightest)


def depth_for(brightest: int) -> int:
    """Return the smallest usual bit depth that can hold a grey level.

    Examples
    --------
    >>> depth_for(200), depth_for(1000), depth_for(4095), depth_for(40000)
    (8, 10, 12, 16)
    """
    return next(depth for depth in BIT_DEPTHS if brightest < 1 << depth)


def _capture_rate(file: InputContainer, stream: av.VideoStream, path: Path) -> float | None:
    """Return the capture rate in Hz that a file states, None if it states none.

    Android writes it into the metadata, Sony's cameras into XML at the end of the file.
    """
    stated = file.metadata | stream.metadata
    texts = [text for name, text in stated.items() if _CAPTURE_RATE.search(name)]
    with path.open("rb") as data:
        ends = data.read(SONY_BYTES)
        data.seek(max(0, path.stat().st_size - SONY_BYTES))
        ends += data.read(SONY_BYTES)
    texts += [one[1].decode("ascii") for one in _SONY_RATE.finditer(ends)]
    for text in texts:
        with suppress(ValueError):
            if np.isfinite(rate := float(text)) and rate > 0:
                return rate
    return None


def frame_clock(path: Path) -> Array:
    """Return the times of frames after the first, (frames,), s, by the video's clock.

    Time stamps that agree with the stated rate or with another constant rate, to within their
    rounding, are replaced by even ones; others stay unchanged. Only the first frame is decoded. A
    :class:`MediaError` is raised if there are no time stamps, or if two frames have the same one.
    """
    info = probe_media(path)
    with open_media(path) as file:
        stream, untimed = video_track(file, path), file.format.name in UNTIMED_FORMATS
        found: list[float] = []
        try:
            for packet in file.demux(stream):
                if packet.size and not packet.is_discard:
                    stamp = packet.dts if untimed or packet.pts is None else packet.pts
                    if stamp is None or packet.time_base is None:
                        advice = f"thesis convert {shlex.quote(str(path))} --rate-hz RATE"
                        raise MediaError(f"{path}: its frames have no time stamps; {advice}")
                    found.append(float(stamp * packet.time_base))
        except (av.FFmpegError, OSError):
            raise MediaError(f"{path}: damaged after frame {len(found)}") from None
    times = np.sort(found)
    times = times[times > (-np.inf if untimed else info.start) - 1e-6]  # decodable frames
    if not len(times):
        raise MediaError(f"{path}: no frames")
    times = np.asarray(times - times[0])
    unit = max(float(stream.time_base or 0), MAX_ROUNDING_RATIO * times[-1] / len(times))
    rounding = min(MAX_TIMESTAMP_ROUNDING_S, unit)
    even = np.arange(len(times)) / info.frame_rate
    if np.abs(times - even).max() <= rounding:
        return even
    slope, offset = np.polyfit(np.arange(len(times)), times, 1)
    even = np.arange(len(times)) * slope
    if np.abs(times - even - offset).max() <= rounding:
        return even
    for k in np.flatnonzero(np.diff(times) <= 0):
        raise MediaError(f"{path}: frames {k} and {k + 1} have the same time stamp")
    return times


def rate_of(clock: Array, nominal: float) -> float:
    """Return a clock's frames per second; the nominal rate if they differ by rounding alone."""
    if len(clock) < 2:
        return nominal
    mean = float((len(clock) - 1) / clock[-1])
    return nominal if abs(mean / nominal - 1) < 1e-12 else mean


def playback_rate(clock: Array, nominal: float) -> float:
    """Return a clock's frames per second, dropped frames included; else as :func:`rate_of`.

    Slow motion is scaled by this rate: dropped frames lower the mean rate, but not the interval of
    the others.
    """
    mean, steps = rate_of(clock, nominal), np.diff(clock)
    if not len(steps):
        return mean
    # A mean, since the median of time stamps in ms is up to half a millisecond off
    usual = steps[steps < MIN_DROP_RATIO * np.median(steps)].mean()
    return mean * float(np.maximum(np.rint(steps / usual), 1).mean())
