"""Tables of ``lab-modes`` and ``lab-plate``, from their cubes."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.measure.fitting.aliasing import detuning_loss
from thesis_lib.plotting.selection import select
from thesis_lib.studies.cubes import percent_text, trials_are
from thesis_lib.web.markdown import columns, table


def frequency_table(cube: xr.Dataset) -> Markdown:
    """What the frames show of each frequency, and which of its aliases the cameras agree on."""
    rows = []
    for m, mode in enumerate(cube["mode"].values):
        part = cube.isel(mode=m)
        for r, rate in enumerate(cube["frame_rate"].values):
            misfits = np.sort(part["misfit"].values[r])
            rows.append(
                {
                    "mode": str(mode),
                    "fps": f"{rate:g}",
                    "true, Hz": f"{float(part['frequency']):.2f}",
                    "shows at, Hz": f"{part['alias_frequency'].values[r]:.2f}",
                    "read, Hz": f"{part['read_frequency'].values[r]:.2f}",
                    "agree at, Hz": f"{part['found_frequency'].values[r]:.2f}",
                    "there": f"{misfits[0]:.2f}",
                    "next best": "—"
                    if len(misfits) < 2 or np.isnan(misfits[1])
                    else f"{misfits[1]:.1f}",
                }
            )
    note = (
        "Agree at: the frequency at which the cameras do. The last columns are their disagreement "
        "there and at the next best frequency: what one motion in space leaves of the amplitudes "
        "in the pictures, over what the noise of the centres makes it, which is 1. A dash: no "
        "other frequency up to the highest that is tried shows at the same place."
    )
    return Markdown(f"{columns(rows)}\n{note}")


def parts_table(cube: xr.Dataset) -> Markdown:
    """Bending and torsion by the three rows, with standard errors, mode by mode."""
    header = ["case", "setting", "bending, µm", "torsion, µm", "phase, °", "MAC"]
    texts = []
    for mode in cube["mode"].values:
        part = cube.sel(mode=mode)
        rows = []
        for s in range(part.sizes["setting"]):
            one = part.isel(setting=s)
            row = [str(one["case"].values), str(one["label"].values)]
            for kind, digits in (("bending", 1), ("torsion", 2)):
                value = 1e6 * float(one[f"{kind}_amplitude"][0])
                error = 1e6 * float(one[f"{kind}_standard_error"])
                row.append(f"{value:.{digits}f} ± {error:.2f}")
            phase = float(one["torsion_phase"][0])
            row.append("—" if np.isnan(phase) else f"{phase:.0f}".replace("-", "−"))
            row.append(f"{float(one['mac'][0]):.4f}")
            rows.append(row)
        title = (
            f"Mode {mode}; true: bending {1e6 * float(part['bending_reference']):.1f} µm, torsion "
            f"{1e6 * float(cube['torsion_reference']):.2f} µm"
        )
        texts.append(f"**{title}**\n\n{table(header, rows)}")
    texts.append(
        "As rendered, at the tip and at the tip's edges, ± one standard error by the noise of the "
        "centres. Phase: torsion ahead of bending. MAC: modal assurance criterion of the shape at "
        "the maximum of bending."
    )
    return Markdown("\n\n".join(texts))


def conditions_table(cube: xr.Dataset) -> Markdown:
    """What a fit at a known frequency asks for, mode by mode."""
    frames = json.loads(cube.attrs["parameters"])["frames"]
    slowest = float(cube["frame_rate"].min())
    cycles = np.linspace(0, 1, 2001)
    rows = []
    for m, mode in enumerate(cube["mode"].values):
        part = cube.isel(mode=m)
        shape = part["reference_deflection"].values
        rms = 100 * np.sqrt(np.mean(shape**2)) / np.abs(shape).max()
        allowed = float(np.interp(1, rms * detuning_loss(cycles, frames), cycles))
        rows.append(
            {
                "mode": str(mode),
                "Hz": f"{float(part['frequency']):.2f}",
                "tip, µm": f"{1e6 * float(part['bending_reference']):.0f}",
                "over noise": f"{float(part['signal_over_noise'][-1]):.0f}",
                "exposure, %": f"{100 * float(part['exposure_loss']):.1f}",
                "δf for 1 %, Hz": f"{allowed * slowest / frames:.3f}",
                "settled, s": f"{float(part['settling_time']):.2f}",
                "twist by 1 N, µm": f"{1e6 * float(part['torsion_of_force']):.1f}",
            }
        )
    note = (
        "Over noise: tip over the noise of deflections by one frame of each camera. δf: error of "
        f"the frequency at which {frames} frames at {slowest:g} a second lose 1 % of the largest "
        "deflection, rms. Exposure: what it takes. Settled: when a transient has fallen to a "
        "hundredth. Twist: of the tip's edges, by a force 10 mm beside the axis."
    )
    return Markdown(f"{columns(rows)}\n{note}")


def modes_results(cube: xr.Dataset) -> str:
    """Median errors of the four ways, by mode and frame rate."""
    cases = list(dict.fromkeys(cube["case"].values.tolist()))
    rows = []
    for m, mode in enumerate(cube["mode"].values):
        for r, rate in enumerate(cube["frame_rate"].values):
            row = [str(mode), f"{rate:g}", f"{cube['alias_frequency'].values[m, r]:.1f}"]
            for case in cases:
                part = select(cube, case, int(mode))
                drawn = part["mean_error"].transpose("setting", "trial").values[r, 1:]
                row.append(percent_text(float(np.median(drawn))))
            rows.append(row)
    header = ["mode", "frames per second", "shows at, Hz", *(f"*{case}*, %" for case in cases)]
    known = select(cube, "known", int(cube["mode"].values[-1]))
    torsion, error = (
        [1e6 * float(known[name].values[i]) for i in (0, -1)]
        for name in ("torsion_standard_error", "bending_standard_error")
    )
    return table(header, rows) + (
        f"\nMedian over the {trials_are(cube)} of the rms error, in % of the largest deflection. "
        f"In mode {cube['mode'].values[-1]} the standard errors of bending and torsion are "
        f"{error[0]:.2f} and {torsion[0]:.2f} µm with {known['label'].values[0]}, {error[1]:.2f} "
        f"and {torsion[1]:.2f} µm with {known['label'].values[-1]}, for as many frames.\n"
    )
