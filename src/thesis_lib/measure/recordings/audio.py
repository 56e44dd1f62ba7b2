"""Audio of videos and sound files: track, channels, clock rate and samples.

A file states a sample rate; its time stamps imply another one if the recorder stamps audio by the
clock of its images. The time stamps are used: a line through them against the samples gives the
samples per second of the video's clock, and only a jump between them is a gap.
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
from thesis_lib.files import stat_file
from thesis_lib.measure.recordings import media_info
from thesis_lib.measure.recordings.media_info import MediaError

BLOCK_SAMPLES = 1 << 16  # samples that are read at once
SAMPLE_FORMAT = "flt"  # interleaved channels: PyAV cannot read eight planes or more
MIN_GAP_S = 0.015  # least jump of time stamps that is a gap: the shortest lost packet has 20 ms
JUMP_FRAMES = 8  # on either side of a jump; medians are compared: a single late stamp is no jump
PRIMING_S = 0.15  # time at either end in which a jump is encoder priming: 4 AAC packets have 85 ms
MILLISECOND_S = 1.001e-3  # rounding of time stamps in containers that count in milliseconds
PACE_PARTS = 16  # parts of a track whose mean time stamps give the standard error of the pace
PACE_SIGMAS = 5.0  # standard errors beyond which a pace differs significantly from 1
MIN_LEVEL_RATIO = 0.1  # rms over the loudest channel's or track's (−20 dB), below which: no signal
MAX_SILENT_RMS = 1e-4  # rms below which there is no signal: three steps of 16 bits
FULL_SCALE = 1 - 1e-4  # level from which a sample counts as clipped
MAX_CANCELLED_RATIO = 0.5  # rms of a mix over that of uncorrelated channels; below, these cancel
#: Delay of MP3 in samples if the file states none: the usual 576 of the encoder, and 529 of the
#: decoder
MP3_DELAY = 1105


@dataclass(frozen=True)
class AudioTrack:
    """Audio of a video or sound file, whose samples are read block by block."""

    rate: float  #: Samples per second of the video's clock
    start: float  #: Time of the first sample after that of the first frame, s
    blocks: Callable[[], Iterator[Array]]  #: Reads the samples in −1…1, mixed to one channel
    stated_rate: int  #: Samples per second that the file states
    samples: int  #: Number of samples
    level: float  #: Rms of the samples about their mean, relative to full scale
    clipped: int  #: Number of samples at full scale, in the channel with the fewest
    #: Track, channels and rate, unless these are the whole first track at the stated rate
    source: str = ""

    @property
    def silence(self) -> str:
        """Return a message if the audio has no signal, else an empty text."""
        if self.level >= MAX_SILENT_RMS:
            return ""
        rms = f"rms {self.level:.1e} of full scale"
        return f"silent audio ({rms}), allowed: at least {MAX_SILENT_RMS}"


@dataclass
class _Survey:
    """Time stamps and levels of one audio track, gathered frame by frame."""

    channels: int
    unit: float  #: Unit of the time stamps, s
    late: int  #: Encoder delay that the file format cannot state, samples
    rate: int = 0  #: Sample rate of the decoded frames, Hz
    times: list[float] = field(default_factory=list)  #: Time stamp of each frame, s
    counts: list[int] = field(default_factory=list)  #: Samples of each frame
    #: Sums of the channels' samples and of their products, for the covariance
    sums: Any = 0.0
    products: Any = 0.0
    clipped: Any = 0  #: Number of samples at full scale in each channel
    damaged: bool = False  #: Whether the track cannot be decoded beyond these frames

    def add(self, frame: av.AudioFrame, block: Array) -> None:
        """Add a frame with the samples `block`, shape (channels, samples)."""
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
    """Return the audio of a video or a sound file of any length.

    The first track within 20 dB of the loudest track is used. Its channels within 20 dB of the
    loudest channel are mixed; if these would cancel, only the loudest is used. Alternatively,
    ``channel`` selects one channel, numbered from 1 through all tracks.

    Raises
    ------
    MediaError
        If there is no audio track or no such channel, or if the audio is empty, damaged or gapped.
    """
    media_info.check_is_file(path)
    surveys = _survey(path, stat_file(path))
    if not surveys:
        raise MediaError(f"{path}: no audio track; it is needed to synchronise the cameras")
    if channel is None:
        index, chosen, words = _select_channels(surveys)
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
    film = media_info.first_frame_time(path)
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
    """Read the audio of a video, mixed to one channel.

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
    """Yield blocks of samples from a range of a track's frames, the mean of some channels."""
    convert = av.AudioResampler(format=SAMPLE_FORMAT)
    blocks, held = [], 0
    with media_info.open_media(path) as file:
        try:
            frames = file.decode(media_info.sound_tracks(file)[index])
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
    """Decode all audio tracks for time stamps and levels; cached until the file changes."""
    with media_info.open_media(path) as file:
        tracks, found = media_info.sound_tracks(file), {}
        for one in tracks:
            hidden = file.format.name == "avi" and one.codec_context.name.startswith("mp3")
            late = MP3_DELAY if hidden else 0
            found[one.index] = _Survey(one.channels, float(one.time_base or 0), late)
        convert = {track.index: av.AudioResampler(format=SAMPLE_FORMAT) for track in tracks}
        try:
            for packet in file.demux(*tracks) if tracks else ():  # demux() would read all streams
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


def _select_channels(surveys: Sequence[_Survey]) -> tuple[int, list[int], str]:
    """Choose the track and its channels with a signal; describe them if others have none."""
    levels = [
        0.0 if one.damaged else np.sqrt(np.diag(one.covariance).clip(0)).max(initial=0.0)
        for one in surveys
    ]
    track = next(k for k, level in enumerate(levels) if level >= MIN_LEVEL_RATIO * max(levels))
    words = [f"track {track + 1} of {len(surveys)}"] if track else []
    covariance = surveys[track].covariance
    each = np.sqrt(np.diag(covariance).clip(0))
    channels = np.flatnonzero(each >= MIN_LEVEL_RATIO * each.max(initial=0.0))
    part = covariance[np.ix_(channels, channels)]
    if len(channels) > 1 and part.sum() < MAX_CANCELLED_RATIO**2 * np.trace(part):
        channels = np.array([int(np.argmax(each))])  # they cancel when mixed
    if len(channels) < len(each):
        numbers = ", ".join(str(c + 1) for c in channels)
        words.append(f"channel{'s' * (len(channels) > 1)} {numbers} of {len(each)}")
    return track, channels.tolist(), "; ".join(words)


def _timing(path: Path, own: _Survey) -> tuple[int, int, float, float]:
    """Fit a line to the time stamps against the samples.

    Returns the first frame and the one after the last without a jump, the time of the first sample
    in s, and the pace, in seconds of the time stamps per second of samples.
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
    """Find the frames at which time stamps jump permanently relative to the samples."""
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
    """Fit a slope to the means of parts; return it and its standard error."""
    parts = min(PACE_PARTS, len(x))
    if parts < 3:
        return 0.0, np.inf
    u, v = (np.array([part.mean() for part in np.array_split(z, parts)]) for z in (x, y))
    slope, offset = np.polyfit(u, v, 1)
    spread = float(np.sum((v - slope * u - offset) ** 2)) / (parts - 2)
    return float(slope), float(np.sqrt(spread / np.sum((u - u.mean()) ** 2)))
