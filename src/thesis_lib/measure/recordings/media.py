"""Recordings as files: gray video with its audio track (thesis 5.1.2).

Everything streams: memory does not grow with the number of frames. One convention of time serves
all of the laboratory: frame k is exposed around k / frame rate after the start of the recording
(its mid-exposure), audio sample j is taken at j / sample rate after the same start.

Videos are written to Matroska, whose sound is plain PCM: AAC would put 1024 samples of padding
before the first one and up to 1024 after the last, and trusts the reader to drop them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Literal

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange
from av.video.stream import VideoStream
from numpy.typing import ArrayLike, NDArray

from thesis_lib.arrays import Array, Image
from thesis_lib.files import whole_file
from thesis_lib.measure.recordings.media_info import (
    PACKED_FROM,
    UNTIMED_FORMATS,
    MediaError,
    decode_frames,
    depth_for,
    file_address,
    open_media,
    orientation_of,
    probe_media,
    video_track,
)


def write_video(
    path: Path,
    frames: Iterable[Image],
    frame_rate: float,
    audio: ArrayLike | None,
    sample_rate: int = 48000,
    codec: Literal["ffv1", "h264"] = "ffv1",
    crf: int = 23,
    packed_from: str = "",
) -> None:
    """Write gray frames and their sound to a file, whole or not at all.

    Parameters
    ----------
    path : Path
        File to write, ending in .mkv, or in .mov, whose time stamps are exact at any rate.
    frames : iterable of ndarray, shape (height, width)
        Frames as uint8, taken one at a time; height and width are even.
    frame_rate : float
        Frames per second in Hz.
    audio : array_like, shape (samples,), or None
        Sound from the first frame on, −1…1; what is beyond clips, as it does in a camera.
    sample_rate : int
        Audio samples per second in Hz.
    codec : str
        ``ffv1`` is lossless, ``h264`` (x264, full range, preset medium) is as cameras record.
    crf : int
        Constant rate factor of H.264, 0…51; lower is better.
    packed_from : str
        Name of the film whose frames these are, if any.

    Raises
    ------
    MediaError
        If the file's name, the frames or the audio do not suit.
    """
    sound = np.asarray([] if audio is None else audio, float)
    container = {".mkv": "matroska", ".mov": "mov"}.get(path.suffix)
    if container is None:
        raise MediaError(f"{path}: given the ending {path.suffix!r}, allowed: .mkv, .mov")
    if sound.ndim != 1 or not np.isfinite(sound).all():
        raise MediaError(f"{path}: audio of shape {sound.shape}, allowed: finite, one channel")
    samples = np.rint(np.clip(sound, -1, 1 - 2**-15) * 2**15).astype(np.int16)
    remaining = iter(frames)
    first = next(remaining, None)
    if first is None:
        raise MediaError(f"{path}: no frames to write")
    name, options = "ffv1", {"level": "3", "slices": "16", "slicecrc": "1"}
    if codec == "h264":
        # Without mbtree, whose assembly is not reproducible at every width; cameras have none.
        name, options = "libx264", {"preset": "medium", "crf": str(crf), "mbtree": "0"}

    def write(part: Path) -> None:
        with av.open(
            file_address(part), "w", format=container, options={"fflags": "+bitexact"}
        ) as file:
            file.metadata["comment"] = " ".join([name, *map("=".join, options.items())])
            if packed_from:
                file.metadata["title"] = PACKED_FROM + packed_from
            video = file.add_stream(name, rate=Fraction(frame_rate).limit_denominator(1001))
            assert isinstance(video, VideoStream)
            video.height, video.width = first.shape
            video.pix_fmt, video.thread_type = "gray", "AUTO"
            video.options = dict(options)
            video.codec_context.color_range = ColorRange.JPEG  # grey levels 0…255, not 16…235
            track = None
            if audio is not None:
                track = file.add_stream("pcm_s16le", rate=sample_rate, layout="mono")

            def add_sound(start: int, stop: int) -> None:
                if track is not None and start < (stop := min(stop, len(samples))):
                    block = av.AudioFrame.from_ndarray(samples[None, start:stop], "s16", "mono")
                    block.sample_rate, block.pts = sample_rate, start
                    block.time_base = Fraction(1, sample_rate)
                    file.mux(track.encode(block))

            written = 0
            for k, image in enumerate(chain([first], remaining)):
                if image.dtype != np.uint8 or image.shape != first.shape:
                    raise MediaError(
                        f"{path}: frame {k} is {image.dtype} of shape {image.shape}, "
                        f"allowed: uint8 of shape {first.shape}, as frame 0"
                    )
                picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="gray")
                picture.pts, picture.time_base = k, 1 / video.codec_context.rate
                file.mux(video.encode(picture))
                heard = round((k + 1) * sample_rate / frame_rate)
                add_sound(written, heard)
                written = heard
            for start in range(written, len(samples), sample_rate):
                add_sound(start, start + sample_rate)
            file.mux(video.encode(None))
            if track is not None:
                file.mux(track.encode(None))

    if first.dtype != np.uint8 or first.ndim != 2 or any(side % 2 for side in first.shape):
        raise MediaError(
            f"{path}: frame 0 is {first.dtype} of shape {first.shape}, "
            "allowed: uint8 of an even height and width"
        )
    whole_file(path, write)


def read_frames(
    path: Path, start: int = 0, stop: int | None = None, clock: Array | None = None
) -> Iterator[Image]:
    """Yield frames `start` to `stop` of a video in gray of full range, (height, width).

    Colour becomes luma, a limited range (16…235) is stretched to 0…255, as are fewer than 16 bits
    in 16, and a frame is turned and mirrored as it is to be shown. With a `clock`, the times of
    all frames after the first, shape (frames,), frames may come at any time, and there are as many
    as these; without, they come at the file's rate.

    Raises
    ------
    MediaError
        While the frames are taken: as :func:`probe_media`, or if a frame is missing or cannot be
        decoded.
    """
    info = probe_media(path)
    with open_media(path) as file:
        stream = video_track(file, path)
        timed = clock is None and file.format.name not in UNTIMED_FORMATS
        k, previous = 0, np.nan
        frames = decode_frames(file, stream, path)
        while (stop is None or k < stop) and (frame := next(frames, None)) is not None:
            time = frame.time if timed and frame.time is not None else np.nan
            if (time - previous) * info.frame_rate > 1.75:
                raise MediaError(
                    f"{path}: frame {k} is missing: the one before is at {previous:.3f} s, "
                    f"the next at {time:.3f} s"
                )
            if k >= start:
                yield _show_frame(frame, info.depth)
            k, previous = k + 1, time
        there = info.frames if clock is None else len(clock)
        wanted = there if stop is None else stop
        if wanted is not None and k < wanted:
            says = f"the file says {there}" if stop is None else f"asked up to {stop}"
            raise MediaError(f"{path}: ends before frame {k}, {says} frames")


def _show_frame(frame: av.VideoFrame, depth: int) -> Image:
    """Return a frame in gray, as it is to be shown, uint8 of shape (height, width)."""
    if depth < 16 and frame.format.components[0].bits == 16:
        levels = np.asarray(frame.to_ndarray(format="gray16le"), np.uint16) >> (depth - 8)
        image = np.minimum(levels, 255).astype(np.uint8)
    else:
        image = frame.to_ndarray(format="gray")
    transposed, mirrored, flipped = orientation_of(frame)
    image = image.T if transposed else image
    image = image[:, ::-1] if mirrored else image
    image = image[::-1] if flipped else image
    return np.array(image, np.uint8, order="C")  # not the decoder's own


def write_png(path: Path, image: Image) -> None:
    """Write a gray image, uint8 of shape (height, width), whole or not at all.

    Raises
    ------
    MediaError
        If the image is of another kind.
    """
    if image.dtype != np.uint8 or image.ndim != 2 or not image.size:
        raise MediaError(f"{path}: {image.dtype} of shape {image.shape}, allowed: gray uint8")
    _, data = cv2.imencode(".png", image)
    whole_file(path, lambda part: part.write_bytes(data.tobytes()))


def read_png(path: Path, depth: int | None = None) -> Image:
    """Read an image as gray, uint8 of shape (height, width).

    Parameters
    ----------
    path : Path
        The file.
    depth : int, optional
        Bits that hold the grey levels of an image of 16; else as many as its brightest pixel has.

    Raises
    ------
    MediaError
        If there is no such file, it is not an image, or cut off.
    """
    levels = _levels(path)
    if levels.dtype == np.uint8:
        return np.asarray(levels, np.uint8)
    used = depth_for(int(levels.max())) if depth is None else depth
    return np.asarray(np.minimum(levels >> (used - 8), 255), np.uint8)


def depth_of(path: Path) -> int:
    """Return how many bits hold the grey levels of an image: 8, or of 16 as many as are used.

    Raises
    ------
    MediaError
        As :func:`read_png`.
    """
    levels = _levels(path)
    return 8 if levels.dtype == np.uint8 else depth_for(int(levels.max()))


def _levels(path: Path) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Return the grey levels of an image, of eight bits or of sixteen."""
    if not path.is_file():
        raise MediaError(f"{path}: {'a folder, not a file' if path.is_dir() else 'no such file'}")
    data = path.read_bytes()
    png = data.startswith(b"\x89PNG")
    whole = not png or b"IEND" in data[-12:]  # OpenCV fills what is cut off
    if data[4:8] == b"ftyp":
        return _read_heic(path)
    code, flags = np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE
    image = cv2.imdecode(code, flags | cv2.IMREAD_ANYDEPTH) if data else None
    if image is not None and image.dtype not in (np.uint8, np.uint16):  # numbers with a point
        image = cv2.imdecode(code, flags)
    if image is None or not whole:
        raise MediaError(f"{path}: not a readable image, or cut off")
    return image.astype(np.uint16) if image.dtype == np.uint16 else image.astype(np.uint8)


def _read_heic(path: Path) -> Image:
    """Return an image as telephones store it, turned as it is to be shown."""
    try:
        import pillow_heif
    except ImportError:
        raise MediaError(
            f"{path}: HEIC needs pillow-heif: pip install thesis-lib[heic], or save JPEG"
        ) from None
    try:
        picture = np.asarray(pillow_heif.open_heif(path, convert_hdr_to_8bit=True))
    except (ValueError, OSError, EOFError, SyntaxError):
        raise MediaError(f"{path}: not a readable image, or cut off") from None
    to_grey = {3: cv2.COLOR_RGB2GRAY, 4: cv2.COLOR_RGBA2GRAY}
    if picture.ndim == 3:
        picture = cv2.cvtColor(picture, to_grey[picture.shape[2]])
    return np.ascontiguousarray(picture, np.uint8)
