"""Figures of the rendered plate, and further values for its tables."""

import json
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.arrays import Array
from thesis_lib.plotting import panels as figures, selection, style
from thesis_lib.studies import cubes

CASE_TITLES = {
    "distance": "distance d",
    "aperture": "aperture α",
    "elevation": "elevation φ",
    "resolution": "resolution",
    "cameras": "number of cameras",
}
ERROR_NAMES = {
    "mean_error": "deflection",
    "plane_error_xz": "pressure, XZ",
    "plane_error_yz": "pressure, YZ",
    "power_error": "power",
}


def plate_sound_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw setup, errors of deflection and sound, and maps of both and of their errors."""
    part = selection.select_settings(cube, case, mode)
    grid = {
        "left": 0.07,
        "right": 0.9,
        "bottom": 0.125,
        "top": 0.96,
        "wspace": 0.68,
        "hspace": 0.58,
    }
    how: Any = {"gridspec_kw": grid, "height_ratios": (1.3, 1, 1.1)}
    drawing, axes = style.make_mosaic("abc;def;ghi", (8.2, 6.6), None, **how)
    figures.setup_panel(axes["a"], cube, part)
    axes["a"].set_title(f"(a) {CASE_TITLES.get(case, case)} varied")
    figures.bar_panel(axes["b"], part, [selection.error_bars(cube, case, mode)])
    axes["b"].set(title="(b) deflection", ylabel="error in % of the largest")
    bars = [selection.error_bars(cube, case, mode, f"plane_error_{p}") for p in ("xz", "yz")]
    figures.bar_panel(axes["c"], part, bars)
    silent = [one.name for one in bars if np.isnan(one.literal).all()]
    planes = {"": "XZ, YZ (light)", "XZ": "YZ", "YZ": "XZ"}.get("".join(silent), "nodal planes")
    axes["c"].set_title(f"(c) pressure: {planes}")
    handles = axes["b"].get_legend_handles_labels()
    for name in "bc":
        if legend := axes[name].get_legend():
            legend.remove()
        axes[name].set_ylim(top=axes[name].get_ylim()[1] / 1.25)  # the legend stands outside
    drawing.legend(*handles, loc="lower center", ncols=4)
    x, y = (np.unique(np.round(part[axis].values, 9)) * 1000 for axis in ("x", "y"))
    true = part["reference_deflection"].values.reshape(len(y), len(x))
    ends = [one["measured_deflection"].values[0] for one, *_ in selection.rank_settings(part)]
    errors = [(measured.reshape(true.shape) - true) * 1e6 for measured in ends]
    shape = "(d) true deflection", true * 1000, 1000 * float(np.abs(true).max())
    shapes = shape, *_name_errors(part, errors)
    plane = part["plane"].values[np.argmax(np.nan_to_num(part["largest_pressure"].values))]
    louder = part.sel(plane=plane)
    scale, names = float(louder["largest_pressure"]), part["case_name"].values.tolist()
    true = louder["pressure_reference_real"].values.T
    filmed = louder["pressure_measured_real"].isel(case=names.index(case))
    errors = [100 * (filmed.sel(extreme=end).values.T - true) / scale for end in ("best", "worst")]
    title = f"(e) true pressure, {plane},\nin % of the largest"
    fields = (title, 100 * true / scale, 100.0), *_name_errors(part, errors)
    u, z = part["u"].values * 1000, part["z"].values * 1000
    for row, maps, places, across, labels in (
        ("def", shapes, (x, y), "xy", ("w in mm", "error in µm")),
        ("ghi", fields, (u, z), f"{plane[0]}Z", ("Re p in %", "error in %")),
    ):
        panels = [axes[name] for name in row]
        pictures = style.draw_maps(panels, maps, *places, across, fontsize=8)
        style.add_colorbar(panels[0], pictures[0], labels[0])
        style.add_colorbar(panels[2], pictures[2], labels[1])
    return drawing


def _name_errors(part: xr.Dataset, errors: list[Any]) -> Any:
    """Yield title, values and common limit of the errors of the best and the worst setting."""
    limit = max(float(np.nanmax(np.abs(error))) for error in errors)
    for (one, word, _), error in zip(selection.rank_settings(part), errors, strict=True):
        yield f"error, {word}:\n{one['label'].item()}", error, limit


# Further values for tables.


def compare_errors(cube: xr.Dataset, mode: int, plane: str) -> dict[str, Array]:
    """Return rms errors of deflection and pressure of the distinct settings, shape (2, settings).

    Keys are *trials*, *rendered* (trial 0), and *whole pixels* (by the law of rounding).
    """
    part = cube.sel(mode=mode, plane=plane)
    _, distinct = np.unique(part["predicted_error"].values, return_index=True)
    part = part.isel(setting=np.sort(distinct))
    errors = part[["mean_error", "plane_error"]].to_dataarray().transpose(..., "setting", "trial")
    rendered = errors.isel(trial=0)
    drawn = selection.trial_rms(errors) if errors.sizes["trial"] > 1 else rendered * np.nan
    rounded = part[["rounded_error", "rounded_plane_error"]].to_dataarray()
    kinds = {"trials": drawn, "rendered": rendered, "whole pixels": rounded}
    return {kind: values.values for kind, values in kinds.items()}


def format_correlation(cube: xr.Dataset) -> str:
    """Return the mean correlation over the distinct recordings, and its standard error."""
    found = np.unique(cube["neighbour_correlation"].values)
    error = found.std(ddof=1) / np.sqrt(found.size) if found.size > 1 else np.nan
    return f"{found.mean():+.3f} ± {error:.3f}".replace("-", "−").replace(" ± nan", "")


def _results(cube: xr.Dataset) -> dict[str, Any]:
    """Compare settings of each case in expectation, rendered and with whole pixels."""
    plane, cases = str(cube["plane"].values[0]), []
    for case, every in selection.split_cases(cube).items():
        part = every.sel(plane=plane)
        medians = part[["mean_error", "plane_error"]].isel(trial=slice(1, None)).median("trial")
        rounded = part["rounded_error"].values, part["rounded_plane_error"].values
        errors = *(values.values for values in medians.values()), *rounded
        cases.append((case, part["label"].values, *errors))
    ratio = cube["mean_error"].isel(trial=0) / cube["predicted_error"]
    return {
        "plane": plane,
        "cases": cases,
        "ratio": ratio.isel(setting=np.flatnonzero(cube["width_px"].values >= 640)),
        "correlation": format_correlation(cube),
    }


def _plate(cube: xr.Dataset, mode: int) -> dict[str, Any]:
    """Return errors of deflection, pressure and power of one mode, with the bands of trials."""
    if mode not in cube["mode"]:
        return {"part": None, "mode": mode}
    part, columns = cube.sel(mode=mode), {}
    for name, word in ERROR_NAMES.items():
        values = cubes.cube_errors(part)[name].transpose("setting", "trial").values
        drawn = values if values.shape[1] == 1 else values[:, 1:]
        if not np.isnan(values[:, 0]).all():
            columns[word] = np.stack([values[:, 0], *np.quantile(drawn, [0.05, 0.95], axis=1)], 1)
    return {
        "part": part,
        "columns": columns,
        "predicted": cubes.predicted_value(part, "mean_error").values,
        "nodal": part["plane"].values[np.isnan(part["largest_pressure"].values)].tolist(),
        "gaps": [one for one in cubes.iterate_slices(part, "setting") if one["missing"][0] > 0],
    }


def _ratios(cube: xr.Dataset) -> dict[str, Any]:
    """Divide pressure errors by deflection errors, and correlate their logarithms."""
    rows = []
    for mode in cube["mode"].values.tolist():
        for plane in cube["plane"].values.tolist():
            free, kinds = float(cube["independent_ratio"].sel(mode=mode, plane=plane)), []
            if np.isnan(free):
                continue
            for shape, field in compare_errors(cube, mode, plane).values():
                many = len(shape) > 2
                follows = np.corrcoef(np.log(shape), np.log(field))[0, 1] if many else np.nan
                kinds.append((field / shape, follows))
            rows.append((mode, plane, free, kinds))
    return {"rows": rows, "correlation": format_correlation(cube)}


def _visibility(cube: xr.Dataset) -> dict[str, Any]:
    """Return for each mode the least noise, and the recording time at which 1 N equals it."""
    request = json.loads(cube.attrs["parameters"])
    rate, frames = request["frame_rate_hz"], request["frames"]
    modes = []
    for one in cubes.iterate_slices(cube, "mode"):
        best = int(np.argmin(one["predicted_error"].values))
        peak = float(np.abs(one["reference_deflection"]).max())
        noise = float(one["predicted_error"][best]) / 100 * peak
        hours = frames * (noise / float(one["force_deflection"])) ** 2 / rate / 3600
        modes.append((one, noise, one["label"].values[best], hours))
    return {"modes": modes, "frames": frames}


TEXTS = {"results": _results, "plate": _plate, "ratios": _ratios, "visibility": _visibility}
