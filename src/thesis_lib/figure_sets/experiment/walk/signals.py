"""What the cameras heard and followed: the force on their audio tracks, and a marker over time.

Each function makes one figure from the measured dataset. Cameras keep their colours throughout.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment.methods import ORDER
from thesis_lib.figure_sets.experiment.walk.sketches import INK, WIDE, names_of, tip_marker
from thesis_lib.measure.fitting.harmonics import fit_harmonics
from thesis_lib.measure.recordings.markers import rows_on
from thesis_lib.plotting.style import color, in_style, mosaic, subplots


def sound(data: xr.Dataset) -> Figure:
    """The start of the force on the four audio tracks, before and after alignment."""
    signal = data["picture_sound"].transpose("camera", "sample").values
    rate = float(data["picture_sound"].attrs["rate_hz"])
    seconds = np.arange(signal.shape[1]) / rate
    delay = data["delay"].values
    whole = data["delay_frames"].values / data["frame_rate"].values
    begin = float(data["steady"][0])
    with in_style():
        figure, panels = mosaic(
            [["own", "own"], ["whole", "part"]], figsize=(WIDE, 5.2), layout="constrained"
        )
        top, below = panels["own"], [panels["whole"], panels["part"]]
        for i, (own, name) in enumerate(zip(signal, names_of(data), strict=True)):
            top.plot(seconds, own - i, color=color(i), linewidth=0.9)
            text = f"{name}  {1000 * delay[i]:+.1f} ms".replace("-", "−") if i else name
            top.text(begin - 0.74, 0.13 - i, text, color=INK)
        top.set(
            title="(a) the force on each camera's clock; start after A's",
            xlabel="s after its first frame",
            xlim=(begin - 0.75, begin + 0.55),
            yticks=[],
        )
        top.grid(visible=False, axis="y")
        top.spines["left"].set_visible(False)
        middle = _crossing(seconds, signal[0], begin)
        titles = ("(b) aligned to whole frames", "(c) to fractions of a frame")
        for axes, shift, title in zip(below, (whole, delay), titles, strict=True):
            for i, own in enumerate(signal):
                time = 1000 * (seconds + shift[i] - middle)
                near = np.abs(time) < 30
                axes.plot(time[near], own[near], color=color(i), linewidth=1.3)
            axes.set(title=title, xlim=(-28, 28), xlabel="ms from a zero crossing")
            axes.axhline(0, color=INK, linewidth=0.6, zorder=0)
            axes.set_ylim(-0.45, 0.5)
        below[0].set_ylabel("force over full scale")
        below[1].tick_params(labelleft=False)
        half = 500 / float(data["frame_rate"][0])
        below[0].axvspan(-half, half, color="#eeeeee", zorder=-1)
        below[0].text(0, -0.43, "one frame", ha="center", va="bottom", fontsize=7.5, color=INK)
    return figure


def _crossing(time: Array, signal: Array, before: float) -> float:
    """Time of the steepest zero crossing before a time: where a delay is seen best."""
    steps = round(0.02 / (time[1] - time[0]))
    smooth = np.convolve(signal, np.ones(steps) / steps, "same")
    signs = np.flatnonzero((smooth[:-1] * smooth[1:] < 0) & (time[1:] < before))
    slope = np.abs(np.gradient(smooth))
    best = signs[np.argmax(slope[signs])]
    return float(time[best])


def tracks(data: xr.Dataset) -> Figure:
    """One marker in four cameras: on their clocks, on one clock with the fit, and what is left."""
    markers = rows_on(setups.beam())
    every = data["tracks"].sel(width=data["width"].max(), axis="v")
    v = every.isel(marker=tip_marker(markers)).transpose("camera", "frame").values
    own = np.arange(v.shape[1]) / data["frame_rate"].values[:, None]
    common = own + data["delay"].values[:, None]
    omega, (begin, end) = 2 * np.pi * float(data["frequency"]), data["steady"].values
    with in_style():
        figure, axes = subplots(
            3, 1, figsize=(WIDE, 6.4), layout="constrained", height_ratios=[1.1, 1.1, 0.8]
        )
        for i, name in enumerate(names_of(data)):
            rest = np.nanmean(v[i, own[i] < float(data["rest"]) - 1 / data["frame_rate"].values[i]])
            moved = v[i] - rest
            axes[0].plot(
                own[i], moved, ".-", color=color(i), markersize=3.5, linewidth=0.6, label=name
            )
            axes[1].plot(common[i], moved, ".", color=color(i), markersize=3.5)
            steady = (common[i] >= begin) & (common[i] <= end)
            fit = fit_harmonics(omega, common[i, steady], moved[steady], ORDER)
            fine = np.linspace(begin, end, 400)
            axes[1].plot(fine, fit.at(omega, fine), color=color(i), linewidth=0.8, zorder=1)
            left = moved[steady] - fit.at(omega, common[i, steady])
            axes[2].plot(common[i, steady], 1e3 * left, ".", color=color(i), markersize=3.5)
        axes[0].set(
            title="(a) the tip's marker on each camera's own clock",
            xlabel="s after its first frame",
            xlim=(begin - 0.75, begin + 0.5),
        )
        axes[0].legend(ncols=4, loc="upper left", markerscale=2, columnspacing=1, handlelength=1)
        axes[1].set(
            title="(b) on A's clock, with each camera's harmonic fit",
            xlim=(begin - 0.75, end + 0.05),
        )
        axes[2].set(
            title="(c) what the fit leaves",
            xlim=(begin - 0.75, end + 0.05),
            xlabel="s after A's first frame",
            ylabel="thousandths of a px",
        )
        for panel in axes[:2]:
            panel.set_ylabel("v minus v at rest, px")
            panel.margins(y=0.15)
        for panel in axes[1:]:
            panel.axvspan(begin, end, color="#eeeeee", zorder=-1)
        axes[1].text(
            begin + 0.02,
            0.98,
            "steady part",
            ha="left",
            va="top",
            color=INK,
            transform=axes[1].get_xaxis_transform(),
        )
    return figure
