"""Videos with sound as recorders write it: paces, jumps, priming, channels and tracks."""

import struct
from contextlib import ExitStack
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path

import av
import numpy as np
from av.stream import Disposition

from thesis_lib.measure.recordings.audio import FULL_SCALE, AudioTrack
from thesis_lib.measure.synchronisation.audio import AudioSource
from thesis_lib.measure.synchronisation.listen import load_audio, synchronise_cameras

BLOCK = 1024  # samples of a frame of AAC
DEEP = "gray16le"


@dataclass(frozen=True)
class HeldSound(AudioSource):
    """Sound in memory, as a file has it."""

    samples: object = ()
    rate: float = 48000.0
    start: float = 0.0

    def probe(self):
        block = np.asarray(self.samples, float)
        full = np.count_nonzero(np.abs(block) >= FULL_SCALE)
        return AudioTrack(
            self.rate, self.start, lambda: iter([block]), self.rate, len(block), block.std(), full
        )


def synchronise_sounds(signals, rate, frequency=None, starts=None):
    """The starts of cameras from sounds in memory; a room's without a frequency."""
    starts = np.zeros(len(signals)) if starts is None else starts
    sources = [
        HeldSound(f"recording {k}", Path(f"recording {k}"), None, signal, rate, start)
        for k, (signal, start) in enumerate(zip(signals, starts, strict=True))
    ]
    heard = load_audio(sources, frequency)
    return synchronise_cameras(sources, heard, frequency)


def click(seconds, at, rate=48000):
    """Faint noise, and a click."""
    sound = 0.001 * np.random.default_rng(0).standard_normal(round(seconds * rate))
    sound[round(at * rate)] = 0.9
    return sound


def claps(seed, seconds=12, rate=16000):
    """Murmur and a few claps."""
    rng = np.random.default_rng(seed)
    sound = 0.01 * rng.standard_normal(seconds * rate)
    for at in rng.uniform(0.5, seconds - 0.5, 6):
        first = int(at * rate)
        sound[first : first + 500] += 0.4 * rng.standard_normal(500) * np.exp(-np.arange(500) / 75)
    return sound


def music(seed, seconds=24, rate=16000, beat=0.5):
    """Drums that are alike at every beat, and notes that are not."""
    rng = np.random.default_rng(seed)
    n = int(beat * rate)
    t = np.arange(n) / rate
    drum = np.sin(2 * np.pi * 60 * t) * np.exp(-t / 0.05)
    sound = np.tile(drum, int(seconds / beat))
    for k in range(0, len(sound), n):
        pitch = 220 * 2 ** (rng.integers(0, 25) / 12)
        notes = [np.sin(2 * np.pi * pitch * h * t + rng.uniform(0, 6)) / h for h in (1, 2, 3)]
        sound[k : k + n] += 0.5 * sum(notes) * np.exp(-4 * t)
    return 0.3 * sound


def later(sound, start, seconds, rate=16000, fast=0.0, to_rate=None, seed=0):
    """What a recorder hears that starts later, with noise of its own, by a clock that is fast."""
    to_rate = to_rate or rate
    times = start + np.arange(int(seconds * to_rate)) / to_rate / (1 + fast)
    spectrum = np.fft.rfft(sound)
    fine = np.fft.irfft(np.concatenate([spectrum, np.zeros(7 * len(spectrum))]), 8 * len(sound)) * 8
    heard = np.interp(times * 8 * rate, np.arange(len(fine)), fine)
    return heard + 0.003 * np.random.default_rng(seed).standard_normal(len(heard))


def write_film(path, tracks=(), rate=48000, *, frames=30, frame_rate=30, pictures="mpeg4",
               pix_fmt="yuv420p", limited=None, times=None, tick=None, options=None,
               container=None, codec="aac", layout="mono", start=0, stamps=None):  # fmt: skip
    """A film as other programs write it, with sound tracks (samples,) or (channels, samples).

    `frames` are images, or a number of plain ones; they are shown at `times`, in frames or in
    `tick` s. `limited` is whether grey levels are 16…235. Sound begins `start` samples late;
    `stamps` maps the time stamps of its packets, in samples.
    """
    if isinstance(frames, int):
        frames = [np.full((48, 64), 40 + k % 100, np.uint8) for k in range(frames)]
    images = iter(frames)
    first = next(images, None)
    with av.open(str(path), "w", options=container or {}) as file:
        film = None
        if first is not None:
            rate_of_frames = Fraction(frame_rate).limit_denominator(1001)
            film = file.add_stream(pictures, rate=rate_of_frames, options=options or {})
            film.height, film.width = first.shape[:2]
            film.pix_fmt = pix_fmt
            if tick:
                film.codec_context.time_base = tick
            ranges = {}
            if limited is not None:
                film.codec_context.color_range = 1 if limited else 2
                ranges = {"src_color_range": 2, "dst_color_range": 1 if limited else 2}
        outs = [file.add_stream(codec, rate=rate, layout=layout) for _ in tracks]
        if film is not None:
            for k, image in enumerate(chain([first], images)):
                kind = "rgb24" if image.ndim == 3 else "gray" if image.dtype == np.uint8 else DEEP
                frame = av.VideoFrame.from_ndarray(image, format=kind)
                if kind != pix_fmt:
                    frame = frame.reformat(format=pix_fmt, **ranges)
                frame.pts = k if times is None else times[k]
                frame.time_base = tick or 1 / rate_of_frames
                file.mux(film.encode(frame))
            file.mux(film.encode(None))
        for track, sound in zip(outs, tracks, strict=True):
            packets = []
            samples = np.atleast_2d(np.asarray(sound, np.float32))
            convert = av.AudioResampler(format=track.format, layout=layout, frame_size=BLOCK)
            block = av.AudioFrame.from_ndarray(np.ascontiguousarray(samples), "fltp", layout)
            block.sample_rate, block.pts, block.time_base = rate, start, Fraction(1, rate)
            if codec.startswith("pcm") or codec == "aac":
                parts = [*convert.resample(block), *convert.resample(None)]
            else:
                parts = _blocks(samples, track, rate, layout)
            for part in parts:
                packets += track.encode(part)
            packets += track.encode(None)
            for packet in packets:
                if stamps is not None:
                    packet.pts = packet.dts = round(stamps(packet.pts))
                file.mux(packet)
    return path


def _blocks(samples, track, rate, layout):
    size = track.codec_context.frame_size or BLOCK
    for k in range(0, samples.shape[1], size):
        part = np.ascontiguousarray(samples[:, k : k + size])
        frame = av.AudioFrame.from_ndarray(part, "fltp", layout)
        frame.sample_rate, frame.pts, frame.time_base = rate, k, Fraction(1, rate)
        yield from av.AudioResampler(format=track.format, layout=layout).resample(frame)


def copy_tracks(sources, path, *, options=None, metadata=None, still=False):
    """The films of other files in one, as they are; the first of them may be marked as a still."""
    with ExitStack() as stack:
        files = [stack.enter_context(av.open(str(source))) for source in sources]
        new = stack.enter_context(av.open(str(path), "w", options=options or {}))
        new.metadata.update(metadata or {})
        tracks = [new.add_stream_from_template(file.streams.video[0]) for file in files]
        if still:
            tracks[0].disposition = Disposition.attached_pic
        for file, track in zip(files, tracks, strict=True):
            for packet in file.demux(file.streams.video[0]):
                if packet.size:
                    packet.stream = track
                    new.mux(packet)


def turn_film(path, to, matrix):
    """An upright film in .mp4 or .mov with another matrix (a, b, c, d) in its track's header."""
    data = path.read_bytes()
    one, new = (
        struct.pack(">9i", a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30)
        for a, b, c, d in ((1, 0, 0, 1), matrix)
    )
    at = data.index(one, data.index(b"tkhd"))
    to.write_bytes(data[:at] + new + data[at + len(new) :])


def append_sony_rate(path, to, captured, shown):
    """A film with the rate of the sensor at its end, as Sony's cameras write it."""
    xml = f'<VideoFrame videoCodec="AVC" captureFps="{captured}p" formatFps="{shown}p"/>'.encode()
    to.write_bytes(path.read_bytes() + struct.pack(">I4s", 8 + len(xml), b"free") + xml)
