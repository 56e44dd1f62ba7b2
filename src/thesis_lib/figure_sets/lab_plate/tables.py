"""Tables of the rendered plate."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr
from IPython.display import Markdown
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array
from thesis_lib.plotting.selection import select
from thesis_lib.studies import cubes
from thesis_lib.studies.cubes import percent_text
from thesis_lib.web.markdown import columns, table


def plate_results(cube: xr.Dataset) -> str:
    """First and last setting of each case in expectation, rendered and with whole pixels."""
    mode = int(cube["mode"].values[0])
    plane = str(cube["plane"].values[0])
    rows = []
    for case in dict.fromkeys(cube["case"].values.tolist()):
        part = select(cube, case, mode)
        labels = part["label"].values
        drawn = part["mean_error"].transpose("setting", "trial").values[:, 1:]
        heard = part["plane_error"].sel(plane=plane).transpose("setting", "trial").values[:, 1:]
        pairs = (
            np.median(drawn, axis=1),
            np.median(heard, axis=1),
            part["rounded_error"].values,
            part["rounded_plane_error"].sel(plane=plane).values,
        )
        cells = [f"{percent_text(v[0])} → {percent_text(v[-1])}" for v in pairs]
        rows.append([case, f"{labels[0]} → {labels[-1]}", *cells])
    header = [
        "varied",
        "from → to",
        "deflection, %",
        f"pressure {plane}, %",
        "whole pixels: deflection, %",
        f"pressure {plane}, %",
    ]
    filmed = cube["mean_error"].isel(trial=0) / cube["predicted_error"]
    fine = filmed.isel(setting=np.flatnonzero(cube["width_px"].values >= 640))
    return table(header, rows) + (
        f"\nMode {mode}: median over the {cubes.trials_are(cube)}, and what the law of rounding "
        "says of the same cameras with whole pixels. Over all modes, and settings with frames at "
        f"least 640 pixels wide, what was rendered has {float(fine.min()):.2f} to "
        f"{float(fine.max()):.2f} times the error that the noise of the centres predicts, "
        "and the errors of neighbouring markers are "
        f"correlated by {neighbour_correlation(cube)}.\n"
    )


def plate_table(cube: xr.Dataset, mode: int) -> Markdown:
    """Errors of deflection, pressure and power of one mode, setting by setting."""
    if mode not in cube["mode"]:
        return Markdown(f"Mode {mode} was not asked for.")
    part = cube.sel(mode=mode)
    names = {
        "mean_error": "deflection",
        "plane_error_xz": "pressure, XZ",
        "plane_error_yz": "pressure, YZ",
        "power_error": "power",
    }
    rows = [
        [str(part[name].values[s]) for name in ("case", "label")]
        for s in range(part.sizes["setting"])
    ]
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
        f"Each cell: as rendered (5–95 % of the {cubes.trials_are(cube)}), for the deflection · "
        "what the noise of the centres makes it; in % of the largest true deflection, of the "
        "plane's largest true pressure, of the true power."
    )
    if silent:
        note += f" Plane {' and '.join(silent)} is nodal: it has no pressure to compare with."
    if float(part["missing"].max()) > 0:
        gaps = [
            f"{row[0]}, {row[1]} ({share:.1%})"
            for row, share in zip(rows, part["missing"].values[:, 0], strict=True)
            if share > 0
        ]
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
        drawn = [
            np.sqrt(np.mean(v[:, 1:] ** 2, axis=1)) if v.shape[1] > 1 else v[:, 0] * np.nan
            for v in (shape, field)
        ]
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
    header = [
        "mode, plane",
        "independent",
        cubes.trials_are(cube),
        "follows",
        "one run",
        "follows",
        "whole pixels",
        "follows",
    ]
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
            {
                "mode": str(mode),
                "true, Hz": f"{float(part['frequency']):.1f}",
                "shows at, Hz": f"{float(part['alias_frequency']):.1f}",
                "exposure, %": f"{100 * float(part['exposure_loss']):.1f}",
                "markers, %": f"{100 * float(part['marker_loss']):.3f}",
                "least noise, µm": f"{1e6 * noise:.1f} ({part['label'].values[best]})",
                "1 N moves, nm": f"{1e9 * force:.0f}",
                "hours": f"{hours:.1f}",
            }
        )
    note = (
        f"Noise of a marker's deflection by {frames} frames of each camera at the best setting; it "
        "falls with the root of their number. Hours: to record until it is as small as what 1 N "
        "moves. Exposure, markers: the part of an amplitude that they take."
    )
    return Markdown(f"{columns(rows)}\n{note}")
