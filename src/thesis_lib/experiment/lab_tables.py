"""Tables of ``lab-modes`` and ``lab-plate``, from their cubes."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr
from IPython.display import SVG, Markdown
from numpy.typing import ArrayLike, NDArray

from thesis_lib import cubes
from thesis_lib.experiment.aliasing import detuning_loss
from thesis_lib.experiment.lab_figures import aliases_figure
from thesis_lib.markdown import table
from thesis_lib.style import POWERS, svg

Array = NDArray[np.float64]


def aliases(cube: xr.Dataset, mode: int) -> SVG | None:
    """The figure of a mode's aliases, or nothing if the mode was not run."""
    return SVG(svg(aliases_figure(cube, mode), POWERS)) if mode in cube["mode"] else None


def frequency_table(cube: xr.Dataset) -> Markdown:
    """What the frames show of each frequency, and which of its aliases the cameras agree on."""
    rows = []
    for m, mode in enumerate(cube["mode"].values):
        part = cube.isel(mode=m)
        for r, rate in enumerate(cube["frame_rate"].values):
            misfits = np.sort(part["misfit"].values[r])
            rows.append(
                [
                    str(mode), f"{rate:g}", f"{float(part['frequency']):.2f}",
                    f"{part['alias_frequency'].values[r]:.2f}",
                    f"{part['read_frequency'].values[r]:.2f}",
                    f"{part['found_frequency'].values[r]:.2f}", f"{misfits[0]:.2f}",
                    "—" if len(misfits) < 2 or np.isnan(misfits[1]) else f"{misfits[1]:.1f}",
                ]
            )  # fmt: skip
    header = ["mode", "fps", "true, Hz", "shows at, Hz", "read, Hz", "agree at, Hz",
              "there", "next best"]  # fmt: skip
    note = (
        "Agree at: the frequency at which the cameras do. The last columns are their disagreement "
        "there and at the next best frequency: what one motion in space leaves of the amplitudes "
        "in the pictures, over what the noise of the centres makes it, which is 1. A dash: no "
        "other frequency up to the highest that is tried shows at the same place."
    )
    return Markdown(f"{table(header, rows)}\n{note}")


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
        "As filmed, at the tip and at the tip's edges, ± one standard error by the noise of the "
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
            [
                str(mode), f"{float(part['frequency']):.2f}",
                f"{1e6 * float(part['bending_reference']):.0f}",
                f"{float(part['signal_over_noise'][-1]):.0f}",
                f"{100 * float(part['exposure_loss']):.1f}",
                f"{allowed * slowest / frames:.3f}", f"{float(part['settling_time']):.2f}",
                f"{1e6 * float(part['torsion_of_force']):.1f}",
            ]
        )  # fmt: skip
    header = ["mode", "Hz", "tip, µm", "over noise", "exposure, %", "δf for 1 %, Hz",
              "settled, s", "twist by 1 N, µm"]  # fmt: skip
    note = (
        "Over noise: tip over the noise of deflections by one frame of each camera. δf: error of "
        f"the frequency at which {frames} frames at {slowest:g} a second lose 1 % of the largest "
        "deflection, rms. Exposure: what it takes. Settled: when a transient has fallen to a "
        "hundredth. Twist: of the tip's edges, by a force 10 mm beside the axis."
    )
    return Markdown(f"{table(header, rows)}\n{note}")


# The plate.


def plate_table(cube: xr.Dataset, mode: int) -> Markdown:
    """Errors of deflection, pressure and power of one mode, setting by setting."""
    if mode not in cube["mode"]:
        return Markdown(f"Mode {mode} was not asked for.")
    part = cube.sel(mode=mode)
    names = {"mean_error": "deflection", "plane_error_xz": "pressure, XZ",
             "plane_error_yz": "pressure, YZ", "power_error": "power"}  # fmt: skip
    rows = [[str(part[name].values[s]) for name in ("case", "label")]
            for s in range(part.sizes["setting"])]  # fmt: skip
    header = ["case", "setting"]
    for name, word in names.items():
        values = cubes.errors(part)[name].transpose("setting", "trial").values
        if np.isnan(values[:, 0]).all():
            continue
        header.append(word)
        for row, own, law in zip(rows, values, cubes.predicted(part, name).values, strict=True):
            expected = f" · {cubes.percent_text(float(law))}" if name == "mean_error" else ""
            row.append(f"{_signed(own[0], name)} {_band(own[1:], name)}{expected}")
    silent = [p for p in part["plane"].values if np.isnan(part["largest_pressure"].sel(plane=p))]
    note = (
        "Each cell: as filmed (5–95 % of the trials), for the deflection · what the noise of the "
        "centres makes it; in % of the largest true deflection, of the plane's largest true "
        "pressure, of the true power."
    )
    if silent:
        note += f" Plane {' and '.join(silent)} is nodal: it has no pressure to compare with."
    if float(part["missing"].max()) > 0:
        gaps = [f"{row[0]}, {row[1]} ({share:.1%})"
                for row, share in zip(rows, part["missing"].values[:, 0], strict=True)
                if share > 0]  # fmt: skip
        note += (
            " Markers that too few cameras see are left out of the deflection, and for the sound "
            f"put on a smooth surface through the others, in: {'; '.join(gaps)}."
        )
    if float(part["piston_size"]) > 1:
        note += (
            " The pistons are large against the wavelength (wavenumber times size "
            f"{float(part['piston_size']):.2f}): above 1 take a finer grid."
        )
    return Markdown(f"{table(header, rows)}\n{note}")


def _signed(value: float, name: str) -> str:
    text = cubes.percent_text(value)
    return f"+{text}" if name == "power_error" and value > 0 else text.replace("-", "−")


def _band(drawn: ArrayLike, name: str) -> str:
    values = np.asarray(drawn, float)
    if not values.size:
        return ""
    low, high = (_signed(value, name) for value in np.quantile(values, [0.05, 0.95]))
    return f"({low} to {high})" if name == "power_error" else f"({low}–{high})"


def ratios(cube: xr.Dataset, mode: int, plane: str) -> dict[str, Array]:
    """Deflection and pressure errors of the distinct settings of a mode, rms, shape (2, settings).

    As *filmed*, over *trials*, and with *whole pixels*.
    """
    part = cube.sel(mode=mode, plane=plane)
    _, distinct = np.unique(part["predicted_error"].values, return_index=True)
    part = part.isel(setting=np.sort(distinct))
    shape = part["mean_error"].transpose("setting", "trial").values
    field = part["plane_error"].transpose("setting", "trial").values
    rounded = part["rounded_error"].values, part["rounded_plane_error"].values
    with np.errstate(invalid="ignore"):
        drawn = [np.sqrt(np.mean(v[:, 1:] ** 2, axis=1)) if v.shape[1] > 1 else v[:, 0] * np.nan
                 for v in (shape, field)]  # fmt: skip
    return {
        "trials": np.array(drawn),
        "filmed": np.array([shape[:, 0], field[:, 0]]),
        "whole pixels": np.array(rounded),
    }


def ratio_table(cube: xr.Dataset) -> Markdown:
    """Pressure error over deflection error, and whether the one follows the other."""
    rows = []
    for mode in cube["mode"].values:
        for plane in cube["plane"].values:
            free = float(cube["independent_ratio"].sel(mode=mode, plane=plane))
            if np.isnan(free):
                continue
            row = [f"{mode}, {plane}", f"{free:.3f}"]
            for shape, field in ratios(cube, int(mode), str(plane)).values():
                ratio = field / shape
                follows = (
                    np.corrcoef(np.log(shape), np.log(field))[0, 1] if len(shape) > 2 else np.nan
                )
                row += [f"{ratio.min():.3f}–{ratio.max():.3f}", f"{follows:.2f}"]
            rows.append([text.replace("nan–nan", "—").replace("nan", "—") for text in row])
    header = ["mode, plane", "independent", "trials", "follows", "one run", "follows",
              "whole pixels", "follows"]  # fmt: skip
    note = (
        "Rms pressure error over rms deflection error, least and largest of all settings; "
        "independent: for errors of equal size, marker by marker. Follows: "
        "correlation of the logarithms of the two errors over the settings. Neighbouring markers' "
        f"errors in the recordings: mean correlation {neighbour_correlation(cube)}."
    )
    return Markdown(f"{table(header, rows)}\n{note}")


def neighbour_correlation(cube: xr.Dataset) -> str:
    """Mean over the distinct recordings, and its standard error."""
    found = np.unique(cube["neighbour_correlation"].values)
    error = found.std(ddof=1) / np.sqrt(found.size) if found.size > 1 else np.nan
    return f"{found.mean():+.3f} ± {error:.3f}".replace("-", "−").replace(" ± nan", "")


def visibility_table(cube: xr.Dataset) -> Markdown:
    """How much a plate has to move, and what takes a part of it, mode by mode."""
    request = json.loads(cube.attrs["parameters"])
    rate, frames = request["frame_rate_hz"], request["frames"]
    rows = []
    for m, mode in enumerate(cube["mode"].values):
        part = cube.isel(mode=m)
        peak = float(np.abs(part["reference_deflection"]).max())
        best = int(np.argmin(part["predicted_error"].values))
        noise = float(part["predicted_error"][best]) / 100 * peak
        force = float(part["force_deflection"])
        hours = frames * (noise / force) ** 2 / rate / 3600
        rows.append(
            [
                str(mode), f"{float(part['frequency']):.1f}",
                f"{float(part['alias_frequency']):.1f}",
                f"{100 * float(part['exposure_loss']):.1f}",
                f"{100 * float(part['marker_loss']):.3f}",
                f"{1e6 * noise:.1f} ({part['label'].values[best]})",
                f"{1e9 * force:.0f}", f"{hours:.1f}",
            ]
        )  # fmt: skip
    header = ["mode", "true, Hz", "shows at, Hz", "exposure, %", "markers, %",
              "least noise, µm", "1 N moves, nm", "hours"]  # fmt: skip
    note = (
        f"Noise of a marker's deflection by {frames} frames of each camera at the best setting; it "
        "falls with the root of their number. Hours: to film until it is as small as what 1 N "
        "moves. Exposure, markers: the part of an amplitude that they take."
    )
    return Markdown(f"{table(header, rows)}\n{note}")
