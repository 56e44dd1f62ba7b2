"""Figures of ``lab-radiation``: what was seen, how the sound errs, the field, and the markers."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.plotting.maps import draw_map
from thesis_lib.plotting.style import (
    COLORS,
    HIGHLIGHT,
    INK,
    REFERENCE,
    color,
    logarithmic,
    subplots,
)

SHOWN = "between"  # whose field is drawn, or the first


def structures(cube: xr.Dataset) -> Figure:
    """First frames of the first camera, one for each structure."""
    drawing, panels = _panels(cube, (6.4, 4.6))
    for axes, case in zip(panels, cube["structure"].values, strict=False):
        own = cube.sel(structure=case)
        picture = own["picture"].values
        rows, columns = np.flatnonzero(picture.any(axis=1)), np.flatnonzero(picture.any(axis=0))
        axes.imshow(picture[: rows[-1] + 1, : columns[-1] + 1], cmap="gray", vmin=0, vmax=255)
        axes.set_title(f"{own['name'].item()}: {float(own['tone']):.1f} Hz")
        axes.set(xticks=[], yticks=[])
        axes.grid(visible=False)
    return drawing


def powers(cube: xr.Dataset) -> Figure:
    """Error of the power of every recording, with two stated standard errors, by size."""
    drawing, panels = _panels(cube, (6.4, 4.8), sharex=True)
    for i, (axes, case) in enumerate(zip(panels, cube["structure"].values, strict=False)):
        own = cube.sel(structure=case)
        true = float(own["true_power"])
        off = 100 * (own["power"].values / true - 1)
        stated = 200 * own["power_error"].values / true
        order = np.argsort(off)
        off, stated, at = off[order], stated[order], np.arange(1, len(off) + 1)
        missed = np.abs(off) > stated
        axes.axhline(0, color=INK, linewidth=0.8)
        for of, ink in ((~missed, color(i)), (missed, HIGHLIGHT)):
            axes.errorbar(at[of], off[of], stated[of], fmt="o", color=ink, ms=3, lw=1)
        axes.set_title(str(own["name"].item()))
        axes.set_ylabel("error of the power, %")
    for axes in panels[-2:]:
        axes.set_xlabel("recordings, by their error")
    return drawing


def field(cube: xr.Dataset) -> Figure:
    """The pressure that one recording tells, and what it is off by."""
    cases = cube["structure"].values.tolist()
    own = cube.sel(structure=SHOWN if SHOWN in cases else cases[0])
    both = own["field_real"].values + 1j * own["field_imag"].values
    true, measured = both
    turn = np.exp(-1j * np.angle(true.ravel()[np.argmax(np.abs(true))]))
    largest = float(np.abs(true).max())
    drawing, panels = subplots(1, 2, figsize=(6.4, 2.4), layout="constrained")
    across, up = 1000 * cube["u"].values, 1000 * cube["z"].values
    off = 100 * np.real((measured - true) * turn) / largest
    most = float(np.abs(off).max())
    shown = (
        (np.real(measured * turn), largest, f"(a) as measured, to ±{largest:.3g} Pa"),
        (off, most, f"(b) its error, to ±{most:.2g} % of that"),
    )
    for axes, (values, limit, title) in zip(panels, shown, strict=True):
        draw_map(axes, values.T, across, up, limit)
        axes.set(title=title, xlabel="X, mm", ylabel="Z, mm")
    return drawing


def markers(cube: xr.Dataset) -> Figure:
    """What too few markers do to the power between two modes, beside the stated error."""
    drawing, axes = subplots(figsize=(4.8, 3.2), layout="constrained")
    spacing = 1000 * cube["grid_spacing"].values
    axes.plot(
        spacing,
        np.abs(cube["grid_interpolation"].values),
        "o-",
        color=COLORS[0],
        label="error of the power without noise, %",
    )
    axes.plot(
        spacing,
        cube["grid_left"].values,
        "s--",
        color=COLORS[4],
        label="what fitted modes leave of the motion, %",
    )
    if SHOWN in cube["structure"].values:
        own = cube.sel(structure=SHOWN)
        stated = 100 * float((own["power_error"] / own["true_power"]).mean())
        axes.axhline(stated, color=REFERENCE, linewidth=1)
        words = "stated standard error"  # below its line: the curves are above it there
        axes.text(spacing.max(), stated / 1.2, words, ha="right", va="top", color=INK)
    logarithmic(axes.xaxis, [50, 60, 70, 80, 100, 130])
    logarithmic(axes.yaxis, [0.01, 0.03, 0.1, 0.3, 1, 3])
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** 0.3)  # room for the key
    axes.set(xlabel="distance to the next marker, mm")
    axes.legend(loc="upper left")
    return drawing


def tap(cube: xr.Dataset) -> Figure:
    """What is heard of a tap, and what its modes' powers are off by."""
    drawing, (heard, off) = subplots(
        1, 2, figsize=(6.4, 2.8), layout="constrained", width_ratios=[1.6, 1]
    )
    time, each = cube["tap_time"].values, cube["tap_heard"].values
    rates = (cube["tap_power"] / cube["tap_energy"]).values / 2  # E = W / 2α
    names = [f"{f:.3g} Hz" for f in cube["tap_frequency"].values]
    heard.plot(1000 * time, each.sum(axis=0), color=REFERENCE, linewidth=0.6, label="all")
    for k in np.argsort(rates):
        size = np.abs(each[k]).max() * np.exp(-rates[k] * time)
        heard.plot(1000 * time, size, color=color(k), label=names[k])
    heard.set(title="(a) heard 1 m above", xlabel="time, ms", ylabel="pressure, Pa")
    heard.legend(loc="upper right", ncols=2)
    true = cube["tap_true_power"].values
    wrong = 100 * (cube["tap_power"].values / true - 1)
    stated = 200 * cube["tap_power_error"].values / true
    off.axhline(0, color=INK, linewidth=0.8)
    for k in range(len(each)):
        off.errorbar([k], wrong[k], stated[k], fmt="o", color=color(k), ms=4, lw=1)
    off.set(title="(b) error of the power, %", xticks=range(len(each)), xticklabels=names)
    off.set_xlim(-0.5, len(each) - 0.5)
    return drawing


def _panels(cube: xr.Dataset, size: tuple[float, float], **how: bool) -> tuple[Figure, list[Axes]]:
    """Panels for the structures, two in a row."""
    rows = -(-cube.sizes["structure"] // 2)
    height = size[1] * rows / 2
    drawing, panels = subplots(
        rows, 2, figsize=(size[0], height), layout="constrained", squeeze=False, **how
    )
    flat = panels.ravel().tolist()
    for spare in flat[cube.sizes["structure"] :]:
        spare.set_visible(False)
    return drawing, flat
