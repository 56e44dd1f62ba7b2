"""Images in a folder, raw frames, or a film at another rate, as a lossless video.

Industrial cameras write one image per frame, and Photron's raw frames (``.mraw``) beside a header
in text (``.cih``) or XML (``.cihx``). Phantom's ``.cine`` is read as it is.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from thesis_lib.arrays import Image, IntArray
from thesis_lib.files import whole_file
from thesis_lib.measure.recordings.manifest import IMAGE_SUFFIXES, find_images
from thesis_lib.measure.recordings.media import depth_of, read_frames, read_png, write_video
from thesis_lib.measure.recordings.media_info import (
    PACKED_FROM,
    UNTIMED_FORMATS,
    MediaError,
    file_address,
    frame_clock,
    open_media,
    probe_media,
    video_track,
)
from thesis_lib.measure.recordings.text_files import TextFileError, read_text
from thesis_lib.measure.recordings.validation import rate_of
from thesis_lib.studies.fields import format_given

MAX_SAMPLED_PICTURES = 50  # of a folder, in which the brightest grey level is looked for
#: Names in the text header and in the XML header of what is needed, and the numbers allowed
RAW_FIELDS = {
    "rate": ("Record Rate(fps)", "recordRate", (1, 10**7)),  # Hz; the fastest sold reach 2e6
    "frames": ("Total Frame", "totalFrame", (1, 10**8)),
    "width": ("Image Width", "width", (2, 16384)),  # px, as H.264 allows
    "height": ("Image Height", "height", (2, 16384)),
    "bits": ("Color Bit", "bit", (8, 16)),
    "depth": ("EffectiveBit Depth", "depth", (8, 16)),
}
RAW_BITS = 8, 12, 16  # of a pixel, that are read
BIT_SIDE_FIELD = ("EffectiveBit Side", "side")  # "Lower" or "Higher" bits of sixteen


def pack_frames(
    source: Path,
    target: Path,
    rate: float | None = None,
    say: Callable[[str], object] = lambda line: None,
) -> tuple[int, tuple[int, int]]:
    """Write frames to a video without loss of grey levels of eight bits.

    Parameters
    ----------
    source : Path
        Folder of images, in the order of their names, numbers by value; or a ``.cih`` or
        ``.cihx`` beside its ``.mraw``; of more than eight bits the highest eight that are used
        are kept. Or a film, or a raw stream such as ``.h264``, whose frames are copied.
    target : Path
        File to write, ending in .mov.
    rate : float, optional
        Frames per second in Hz; raw frames know their own.

    Returns
    -------
    frames : int
        How many there are.
    size : tuple of int
        Width and height in px; a last odd row or column is left out.

    Raises
    ------
    MediaError
        If there are no frames, they are not alike or cut off, or no rate is known.
    """
    if target.suffix != ".mov":
        raise MediaError(f"{target}: given the ending {target.suffix!r}, allowed: .mov")
    raw = source.suffix.lower() in (".cih", ".cihx")
    if source.is_file() and not raw:
        if rate is None:
            raise MediaError(f"{source}: give --rate-hz, the rate at which its frames were taken")
        probe_media(source)
        return _retime_frames(source, target, rate), probe_media(target).size
    own, frames = _raw(source) if raw else (None, _pictures(source, say))
    if rate is None and own is None:
        raise MediaError(f"{source}: images carry no frame rate: give --rate-hz")
    count, shape = 0, (0, 0)

    def even() -> Iterator[Image]:
        nonlocal count, shape
        for frame in frames:
            shape = (frame.shape[0] // 2 * 2, frame.shape[1] // 2 * 2)
            count += 1
            yield frame[: shape[0], : shape[1]]

    frequency = float(rate or own or 0)
    write_video(target, even(), frequency, None, codec="h264", crf=0)  # 0 loses nothing
    return count, shape[::-1]


def _pictures(folder: Path, say: Callable[[str], object]) -> Iterator[Image]:
    if not folder.is_dir():
        raise MediaError(f"{folder}: allowed: a folder of images, a video, a .cih or a .cihx")
    files = find_images(folder.iterdir())
    if not files:
        raise MediaError(f"{folder}: no image in it ({', '.join(sorted(IMAGE_SUFFIXES))})")
    depth = max(map(depth_of, files[:: math.ceil(len(files) / MAX_SAMPLED_PICTURES)]))
    if 8 < depth < 16:
        say(f"{folder} has grey levels of {depth} bits: 2^{depth} − 1 is written as full scale.")
    return (read_png(file, depth) for file in files)


def _raw(header: Path) -> tuple[float, Iterator[Image]]:
    """Return the rate and frames of a header and the raw file beside it."""
    if not header.is_file():
        raise MediaError(f"{header}: no such file")
    try:
        text = read_text(header, errors="replace")
    except TextFileError as error:
        raise MediaError(f"{header}: {error}") from None
    xml = header.suffix == ".cihx"
    said = {
        key: _header_number(header, text, names[xml], *bounds)
        for key, (*names, bounds) in RAW_FIELDS.items()
    }
    rate = said.pop("rate")
    number = {key: int(value) for key, value in said.items()}
    side = _header_value(header, text, BIT_SIDE_FIELD[xml])
    if side not in ("Lower", "Higher"):
        raise MediaError(
            f"{header}: {BIT_SIDE_FIELD[xml]}: given {format_given(side)}, allowed: Lower or Higher"
        )
    bits, shape = number["bits"], (number["height"], number["width"])
    if bits not in RAW_BITS or number["depth"] > bits:
        raise MediaError(
            f"{header}: {bits} bits for a pixel, {number['depth']} of them used, allowed: "
            f"{[*RAW_BITS]}, grey"
        )
    if bits == 12 and shape[0] * shape[1] % 2:
        raise MediaError(f"{header}: given {shape[1]} × {shape[0]} px, allowed: an even number")
    raw, size = header.with_suffix(".mraw"), shape[0] * shape[1] * bits // 8
    if not raw.is_file() or raw.stat().st_size < number["frames"] * size:
        raise MediaError(
            f"{raw}: not there, or shorter than the {number['frames']} frames of {header}"
        )
    shift = (16 if side == "Higher" else number["depth"]) - 8

    def frames() -> Iterator[Image]:
        with raw.open("rb") as file:
            for _ in range(number["frames"]):
                data = np.frombuffer(file.read(size), np.uint8)
                yield _take_eight(data, bits, shift).reshape(shape)

    return rate, frames()


def _header_value(header: Path, text: str, name: str) -> str:
    """Return what a header says for a name."""
    name_ = re.escape(name)
    xml = header.suffix == ".cihx"
    pattern = rf"<{name_}>([^<]+)</{name_}>" if xml else rf"^{name_} : (.+?)\r?$"
    match = re.search(pattern, text, re.MULTILINE)
    if match is None:
        raise MediaError(f"{header}: does not say {name!r}: not a header of Photron's?")
    return match[1].strip()


def _header_number(header: Path, text: str, name: str, low: float, high: float) -> float:
    """Return the number that a header gives for a name, refused outside of the bounds."""
    given = _header_value(header, text, name)
    try:
        value = float(given)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise MediaError(f"{header}: {name}: given {format_given(given)}, allowed: {low} to {high}")
    return value


def _take_eight(data: Image, bits: int, shift: int) -> Image:
    """Return the highest eight bits that are used of pixels of 8, 12 or 16 bits."""
    if bits == 16:
        return (data.view("<u2") >> shift).astype(np.uint8)
    if bits == 8:
        return data
    first, middle, last = data.reshape(-1, 3).T  # two pixels in three bytes, highest bits first
    return np.stack([first, (middle & 15) << 4 | last >> 4], axis=1).ravel()


TIME_UNIT_S = Fraction(1, 1_000_000)  # s, unit of the times of frames that come unevenly


def _retime_frames(source: Path, target: Path, rate: float) -> int:
    """Write the frames of a film or of a raw stream to a video that plays at another rate.

    Sound is left out: it does not go with frames that were taken at another rate. Frames are copied
    as they are; what a .mov cannot hold is encoded without loss of grey levels of eight bits. The
    source may be a raw stream of packets without time stamps, such as ``.h264``. Return the number
    of frames.
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
    write_video(target, frames, rate, None, codec="h264", crf=0, packed_from=source.name)
    return len(clock)


def _presentation_order(source: Path) -> tuple[IntArray, bool]:
    """Return the place of each packet among the frames shown, and whether it has a time stamp."""
    stamps: list[float] = []
    with open_media(source) as file:
        stream = video_track(file, source)
        for packet in file.demux(stream):
            if packet.size:
                stamps.append(np.nan if packet.pts is None else packet.pts)
        timed = file.format.name not in UNTIMED_FORMATS and bool(np.isfinite(stamps).all())
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
        new.metadata["title"] = PACKED_FROM + source.name
        track.time_base = unit
        packets = (packet for packet in file.demux(stream) if packet.size)
        for packet, shown, first in zip(packets, stamps, decoded, strict=True):
            packet.stream, packet.time_base = track, unit
            packet.pts, packet.dts, packet.duration = int(shown), int(first), 0
            new.mux(packet)
