"""Data of the interactive viewer, from a cube, as plain JSON values."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from itertools import zip_longest
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.plotting.selection import Bars, error_bars, select_settings
from thesis_lib.plotting.style import CYCLE_COLORS, DIVERGING_COLORS
from thesis_lib.studies import cubes, schema
from thesis_lib.studies.fields import unit_of_field

LENS_FIELDS = ("focal_length_mm", "principal_offset_px", "sensor_width_mm")
"""Parameters behind images of ideal cameras with whole pixels, which rendered studies lack."""
DRAWN_DIGITS = 4  # significant digits of what is only drawn
FIELD_STEP = 2  # every other point of a plane is enough for an animation


def viewer_data(cube: xr.Dataset) -> dict[str, Any]:
    """Return the nominal run and the statistics of a cube (format: `web.viewer.Viewer`)."""
    said, structure = cube.attrs, schema.structure_kind(cube)
    kind = "beam" if structure == "beam" else "plate" if "mean_error" in cube else "sound"
    if "measured_deflection" in cube:  # of many trials only the nominal run is drawn
        literal = cube["measured_deflection"].isel(trial=0, drop=True)
        cube = cube.assign(measured_deflection=literal)
    if kind == "beam":
        cube = _middle_row(cube)
    length, width = schema.structure_extent(cube)
    cases = dict(zip(cube["case"].values.tolist(), cube["case_title"].values, strict=True))
    modes = cube["mode"].values.tolist()
    size: dict[str, Any] = {
        "length_mm": round(1000 * length, 3),
        "width_mm": round(1000 * width, 3),
    }
    if structure == "panel":
        cube = _in_cells(cube)
        size["contours_mm"] = [_round_digits(1000 * c) for c in schema.structure_contours(cube)]
    varied = said["varied"]
    data: dict[str, Any] = {
        "structure": {"kind": kind, **size},
        "parameter": {"name": varied, "label": said["varied_label"], "unit": unit_of_field(varied)},
        "modes": [
            {"mode": mode, "frequency_hz": round(float(cube["frequency"].sel(mode=mode)), 3)}
            for mode in modes
        ],
        "words": {"draws": said["draws"], "predicts": said["predicts"]},
        "colors": list(CYCLE_COLORS),
        "cases": [
            {
                "name": case,
                "title": str(title) or "own layout",
                "figures": _figures(cube, case),
                "settings": _settings(cube, case, modes, _planes if kind == "sound" else _shape),
            }
            for case, title in cases.items()
        ],
    }
    if kind == "sound":
        _add_fields(data, cube)
    else:
        _add_shapes(data, cube)
    asked = json.loads(said["parameters"])
    if kind != "sound" and asked.keys() >= set(LENS_FIELDS):
        data["lens"] = {name: asked[name] for name in LENS_FIELDS}
    if kind != "beam":
        data["colormap"] = list(DIVERGING_COLORS)
    return data


def _in_cells(cube: xr.Dataset) -> xr.Dataset:
    """Put a panel's markers into the cells of the box around it; NaN where there is none."""
    x, y, place = schema.marker_cells(cube)
    names = ("reference_deflection", "measured_deflection", "point_error")
    wide = {
        n: (cube[n].dims, schema.fill_cells(cube[n].values, place, x.size * y.size)) for n in names
    }
    columns, rows = np.tile(x, len(y)), np.repeat(y, len(x))
    rest = cube.drop_vars([*names, "x", "y"])
    return rest.assign(wide).assign_coords(x=("point", columns), y=("point", rows))


def _middle_row(cube: xr.Dataset) -> xr.Dataset:
    """Return the markers of a beam's middle row: the viewer draws one curve along it."""
    rows = np.unique(cube["y"].values)
    return cube.isel(point=np.flatnonzero(cube["y"].values == rows[len(rows) // 2]))


def _figures(cube: xr.Dataset, case: str) -> dict[str, str]:
    """Return the numbers of the thesis's figures of a case by mode; empty for other parameters."""
    row = cube["case"].values.tolist().index(case)
    numbers = cube["thesis_figure"].values[row] if cube.attrs["in_the_thesis"] else []
    modes = map(str, cube["mode"].values.tolist())
    return dict(zip_longest(modes, map(str, numbers), fillvalue=""))


def _settings(
    cube: xr.Dataset, case: str, modes: list[int], result: Callable[..., dict[str, Any]]
) -> list[dict[str, Any]]:
    parts = {mode: select_settings(cube, case, mode) for mode in modes}
    names = list(cubes.cube_errors(cube))
    bars = {mode: {name: error_bars(cube, case, mode, name) for name in names} for mode in modes}
    settings = []
    for index in range(parts[modes[0]].sizes["setting"]):
        one = parts[modes[0]].isel(setting=index)
        table = np.stack([one[f"camera_{a}"] for a in ("distance", "azimuth", "elevation")], 1)
        settings.append(
            {
                "label": str(one["label"].values),
                "value": float(one["value"]),
                "cameras": np.round(table[: int(one["n_cameras"])] * [1000, 1, 1], 6).tolist(),
                "resolution": [int(one["width_px"]), int(one["height_px"])],
                "in_view": float(one["in_view"]),
                "modes": [
                    result(parts[mode].isel(setting=index), bars[mode], index) for mode in modes
                ],
            }
        )
    return settings


def _bar(bars: Bars, index: int) -> dict[str, Any]:
    claim = bars.claims[index]
    low, median, high = bars.band[:, index]
    return {
        "mean": _round_digits(bars.literal[index]),
        "median": _round_digits(median),
        "low": _round_digits(low),
        "high": _round_digits(high),
        "predicted": _round_digits(bars.predicted[index]),
        "stated": list(claim.ends) if claim else None,
    }


def _shape(result: xr.Dataset, bars: dict[str, Bars], index: int) -> dict[str, Any]:
    return {
        "measured_mm": _round_digits(result["measured_deflection"] * 1000, DRAWN_DIGITS),
        "point_error": _round_digits(result["point_error"], DRAWN_DIGITS),
        **_bar(bars["mean_error"], index),
    }


def _planes(result: xr.Dataset, bars: dict[str, Bars], index: int) -> dict[str, Any]:
    planes = {
        error.name: None if np.isnan(error.literal[index]) else _bar(error, index)
        for error in bars.values()
    }
    return {
        "planes": planes,
        "deflection": {"mean": _round_digits(result["deflection_error"].isel(trial=0))},
    }


def _add_shapes(data: dict[str, Any], cube: xr.Dataset) -> None:
    for entry in data["modes"]:
        reference = cube["reference_deflection"].sel(mode=entry["mode"])
        entry["reference_mm"] = _round_digits(reference * 1000)
    x, y = (np.unique(np.round(cube[axis].values * 1000, 3)) for axis in ("x", "y"))
    data["x_mm"] = x.tolist()
    if data["structure"]["kind"] == "plate":
        data["y_mm"], data["grid"] = y.tolist(), [len(x), len(y)]


def _add_fields(data: dict[str, Any], cube: xr.Dataset) -> None:
    """Add reference fields, and the errors of the best and worst setting of each case and mode."""
    u, z = cube["u"].values[::FIELD_STEP] * 1000, cube["z"].values[::FIELD_STEP] * 1000
    names = cube["plane"].values.tolist()
    data["planes"] = [
        {"name": name, "u_mm": [u[0], u[-1]], "z_mm": [z[0], z[-1]], "shape": [len(u), len(z)]}
        for name in names
    ]
    data["pressure_unit"] = "Pa"
    data["nodal_note"] = "nodal plane: no reference pressure"
    ideals, measured = (
        [
            cube[f"pressure_{of}_{part}"].transpose(*dims, ...).values.astype(float)
            for part in ("real", "imag")
        ]
        for of, dims in (("reference", ["mode"]), ("measured", ["case", "mode", "extreme"]))
    )
    silent = np.isnan(cube["independent_ratio"].values)  # nodal planes
    for m, entry in enumerate(data["modes"]):
        ideal = _fields([part[m] for part in ideals], names)
        entry["fields"] = {
            n: ideal[n] for n, none in zip(names, silent[m], strict=True) if not none
        }
    both = list(zip(measured, ideals, strict=True))  # real and imaginary
    for c, case in enumerate(data["cases"]):
        rows = np.flatnonzero(cube["case"].values == case["name"])
        case["extremes"] = {}
        for m, entry in enumerate(data["modes"]):
            case["extremes"][str(entry["mode"])] = {
                extreme: {
                    "index": int(cube["best_and_worst"].values[c, m, x] - rows[0]),
                    "fields": _fields([got[c, m, x] - true[m] for got, true in both], names),
                }
                for x, extreme in enumerate(("best", "worst"))
            }


def _fields(parts: list[Array], names: list[str]) -> dict[str, Any]:
    """Encode complex fields (plane, u, z), real and imaginary part, for pages."""
    real, imaginary = (part[:, ::FIELD_STEP, ::FIELD_STEP] for part in parts)
    return {name: encode_field(real[p] + 1j * imaginary[p]) for p, name in enumerate(names)}


def encode_field(field: ComplexArray) -> dict[str, Any]:
    """Encode a complex field as signed bytes, on a scale of its own."""
    parts = field.real, field.imag
    scale = max(float(np.abs(part).max()) for part in parts) or 1.0
    coded = [np.clip(np.rint(part / scale * 127), -127, 127).astype(np.int8) for part in parts]
    real, imaginary = (base64.b64encode(part.tobytes()).decode() for part in coded)
    return {"scale": float(f"{scale:.6g}"), "re": real, "im": imaginary}


def _round_digits(values: Any, digits: int = 6) -> Any:
    """Round numbers to some significant digits for JSON; non-finite ones become None."""
    array = np.asarray(values, float)
    if array.ndim == 0:
        return float(f"{float(array):.{digits}g}") if np.isfinite(array) else None
    return [_round_digits(value, digits) for value in array]
