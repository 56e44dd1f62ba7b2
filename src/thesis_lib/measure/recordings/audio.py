"""Sound of videos and sound files: its track, its channels, its pace, and its samples.

A file states a sample rate, and its time stamps state another one where the recorder stamps sound
by the clock of its images. The time stamps count: a line through them against the samples gives
the samples per second of the video's clock, and only a jump between them is a gap.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.media_info import (
    MediaError,
    check_is_file,
    open_media,
    sound_tracks,
    start_of_film,
)

BLOCK_SAMPLES = 1 << 16  # that are read at once
SAMPLE_FORMAT = "flt"  # of all channels in turn: PyAV cannot read eight planes or more
MIN_GAP_S = 0.015  # jump of time stamps that is a gap: the shortest packet that is lost has 20 ms
JUMP_FRAMES = 8  # on either side of a jump whose median counts, so that one late stamp is none
PRIMING_S = 0.15  # at either end in which a jump is the encoder's: 4 packets of AAC have 85 ms
MILLISECOND_S = 1.001e-3  # rounding of time stamps in containers that count in milliseconds
PACE_PARTS = 16  # of a track whose mean time stamps tell the standard error of its pace
PACE_SIGMAS = 5.0  # standard errors from which on a pace counts
MAX_FAINT_RATIO = 0.1  # of the loudest channel's or track's rms, 20 dB below it: holds no sound
MAX_SILENT_RMS = 1e-4  # rms below which there is no signal: three steps of 16 bits
FULL_SCALE = 1 - 1e-4  # from here on a sample counts as clipped
MAX_CANCELLED_RATIO = 0.5  # of the rms that unlike channels have when they are mixed: these cancel
#: Samples by which MP3 comes late where the file says no delay: the usual 576 of the encoder, and
#: 529 of the decoder
MP3_DELAY = 1105


@dataclass(frozen=True)
class AudioTrack:
    """Sound of a video, whose samples are read block by block."""

    rate: float  #: Samples per second of the video's clock
    start: float  #: Time of the first sample after that of the first frame, s
    blocks: Callable[[], Iterator[Array]]  #: Reads the samples in −1…1, mixed to one channel
    stated_rate: int  #: Samples per second that the file states
    samples: int  #: Number of samples
    level: float  #: Root mean square of the samples less their mean, of full scale
    clipped: int  #: Number of samples at full scale, in the channel that has the fewest
    #: Track, channels and pace, where these are not all of the first track at the stated rate
    source: str = ""

    @property
    def silence(self) -> str:
        """Return what to say of a sound without a signal, empty of another."""
        if self.level >= MAX_SILENT_RMS:
            return ""
        rms = f"rms {self.level:.1e} of full scale"
        return f"silent audio ({rms}), allowed: at least {MAX_SILENT_RMS}"


@dataclass
class _Survey:
    """Time stamps and levels of one audio track, gathered frame by frame."""

    channels: int
    unit: float  #: Of the time stamps, s
    late: int  #: Samples by which an encoder's delay that the file cannot state makes it late
    rate: int = 0  #: Of the decoded frames in Hz
    times: list[float] = field(default_factory=list)  #: Time stamp of each frame, s
    counts: list[int] = field(default_factory=list)  #: Samples of each frame
    #: Sums over the samples of the channels, and of their products, for their covariance
    sums: Any = 0.0
    products: Any = 0.0
    clipped: Any = 0  #: Samples at full scale of each channel
    damaged: bool = False  #: Whether what follows these frames cannot be decoded

    def add(self, frame: av.AudioFrame, block: Array) -> None:
        """Take one more frame, whose samples are `block`, shape (channels, samples)."""
        if not np.isfinite(block).all():
            raise ValueError("samples that are no numbers")
        self.rate, self.channels = frame.sample_rate, len(block)
        self.times.append(np.nan if frame.time is None else frame.time)
        self.counts.append(frame.samples)
        self.sums += block.sum(axis=1)
        self.products += block @ block.T
        self.clipped += np.count_nonzero(np.abs(block) >= FULL_SCALE, axis=1)

    @property
    def covariance(self) -> Array:
        """Return the covariance of the channels, shape (channels, channels)."""
        n = max(sum(self.counts), 1)
        return np.asarray(self.products / n - np.outer(self.sums, self.sums) / n**2)


def probe_audio(path: Path, channel: int | None = None) -> AudioTrack:
    """Return the sound of a video or a sound file of any length.

    Of several tracks the first that holds sound is used, or the loudest, if that is 20 dB louder;
    of its channels those that hold sound are mixed, unless they cancel. Or one ``channel`` is used,
    the first is 1; all tracks' channels are counted through.

    Raises
    ------
    MediaError
        If the file has no audio track, or no such channel, or if its sound is damaged or has a gap.
    """
    check_is_file(path)
    now = path.stat()
    surveys = _survey(path, (now.st_ino, now.st_size, now.st_mtime_ns))
    if not surveys:
        raise MediaError(f"{path}: no audio track; it is needed to synchronise the cameras")
    if channel is None:
        index, chosen, words = _loud(surveys)
    else:
        every = [(k, [c]) for k, one in enumerate(surveys) for c in range(one.channels)]
        if channel > len(every):
            raise MediaError(f"{path}: given channel {channel}, allowed: 1 to {len(every)}")
        (index, chosen), words = every[channel - 1], ""
    survey = surveys[index]
    if survey.damaged:
        after = sum(survey.counts) / max(survey.rate, 1)
        raise MediaError(f"{path}: damaged audio after {after:.3f} s")
    if not survey.counts:
        raise MediaError(f"{path}: the audio track is empty")
    first, last, start, pace = _timing(path, survey)
    film = start_of_film(path)
    rate, part = survey.rate, survey.covariance[np.ix_(chosen, chosen)]
    own = rate / pace
    if own != rate:
        stamps = f"{own:.2f} samples a second by its time stamps, {rate} stated"
        words = "; ".join(filter(None, [words, stamps]))
    return AudioTrack(
        rate=own,
        start=0.0 if film is None else start - film - survey.late / rate,
        blocks=partial(_mix_blocks, path, index, slice(first, last), chosen),
        stated_rate=rate,
        samples=sum(survey.counts[first:last]),
        level=float(np.sqrt(max(part.mean(), 0.0))),
        clipped=int(min(survey.clipped[chosen])),
        source=words,
    )


def read_audio(path: Path) -> tuple[Array, float, float]:
    """Read the sound of a video, mixed to one channel.

    Returns
    -------
    samples : ndarray, shape (samples,)
        In −1…1.
    sample_rate : float
        Samples per second of the video's clock.
    start_time : float
        Time of the first sample after that of the first frame, s.
    """
    audio = probe_audio(path)
    return np.concatenate(list(audio.blocks())), audio.rate, audio.start


def _samples_of(frame: av.AudioFrame) -> Array:
    """Return the samples of a frame of :data:`SAMPLE_FORMAT`, shape (channels, samples)."""
    return np.ascontiguousarray(frame.to_ndarray().reshape(-1, frame.layout.nb_channels).T)


def _mix_blocks(path: Path, index: int, part: slice, channels: list[int]) -> Iterator[Array]:
    """Yield samples of a part of a track's frames, mixed of some channels, many frames at once."""
    convert = av.AudioResampler(format=SAMPLE_FORMAT)
    blocks, held = [], 0
    with open_media(path) as file:
        try:
            frames = file.decode(sound_tracks(file)[index])
            for frame in islice(frames, part.start, part.stop):
                for block in convert.resample(frame):
                    blocks.append(_samples_of(block)[channels].mean(axis=0))
                held += frame.samples
                if held >= BLOCK_SAMPLES:
                    yield np.concatenate(blocks, dtype=float)
                    blocks, held = [], 0
        except (av.FFmpegError, OSError, IndexError):  # by now it may be another file
            raise MediaError(f"{path}: damaged audio") from None
    if blocks:
        yield np.concatenate(blocks, dtype=float)


@lru_cache(maxsize=64)
def _survey(path: Path, _as_it_is: tuple[int, ...]) -> list[_Survey]:
    """Decode all audio tracks for their time stamps and levels, once unless the file changes."""
    with open_media(path) as file:
        tracks, found = sound_tracks(file), {}
        for one in tracks:
            hidden = file.format.name == "avi" and one.codec_context.name.startswith("mp3")
            late = MP3_DELAY if hidden else 0
            found[one.index] = _Survey(one.channels, float(one.time_base or 0), late)
        convert = {track.index: av.AudioResampler(format=SAMPLE_FORMAT) for track in tracks}
        try:
            for packet in file.demux(*tracks) if tracks else ():  # without any: all that there are
                own = found[packet.stream.index]
                try:
                    for frame in () if own.damaged else packet.decode():
                        for block in convert[packet.stream.index].resample(frame):  # type: ignore[arg-type]
                            own.add(frame, _samples_of(block).astype(float))  # type: ignore[arg-type]
                except (av.FFmpegError, OSError, ValueError):
                    own.damaged = True
        except (av.FFmpegError, OSError):
            for own in found.values():
                own.damaged = True
    return [*found.values()]


def _loud(surveys: Sequence[_Survey]) -> tuple[int, list[int], str]:
    """Choose the track and its channels that hold sound, and name them where others do not."""
    levels = [
        0.0 if one.damaged else np.sqrt(np.diag(one.covariance).clip(0)).max(initial=0.0)
        for one in surveys
    ]
    track = next(k for k, level in enumerate(levels) if level >= MAX_FAINT_RATIO * max(levels))
    words = [f"track {track + 1} of {len(surveys)}"] if track else []
    covariance = surveys[track].covariance
    each = np.sqrt(np.diag(covariance).clip(0))
    channels = np.flatnonzero(each >= MAX_FAINT_RATIO * each.max(initial=0.0))
    part = covariance[np.ix_(channels, channels)]
    if len(channels) > 1 and part.sum() < MAX_CANCELLED_RATIO**2 * np.trace(part):
        channels = np.array([int(np.argmax(each))])  # they cancel when mixed
    if len(channels) < len(each):
        numbers = ", ".join(str(c + 1) for c in channels)
        words.append(f"channel{'s' * (len(channels) > 1)} {numbers} of {len(each)}")
    return track, channels.tolist(), "; ".join(words)


def _timing(path: Path, own: _Survey) -> tuple[int, int, float, float]:
    """Fit a line through time stamps against samples.

    Return the first frame and the one after the last without a jump, the time of the first sample
    in s, and the pace, in seconds of the time stamps for one of the samples.
    """
    times, rate = np.array(own.times), own.rate
    samples = np.concatenate([[0], np.cumsum(own.counts)]) / rate
    if not np.isfinite(times).all():  # no time stamps: the samples are the clock
        return 0, len(times), float(np.nan_to_num(times[0])), 1.0
    off = times - samples[:-1]
    first, last = 0, len(times)
    for k in _jumps(off):
        if samples[k] < PRIMING_S:
            first = k
        elif samples[-1] - samples[k] < PRIMING_S:
            last = min(last, k)
        else:
            end, jump = times[k - 1] + own.counts[k - 1] / rate, off[k] - off[k - 1]
            why = f"its time stamps jump by {jump:+.3f} s"
            raise MediaError(f"{path}: the audio has a gap at {end:.3f} s: {why}")
    x, y = samples[first:last] - samples[first], off[first:last]
    rounding = MILLISECOND_S if own.unit > MILLISECOND_S / 3 else 2 * own.unit
    if np.abs(y - y[0]).max() <= rounding:
        return first, last, float(times[first]), 1.0
    slope, error = _slope(x, y)
    if abs(slope) < PACE_SIGMAS * error or abs(slope) * x[-1] <= rounding:
        return first, last, float(times[first] + np.median(y - y[0])), 1.0
    return first, last, float(times[first] + np.median(y - y[0] - slope * x)), 1 + slope


def _jumps(off: Array) -> list[int]:
    """Find the frames at which time stamps jump against the samples for good."""
    if len(off) < 2:
        return []
    step = np.diff(off)
    trend = float(np.median(step[JUMP_FRAMES:] if len(step) > 4 * JUMP_FRAMES else step))
    found: list[int] = []
    for k in np.flatnonzero(np.abs(step - trend) > MIN_GAP_S / 2) + 1:
        before = off[max(k - JUMP_FRAMES, found[-1] if found else 0) : k]
        after = off[k : k + JUMP_FRAMES]
        drift = trend * (len(before) + len(after)) / 2
        if abs(np.median(after) - np.median(before) - drift) > MIN_GAP_S:
            found.append(int(k))
    return found


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Fit a slope, and tell its standard error from the means of parts."""
    parts = min(PACE_PARTS, len(x))
    if parts < 3:
        return 0.0, np.inf
    u, v = (np.array([part.mean() for part in np.array_split(z, parts)]) for z in (x, y))
    slope, offset = np.polyfit(u, v, 1)
    spread = float(np.sum((v - slope * u - offset) ** 2)) / (parts - 2)
    return float(slope), float(np.sqrt(spread / np.sum((u - u.mean()) ** 2)))
