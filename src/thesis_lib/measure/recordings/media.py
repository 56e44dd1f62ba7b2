"""Recording files: gray video with an audio track (thesis 5.1.2).

All data are streamed: memory does not grow with the number of frames. The whole laboratory uses one
convention of time: frame k has its mid-exposure at k / frame rate after the start of the recording,
and audio sample j is taken at j / sample rate after the same start.

Videos are written to Matroska with PCM audio: AAC would add 1024 samples of padding before the
first sample and up to 1024 after the last, and rely on the reader to drop them.
"""

import contextlib
import math
import re
from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange, VideoReformatter

from thesis_lib.arrays import Array, ArrayLike, Image, IntArray, NDArray
from thesis_lib.files import whole_file
from thesis_lib.measure.recordings import media_info, text_files
from thesis_lib.measure.recordings.manifest import IMAGE_SUFFIXES, find_images
from thesis_lib.measure.recordings.media_info import MediaError, open_media, probe_media
from thesis_lib.studies.fields import format_given

MAX_SAMPLED_PICTURES = 50  # images of a folder that are searched for the brightest grey level
MAX_SIDE_PX = 16384  # limit of H.264
MAX_RAW_NUMBER = 10**8  # frames, px, bits or Hz; a header with larger numbers is damaged
#: Names in the text header and in the XML header of raw frames
RAW_FIELDS = (
    ("Record Rate(fps)", "recordRate"),
    ("Total Frame", "totalFrame"),
    ("Image Width", "width"),
    ("Image Height", "height"),
    ("Color Bit", "bit"),
    ("EffectiveBit Depth", "depth"),
    ("EffectiveBit Side", "side"),  # "Lower" or "Higher" bits of sixteen
)
TIME_UNIT_S = Fraction(1, 1_000_000)  # unit of the times of unevenly spaced frames, s


def write_video(
    path: Path,
    frames: Iterable[Image],
    frame_rate: float,
    audio: ArrayLike | None,
    sample_rate: int = 48000,
    codec: Literal["ffv1", "h264"] = "ffv1",
    crf: int = 23,
) -> None:
    """Write gray frames and audio to a file, whole or not at all.

    Parameters
    ----------
    path : Path
        Ending in .mkv, or in .mov, whose time stamps are exact at any rate.
    frames : iterable of ndarray, shape (height, width)
        Frames as uint8, taken one at a time; height and width are even.
    frame_rate : float
        Frames per second in Hz.
    audio : array_like, shape (samples,), or None
        Audio from the first frame on, −1…1; values beyond are clipped, as in a camera.
    sample_rate : int
        Audio samples per second in Hz.
    codec : str
        ``ffv1`` is lossless, ``h264`` (x264, full range, preset medium) is like that of cameras.
    crf : int
        Constant rate factor of H.264, 0…51; lower is better.
    """
    sound = np.asarray([] if audio is None else audio, float)
    if path.suffix not in (".mkv", ".mov"):
        raise MediaError(f"{path}: given the ending {path.suffix!r}, allowed: .mkv, .mov")
    if sound.ndim != 1 or not np.isfinite(sound).all():
        raise MediaError(f"{path}: audio of shape {sound.shape}, allowed: finite, one channel")
    samples = np.rint(np.clip(sound, -1, 1 - 2**-15) * 2**15).astype(np.int16)
    remaining = _check_frames(path, frames)
    first = next(remaining, None)
    if first is None:
        raise MediaError(f"{path}: no frames to write")
    name, options = "ffv1", {"level": "3", "slices": "16", "slicecrc": "1"}
    if codec == "h264":
        # No mbtree: its assembly code is not reproducible at every width, and cameras have none.
        name, options = "libx264", {"preset": "medium", "crf": str(crf), "mbtree": "0"}

    def write_part(part: Path) -> None:
        with av.open(media_info.file_address(part), "w", options={"fflags": "+bitexact"}) as file:
            file.metadata["comment"] = " ".join([name, *map("=".join, options.items())])
            video = file.add_stream(name, rate=Fraction(frame_rate).limit_denominator(1001))
            assert isinstance(video, av.VideoStream)
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

    whole_file(path, write_part)


def _check_frames(path: Path, frames: Iterable[Image]) -> Iterator[Image]:
    """Yield frames; refuse one that differs in shape from the first, or cannot be encoded."""
    shape = None
    for k, image in enumerate(frames):
        shape = shape or image.shape
        if image.dtype != np.uint8 or image.shape != shape or [n % 2 for n in shape] != [0, 0]:
            allowed = "uint8 of an even height and width, the same for all"
            given = f"frame {k} is {image.dtype} of shape {image.shape}"
            raise MediaError(f"{path}: {given}, allowed: {allowed}")
        yield image


def read_frames(
    path: Path, start: int = 0, stop: int | None = None, clock: Array | None = None
) -> Iterator[Image]:
    """Yield frames `start` to `stop` of a video in full-range gray, (height, width).

    Colour is converted to luma. A limited range (16…235), or one of fewer than 16 bits stored in
    16, is stretched to 0…255. Frames are rotated and mirrored to their display orientation.

    Parameters
    ----------
    path : Path
        The video.
    start, stop : int
        First frame, and the one after the last; None for all.
    clock : ndarray, shape (frames,), optional
        Times of all frames after the first in s. Frames may then be unevenly spaced, and their
        number is that of the times; without a clock they must come at the file's rate.

    Raises
    ------
    MediaError
        During iteration: as by :func:`probe_media`, or if a frame is missing or cannot be decoded.
    """
    info = probe_media(path)
    with open_media(path) as file:
        timed = clock is None and file.format.name not in media_info.UNTIMED_FORMATS
        k, previous, converter = 0, np.nan, VideoReformatter()  # one for all: its setup is slow
        frames = media_info.decode_frames(file, media_info.video_track(file, path), path)
        while (stop is None or k < stop) and (frame := next(frames, None)) is not None:
            time = frame.time if timed and frame.time is not None else np.nan
            if (time - previous) * info.frame_rate > media_info.MIN_DROP_RATIO:
                between = f"between {previous:.3f} s and {time:.3f} s"
                raise MediaError(f"{path}: frame {k} is missing, {between}")
            if k >= start:
                yield _show_frame(frame, info.depth, converter)
            k, previous = k + 1, time
        wanted = stop if stop is not None else info.frames if clock is None else len(clock)
        if wanted is not None and k < wanted:
            raise MediaError(f"{path}: ends before frame {k}, of {wanted} frames")


def _show_frame(frame: av.VideoFrame, depth: int, converter: VideoReformatter) -> Image:
    """Convert a frame to gray in its display orientation, uint8 of shape (height, width)."""
    luma = frame.format.components[0]
    deep = depth < 16 and luma.bits == 16
    image: NDArray[Any]
    full = frame.format.is_planar and frame.color_range == ColorRange.JPEG
    if full and luma.is_luma and luma.bits == 8:  # no conversion needed
        rows = np.frombuffer(memoryview(frame.planes[0]), np.uint8)
        image = rows.reshape(-1, frame.planes[0].line_size)[: frame.height, : frame.width]
    else:
        image = converter.reformat(frame, format="gray16le" if deep else "gray").to_ndarray()
    image = _highest_bits(image, depth) if deep else image
    transposed, mirrored, flipped = media_info.orientation_of(frame)
    image = image.T if transposed else image
    image = image[:, ::-1] if mirrored else image
    image = image[::-1] if flipped else image
    return np.array(image, np.uint8, order="C")  # a copy, not the decoder's memory


def _highest_bits(levels: NDArray[Any], depth: int) -> Image:
    """Return the highest eight of the `depth` bits of grey levels, uint8 of the same shape."""
    return np.minimum(levels >> (depth - 8), 255).astype(np.uint8)


def write_png(path: Path, image: Image) -> None:
    """Write a gray image, uint8 of shape (height, width), whole or not at all."""
    _, data = cv2.imencode(".png", image)
    whole_file(path, lambda part: part.write_bytes(data.tobytes()))


def read_png(path: Path, depth: int | None = None) -> Image:
    """Read an image as gray, uint8 of shape (height, width).

    ``depth`` is the number of used bits in a 16-bit image; by default its brightest pixel decides.
    A :class:`MediaError` is raised if the file is missing, not an image, or truncated.
    """
    levels = _read_levels(path)
    if levels.dtype == np.uint8:
        return levels
    return _highest_bits(levels, depth or media_info.depth_for(int(levels.max())))


def _read_levels(path: Path) -> NDArray[Any]:
    """Return the grey levels of an image with 8 or 16 bits."""
    media_info.check_is_file(path)
    data = path.read_bytes()
    if data[4:8] == b"ftyp":  # HEIC, a format of smartphones
        try:  # in display orientation
            import pillow_heif

            picture = np.asarray(pillow_heif.open_heif(path, convert_hdr_to_8bit=True))
        except ImportError:
            advice = "pip install thesis-lib[heic], or save JPEG"
            raise MediaError(f"{path}: HEIC needs pillow-heif: {advice}") from None
        except (ValueError, OSError, EOFError, SyntaxError):
            raise MediaError(f"{path}: not a readable image, or cut off") from None
        if picture.ndim == 3:  # a fourth channel would be transparency
            picture = cv2.cvtColor(np.ascontiguousarray(picture[..., :3]), cv2.COLOR_RGB2GRAY)
        return np.ascontiguousarray(picture, np.uint8)
    # OpenCV would fill the missing part of a truncated PNG.
    whole = not data.startswith(b"\x89PNG") or b"IEND" in data[-12:]
    code, flags = np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
    image = cv2.imdecode(code, flags) if whole and data else None
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise MediaError(f"{path}: not a readable image, or cut off")
    return np.asarray(image)


# Images, raw frames or a video are converted to a video. Phantom's .cine needs no conversion.


def pack_frames(
    source: Path, target: Path, rate: float | None = None
) -> tuple[int, tuple[int, int]]:
    """Write frames to a video, lossless for grey levels of eight bits.

    Parameters
    ----------
    source : Path
        Folder of images, ordered by name with numbers by value; or a ``.cih`` or ``.cihx`` next to
        its ``.mraw``; of more than eight bits the highest eight that are used are written. Or a
        video, or a raw stream such as ``.h264``, whose frames are copied.
    target : Path
        File to write, ending in .mov.
    rate : float, optional
        Frames per second in Hz; for raw frames the default is the rate in their header.

    Returns
    -------
    tuple
        Number of frames; their width and height in px, without a last odd row or column.
    """
    if target.suffix != ".mov":
        raise MediaError(f"{target}: given the ending {target.suffix!r}, allowed: .mov")
    frames: Iterator[Image] | None = None
    if source.suffix.lower() in (".cih", ".cihx"):
        own, frames = _read_raw(source)
        rate = rate or own
    elif not source.exists():
        raise MediaError(f"{source}: allowed: a folder of images, a video, a .cih or a .cihx")
    elif rate is None:
        raise MediaError(f"{source}: give --rate-hz, the rate at which its frames were taken")
    elif source.is_dir():
        frames = _read_images(source)
    if frames is None:
        _retime_frames(source, target, rate)
    else:
        even = (frame[: frame.shape[0] // 2 * 2, : frame.shape[1] // 2 * 2] for frame in frames)
        write_video(target, even, rate, None, codec="h264", crf=0)  # lossless
    info = probe_media(target)
    return info.frames or 0, info.size


def _read_images(folder: Path) -> Iterator[Image]:
    """Yield the images in a folder, all with the bit depth of the brightest of a sample."""
    files = find_images(folder.iterdir())
    if not files:
        raise MediaError(f"{folder}: no image in it ({', '.join(sorted(IMAGE_SUFFIXES))})")
    numbers = [re.findall(r"\d+", file.stem)[-1:] for file in files]
    if len(files) > 1 and all(numbers):  # frame numbers or times, which may be reset
        steps = np.diff(np.array(numbers, float)[:, 0])
        usual = np.median(steps)
        for k in np.flatnonzero((usual > 0) & (steps > media_info.MIN_DROP_RATIO * usual))[:1]:
            after = f"{files[k + 1].name} follows {files[k].name}"
            raise MediaError(f"{folder}: {after}, allowed: numbers in equal steps, without gaps")
    sampled = map(_read_levels, files[:: math.ceil(len(files) / MAX_SAMPLED_PICTURES)])
    depth = media_info.depth_for(max(int(levels.max()) for levels in sampled))
    return (read_png(file, depth) for file in files)


def _read_raw(header: Path) -> tuple[float, Iterator[Image]]:
    """Return the rate and the frames from a Photron header and the raw file next to it."""
    media_info.check_is_file(header)
    try:
        text = text_files.read_text(header, errors="replace")
    except text_files.TextFileError as error:
        raise MediaError(f"{header}: {error}") from None
    xml = header.suffix == ".cihx"
    pattern = r"<(\w+)>([^<]+)</\1>" if xml else r"^(.+?) : (.+?)\r?$"
    said = dict(reversed(re.findall(pattern, text, re.MULTILINE)))  # a name's first value counts
    names = [pair[xml] for pair in RAW_FIELDS]
    for name in names:
        if name not in said:
            raise MediaError(f"{header}: does not say {name!r}: not a header of Photron's?")
    *texts, side = (said[name].strip() for name in names)
    numbers = []
    for name, given in zip(names, texts, strict=False):
        number = math.nan
        with contextlib.suppress(ValueError):
            number = float(given)
        if not 1 <= number <= MAX_RAW_NUMBER:
            given = format_given(given)
            raise MediaError(f"{header}: {name}: given {given}, allowed: 1 to {MAX_RAW_NUMBER}")
        numbers.append(number)
    rate, *whole = numbers
    count, width, height, bits, depth = map(int, whole)
    if bits not in (8, 12, 16) or not 8 <= depth <= bits or side not in ("Lower", "Higher"):
        given = f"{bits} bits for a pixel, {depth} of them used, side {format_given(side)}"
        raise MediaError(f"{header}: {given}, allowed: 8, 12 or 16, grey; Lower or Higher")
    fits = min(width, height) > 1 and max(width, height) <= MAX_SIDE_PX
    if not fits or (bits == 12 and width * height % 2):  # two pixels in three bytes
        allowed = f"sides of 2 to {MAX_SIDE_PX} px, of 12 bits an even number in all"
        raise MediaError(f"{header}: given {width} × {height} px, allowed: {allowed}")
    raw, size = header.with_suffix(".mraw"), height * width * bits // 8
    if not raw.is_file() or raw.stat().st_size < count * size:
        raise MediaError(f"{raw}: not there, or shorter than the {count} frames of {header}")
    shift = (16 if side == "Higher" else depth) - 8

    def frames() -> Iterator[Image]:
        with raw.open("rb") as file:
            for _ in range(count):
                data = np.frombuffer(file.read(size), np.uint8)  # the highest eight bits are taken
                if bits == 16:
                    data = (data.view("<u2") >> shift).astype(np.uint8)
                elif bits == 12:  # two pixels in three bytes, highest bits first
                    first, middle, last = data.reshape(-1, 3).T
                    data = np.stack([first, (middle & 15) << 4 | last >> 4], axis=1).ravel()
                yield data.reshape(height, width)

    return rate, frames()


def _retime_frames(source: Path, target: Path, rate: float) -> None:
    """Copy the frames of a video or of a raw stream to a video that plays at another rate.

    Audio is left out, since it does not match frames at another rate. The source may be a raw
    stream of packets without time stamps, such as ``.h264``.
    """
    if source.resolve() == target.resolve():
        raise MediaError(f"{target}: given the source itself, allowed: another file")
    order, timed = _presentation_order(source)
    clock = media_info.frame_clock(source) if timed else np.sort(order) / rate
    if len(clock) == len(order):  # else some are hidden, or cannot be decoded
        stamps, unit = order, 1 / Fraction(rate).limit_denominator(1001)
        if len(clock) > 2 and np.ptp(np.diff(clock)) >= 1e-9:  # unevenly spaced
            pace, unit = media_info.playback_rate(clock, rate) / rate, TIME_UNIT_S
            stamps = np.rint(clock[order] * pace / float(unit)).astype(int)
        try:
            whole_file(target, lambda part: _copy(source, part, stamps, unit))
            return
        except OSError as error:  # such as a full disk
            raise OSError(error.errno, error.strerror) from None
        except (av.FFmpegError, ValueError):  # .mov cannot contain VP8, for example
            pass
    allowed = f"the video as it is, with captured_hz: {rate:g} in the manifest"
    raise MediaError(f"{source}: its frames cannot be copied into a .mov, allowed: {allowed}")


def _presentation_order(source: Path) -> tuple[IntArray, bool]:
    """Return each packet's index in presentation order, and whether packets have time stamps."""
    with open_media(source) as file:
        film = media_info.video_track(file, source)
        stamps = np.array([packet.pts for packet in file.demux(film) if packet.size], float)
        timed = file.format.name not in media_info.UNTIMED_FORMATS
    if timed and np.isfinite(stamps).all():
        return np.argsort(np.argsort(stamps)), True
    shown: list[int] = []
    with open_media(source) as file:  # the decoder passes each packet's number on to its frame
        for number, packet in enumerate(file.demux(media_info.video_track(file, source))):
            packet.pts = packet.dts = number
            shown += [frame.pts for frame in packet.decode() if frame.pts is not None]
    return np.argsort(shown), False


def _copy(source: Path, target: Path, stamps: IntArray, unit: Fraction) -> None:
    """Copy the packets of a video to a .mov, with presentation times `stamps` in `unit` (s)."""
    ordered = np.sort(stamps)
    # Each packet must be decoded before it is shown, and packets are decoded in file order.
    decoded = ordered - int(np.max(ordered - stamps))
    address = media_info.file_address(target)
    with open_media(source) as file, av.open(address, "w") as new:
        stream = media_info.video_track(file, source)
        track = new.add_stream_from_template(stream)
        new.metadata["title"] = media_info.PACKED_FROM + source.name
        track.time_base = unit
        packets = (packet for packet in file.demux(stream) if packet.size)
        for packet, shown, first in zip(packets, stamps, decoded, strict=True):
            packet.stream, packet.time_base = track, unit
            packet.pts, packet.dts, packet.duration = int(shown), int(first), 0
            new.mux(packet)
