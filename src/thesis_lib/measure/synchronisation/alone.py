"""Put videos and audio files of one event on one clock by their sound (``thesis sync``)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from thesis_lib.files import check_outputs, put_files, staging
from thesis_lib.measure.recordings.audio import probe_audio, read_audio
from thesis_lib.measure.recordings.media_info import first_frame_time, probe_media
from thesis_lib.measure.recordings.text_files import write_csv
from thesis_lib.measure.synchronisation.audio import AudioSource
from thesis_lib.measure.synchronisation.drift import Drift, estimate_drifts
from thesis_lib.measure.synchronisation.listen import load_audio
from thesis_lib.plotting.style import cycle_color, drawable_names, in_style, save_figure, subplots
from thesis_lib.web.html import render_lines

ENVELOPE_POINTS = 1500  # points of a plotted envelope
MIN_AGREED_SHARE = 0.9  # share of agreeing windows below which the report warns


def synchronise_videos(videos: Sequence[Path]) -> tuple[list[Drift], list[str]]:
    """Estimate starts and clock rates relative to the first video; return them and all names.

    Parameters
    ----------
    videos : sequence of Path
        Two or more videos with sound, or audio files.

    Raises
    ------
    MediaError, SynchronisationError
        If a file's sound is missing or damaged, or does not match that of the first file.
    """
    names = [video.stem for video in videos]
    if len(set(names)) < len(names):
        names = [str(video) for video in videos]
    recordings = [AudioSource(*one) for one in zip(names, videos, strict=True)]
    load_audio(recordings, None)  # raises an error for unusable sound
    return [*estimate_drifts(recordings, dict.fromkeys(range(1, len(videos)))).values()], names


def _round_to(value: float, std: float, sign: str = "+") -> str:
    """Format a value with the decimals that show two significant digits of its uncertainty."""
    decimals = max(0, 1 - int(np.floor(np.log10(std))))
    return f"{value:{sign}.{decimals}f}"


def write_synchronisation(videos: Sequence[Path], out: Path) -> list[str]:
    """Write ``sync.csv`` and ``sync.png`` into a folder; return the results as sentences."""
    check_outputs(out, [out / "sync.csv", out / "sync.png"])
    drifts, names = synchronise_videos(videos)
    rates = (
        probe_media(video).frame_rate for video in videos if first_frame_time(video) is not None
    )
    frame_rate = next(rates, np.nan)
    picture = save_figure(_picture(videos, drifts, names), "png", dpi=140)
    rows = [Drift(0.0, 0.0, 0.0, 0.0, agreement=1.0), *drifts]
    table = pd.DataFrame(
        {
            "video": names,
            "starts_after_s": [one.delay for one in rows],
            "standard_error_s": [one.delay_deviation for one in rows],
            "in_frames": [one.delay * frame_rate for one in rows],
            "clock_fast_by_ppm": [1e6 * one.fast for one in rows],
            "ppm_standard_error": [1e6 * one.drift_deviation for one in rows],
            "agreeing_share": [one.agreement for one in rows],
        }
    )
    with staging(out) as part:
        write_csv(table, part / "sync.csv", "%.9g")
        (part / "sync.png").write_bytes(picture)
        put_files(part, out)
    found = render_lines(  # the table in sentences, uncertainties with two digits
        "measure/synchronisation/templates/videos.txt.j2",
        first=names[0],
        starts=[*zip(names[1:], drifts, strict=True)],
        frame_rate=None if np.isnan(frame_rate) else frame_rate,
        is_unknown=np.isnan,
        round_to=_round_to,
        least_agreement=MIN_AGREED_SHARE,
    )
    for video, name in zip(videos, names, strict=True):
        if source := probe_audio(video).source:  # not all channels, or not at the stated rate
            found.append(f"{name}'s sound: {source}")
    return found


def _picture(videos: Sequence[Path], drifts: Sequence[Drift], names: Sequence[str]) -> Figure:
    """Plot sound envelopes on the first video's clock, and the delays of the windows."""
    shown = drawable_names(names, "video")
    with in_style():
        figure, (top, low) = subplots(2, 1, figsize=(7.6, 5.2), layout="constrained")
        for k, video in enumerate(videos):
            sound, rate, start = read_audio(video)
            step = max(len(sound) // ENVELOPE_POINTS, 1)  # the maximum over each step is plotted
            loud = np.abs(sound[: len(sound) // step * step]).reshape(-1, step).max(axis=1)
            times = start + (np.arange(len(loud)) + 0.5) * step / rate
            loud = loud / max(float(loud.max()), 1e-12)
            if k:
                times = times * (1 - np.nan_to_num(drifts[k - 1].drift)) + drifts[k - 1].delay
            top.fill_between(times, -k - 0.45 * loud, -k + 0.45 * loud, color=cycle_color(k), lw=0)
        top.set(yticks=-np.arange(len(names)), xlabel=f"time on the clock of {shown[0]} in s",
                title="sound, put on one clock")  # fmt: skip
        top.set_yticklabels(shown)
        for k, one in enumerate(drifts, 1):
            late = 1e3 * (one.delays - one.delay)
            low.plot(one.times, late, ".", color=cycle_color(k), label=shown[k])
            if np.isfinite(one.drift):
                ends = np.array([0.0, one.times.max()])
                low.plot(ends, -1e3 * one.drift * ends, color=cycle_color(k), linewidth=0.8)
        low.set(xlabel="time in s", ylabel="ms", title="windows: delay less that at the start")
        low.legend()
    return figure
