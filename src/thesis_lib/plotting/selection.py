"""Selection of the shown part of a cube: as arrays, as tables of numbers, and for the viewer.

Tables are tidy, one number per row. The interactive viewer uses plain JSON values.
"""

import base64
import json
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts.claims import Claim, claims_of
from thesis_lib.plotting.style import BEST_COLOR, CYCLE_COLORS, DIVERGING_COLORS, WORST_COLOR
from thesis_lib.studies import cubes, fields, schema


def select_settings(cube: xr.Dataset, case: str, mode: int) -> xr.Dataset:
    """Return the settings of one case and one mode."""
    rows = np.flatnonzero(cube["case"].values == case)
    return cube.isel(setting=rows).sel(mode=mode)


def list_cases(cube: xr.Dataset) -> list[str]:
    """Return the cases of a cube in their order, each once."""
    return list(dict.fromkeys(cube["case"].values.tolist()))


def trial_rms(errors: xr.DataArray) -> xr.DataArray:
    """Return the root mean square over the random trials, which the law of rounding predicts."""
    squared = errors.isel(trial=slice(1, None)) ** 2
    return squared.mean("trial", skipna=False) ** 0.5


def split_cases(cube: xr.Dataset, mode: int | None = None) -> dict[str, xr.Dataset]:
    """Return the settings of every case in order, for one mode, by default the first."""
    one = int(cube["mode"].values[0]) if mode is None else mode
    return {case: select_settings(cube, case, one) for case in list_cases(cube)}


def best_and_worst(part: xr.Dataset) -> list[int]:
    """Return the indices of the settings with the least and the largest typical mean error.

    Settings without a result are excluded, unless no setting has one.
    """
    name = "mean_error" if "mean_error" in part else "deflection_error"
    error = cubes.typical_error(part[name])
    order = np.argsort(error, kind="stable")[: np.isfinite(error).sum() or None]
    return [int(order[0])] if len(order) == 1 else [int(order[0]), int(order[-1])]


def rank_settings(part: xr.Dataset) -> list[tuple[xr.Dataset, str, str]]:
    """Return the first and the last of :func:`best_and_worst`, each with its rank and colour."""
    by, ends = " by median" if part.sizes["trial"] > 1 else "", best_and_worst(part)
    return [
        (part.isel(setting=ends[0]), f"best{by}", BEST_COLOR),
        (part.isel(setting=ends[-1]), f"worst{by}", WORST_COLOR),
    ]


def claimed_errors(
    cube: xr.Dataset, case: str, mode: int, quantity: str = "mean_error"
) -> list[Claim | None]:
    """Return the claims of the thesis on an error of each setting of a case, or None.

    A claim about all settings counts for each of them.
    """
    values = cube["value"].values[cube["case"].values == case].tolist()
    return _find_claims(cube, [(case, mode, quantity, value) for value in values])


def _find_claims(cube: xr.Dataset, rows: Iterable[tuple[Any, ...]]) -> list[Claim | None]:
    """Find the claim on each case, mode, error and varied value, or None."""
    by: dict[tuple[Any, ...], list[Claim]] = {}
    every = claims_of(cube.attrs["figure_set"])
    for one in sorted(every, key=lambda one: not one.values):  # first those about single settings
        by.setdefault((one.case, one.mode, one.quantity), []).append(one)
    return [
        next((one for one in by.get(tuple(of), []) if not one.values or value in one.values), None)
        for *of, value in rows
    ]


@dataclass(frozen=True)
class Bars:
    """One error of every setting: nominal run, band of the trials, prediction, claimed values."""

    #: Errors of the nominal run, and predicted errors, in %, shape (settings,)
    literal: Array
    predicted: Array
    band: Array  #: Quantiles 5, 50 and 95 % in %, shape (3, settings)
    claims: list[Claim | None]  #: Claim of the thesis on each setting, or None
    name: str = ""  #: Label of the bars, if a setting has more than one


def error_bars(cube: xr.Dataset, case: str, mode: int, quantity: str = "mean_error") -> Bars:
    """Return the bars of one error of a case and mode, by the error's name in the tables."""
    part = select_settings(cube, case, mode)
    values = cubes.cube_error(part, quantity)
    predicted, plane = cubes.predicted_value(part, quantity), cubes.ERROR_VARIABLES[quantity][1]
    literal, claims = values.isel(trial=0).values, claimed_errors(cube, case, mode, quantity)
    return Bars(literal, predicted.values, cubes.trial_band(values), claims, plane or "")


_CLAIMED_FIELDS = ("stated_low", "stated_high", "stated")


def errors_table(cube: xr.Dataset) -> pd.DataFrame:
    """Return every error of a cube in %: one row per setting, mode and kind of error.

    Columns are the nominal run (``trial_0``), median, 5 % and 95 % quantile of the trials, the
    predicted error, and ends and words of the claim; an open end is empty. The ledger has one row
    per claim with all its variables; a cube of single quantities, one row per quantity with value
    and unit.
    """
    if cubes.list_dimension(cube) == "claim":
        return pd.DataFrame(
            {str(n): v.values for n, v in cube.variables.items() if v.dims == ("claim",)}
        )
    table = cubes.summarise_errors(cube)
    if "case" not in cube or table.empty:
        return table
    table = table.rename(columns={"label": "setting", "low": "low_5", "high": "high_95"})
    shape = cube.sizes["setting"], cube.sizes["mode"]
    predicted = [
        cubes.predicted_value(cube, error).transpose("setting", "mode").values
        if error != "max_point_error" or f"predicted_{error}" in cube
        else np.full(shape, np.nan)
        for error in cubes.cube_errors(cube)
    ]
    keys = table[["case", "mode", "error", "value"]].itertuples(index=False)
    claims = _find_claims(cube, keys)
    stated = [(*claim.ends, claim.stated) if claim else (None,) * 3 for claim in claims]
    names = np.tile(np.repeat(cube["parameter"].values.astype(str), shape[1]), len(predicted))
    table = table.assign(parameter=names, predicted=np.ravel(predicted))
    return table.join(pd.DataFrame(stated, columns=_CLAIMED_FIELDS))


def figure_table(cube: xr.Dataset, errors: pd.DataFrame, case: str, mode: int) -> pd.DataFrame:
    """Return the numbers that a figure of a case and mode draws, one per row.

    `errors` is the table of the cube (:func:`errors_table`).

    Marker values are those of the settings with the least and the largest typical error; other
    values are of every setting. Maps of pressure are only in the cube. Columns are ``quantity``,
    ``statistic``, ``setting``, ``point``, ``x_mm``, ``y_mm``, ``value`` and ``unit``; those that do
    not apply are empty.
    """
    part = select_settings(cube, case, mode)
    whole = errors[(errors["case"] == case) & (errors["mode"] == mode)]
    names = ["trial_0", "low_5", "median", "high_95", "predicted", *_CLAIMED_FIELDS[:2]]
    drawn = whole.set_index(["error", "setting"])[names].astype(float).stack().dropna()
    drawn = drawn.rename_axis(["quantity", "setting", "statistic"]).reset_index(name="value")
    tables = [drawn.assign(unit="percent"), *(_drawn_values(part, str(n)) for n in part.data_vars)]
    columns = ["quantity", "statistic", "setting", "point", "x_mm", "y_mm", "value", "unit"]
    table = pd.concat([one for one in tables if len(one)]).reindex(columns=columns)
    return table.astype({"point": "Int64"})


def tabulate_cube(cube: xr.Dataset, name: str) -> dict[str, pd.DataFrame]:
    """Return the numbers of a cube and of its figures, by the names of their files."""
    errors = errors_table(cube)
    figures = figure_names(cube).items()
    own = {f"{name}/{file}": figure_table(cube, errors, *which) for which, file in figures}
    return {name: errors, **own}


def _drawn_values(part: xr.Dataset, name: str) -> pd.DataFrame:
    """Return the values of one variable of a case and mode, empty if no figure shows them."""
    values = part[name].isel(trial=0, missing_dims="ignore")
    tabulated = {variable for variable, _ in cubes.ERROR_VARIABLES.values()}
    if values.dtype.kind != "f" or name in tabulated or name.startswith("predicted_"):
        return pd.DataFrame()
    if values.dims == ("setting", "point"):
        values = values.isel(setting=best_and_worst(part))
    elif values.dims not in (("setting",), ("point",)):
        return pd.DataFrame()
    table = values.to_dataframe(name).reset_index()
    table = table[np.isfinite(table[name])]
    places = {f"{axis}_mm": 1000 * table[axis] for axis in "xy" if axis in table}
    if "point" in table:
        places["point"] = table["point"] + 1
    about = {"quantity": name, "unit": str(values.attrs.get("units", "1"))}
    return table.assign(**about, **places, setting=table.get("label", ""), value=table[name])


def as_csv(table: pd.DataFrame) -> str:
    """Format a table as CSV with six digits; equal tables give equal text."""
    return table.to_csv(index=False, float_format="%.6g", lineterminator="\n")


def figure_names(cube: xr.Dataset) -> dict[tuple[str, int], str]:
    """Return a file name without suffix for the numbers of each figure, by case and mode.

    Cases may have any name; file names have only plain letters, digits and hyphens. A cube without
    cases has no such files: its one table has all that its figures draw.
    """
    names: dict[tuple[str, int], str] = {}
    if "case" not in cube or cubes.list_dimension(cube) == "claim":
        return names
    for case in list_cases(cube):
        plain = re.sub(r"[^A-Za-z0-9]+", "-", case.replace("'", "-prime")).strip("-") or "case"
        for mode in cube["mode"].values.tolist():
            name, number = f"{plain}-mode-{mode}".lower(), 1
            while name in names.values():
                number += 1
                name = f"{plain}-{number}-mode-{mode}".lower()
            names[case, int(mode)] = name
    return names


LENS_FIELDS = ("focal_length_mm", "principal_offset_px", "sensor_width_mm")
"""Parameters behind images of ideal cameras with whole pixels, which rendered studies lack."""
DRAWN_DIGITS = 4  # significant digits of values that are only drawn
FIELD_STEP = 2  # every other point of a plane is enough for an animation


def viewer_data(cube: xr.Dataset) -> dict[str, Any]:
    """Return the nominal run and the statistics of a cube (format: `web.viewer.Viewer`)."""
    said, structure = cube.attrs, str(cube["outline"].attrs["structure"])
    kind = "beam" if structure == "beam" else "plate" if "mean_error" in cube else "sound"
    if "measured_deflection" in cube:  # only the nominal run is drawn
        literal = cube["measured_deflection"].isel(trial=0, drop=True)
        cube = cube.assign(measured_deflection=literal)
    if kind == "beam":  # one curve is drawn, along the middle row
        rows = np.unique(cube["y"].values)
        cube = cube.isel(point=np.flatnonzero(cube["y"].values == rows[len(rows) // 2]))
    length, width = schema.structure_extent(cube)
    size: dict[str, Any] = {"length_mm": round(1e3 * length, 3), "width_mm": round(1e3 * width, 3)}
    if structure == "panel":
        cube = _in_cells(cube)
        size["contours_mm"] = [(1000 * c).tolist() for c in schema.structure_contours(cube)]
    varied, hertz = said["varied"], cube["frequency"].values.tolist()
    modes = zip(cube["mode"].values.tolist(), hertz, strict=True)
    data: dict[str, Any] = {
        "structure": {"kind": kind, **size},
        "parameter": {
            "name": varied,
            "label": said["varied_label"],
            "unit": fields.unit_of_field(varied),
        },
        "modes": [{"mode": mode, "frequency_hz": round(hertz, 3)} for mode, hertz in modes],
        "words": {"draws": said["draws"], "predicts": said["predicts"]},
        "colors": list(CYCLE_COLORS),
        "cases": [
            _describe_case(cube, case, _planes if kind == "sound" else _shape)
            for case in list_cases(cube)
        ],
    }
    (_add_fields if kind == "sound" else _add_shapes)(data, cube)
    asked = json.loads(said["parameters"])
    if kind != "sound" and asked.keys() >= set(LENS_FIELDS):
        data["lens"] = {name: asked[name] for name in LENS_FIELDS}
    if kind != "beam":
        data["colormap"] = list(DIVERGING_COLORS)
    return data


def _in_cells(cube: xr.Dataset) -> xr.Dataset:
    """Arrange a panel's markers in the cells of the box around it; NaN in empty cells."""
    x, y, place = schema.marker_cells(cube)
    names = ("reference_deflection", "measured_deflection", "point_error")
    wide = {
        n: (cube[n].dims, schema.fill_cells(cube[n].values, place, x.size * y.size)) for n in names
    }
    columns, rows = np.tile(x, len(y)), np.repeat(y, len(x))
    rest = cube.drop_vars([*names, "x", "y"])
    return rest.assign(wide).assign_coords(x=("point", columns), y=("point", rows))


def _describe_case(
    cube: xr.Dataset, case: str, result: Callable[..., dict[str, Any]]
) -> dict[str, Any]:
    """Return the data of a case; numbers of the thesis's figures only for its parameters."""
    parts = {mode: select_settings(cube, case, mode) for mode in cube["mode"].values.tolist()}
    names = list(cubes.cube_errors(cube))
    bars = {mode: {name: error_bars(cube, case, mode, name) for name in names} for mode in parts}
    first, shown = next(iter(parts.values())), cube.attrs["in_the_thesis"]
    places = np.stack([first[f"camera_{a}"] for a in ("distance", "azimuth", "elevation")], -1)
    return {
        "name": case,
        "title": str(first["case_title"].values[0]) or "own layout",
        "figures": {
            str(mode): str(part["thesis_figure"].values[0]) if shown else ""
            for mode, part in parts.items()
        },
        "settings": [
            {
                "label": str(one["label"].values),
                "value": float(one["value"]),
                "cameras": np.round(place[: int(one["n_cameras"])] * [1000, 1, 1], 6).tolist(),
                "resolution": [int(one["width_px"]), int(one["height_px"])],
                "in_view": float(one["in_view"]),
                "modes": [result(parts[m].isel(setting=i), bars[m], i) for m in parts],
            }
            for i, (one, place) in enumerate(
                zip(cubes.iterate_slices(first, "setting"), places, strict=True)
            )
        ],
    }


def _bar(bars: Bars, index: int) -> dict[str, Any]:
    claim, (low, median, high) = bars.claims[index], bars.band[:, index]
    values = {"mean": bars.literal[index], "median": median, "low": low, "high": high}
    values["predicted"] = bars.predicted[index]
    return values | {"stated": list(claim.ends) if claim else None}


def _shape(result: xr.Dataset, bars: dict[str, Bars], index: int) -> dict[str, Any]:
    return {
        "measured_mm": _round_drawn(result["measured_deflection"] * 1000),
        "point_error": _round_drawn(result["point_error"]),
        **_bar(bars["mean_error"], index),
    }


def _planes(result: xr.Dataset, bars: dict[str, Bars], index: int) -> dict[str, Any]:
    return {
        "planes": {
            error.name: None if np.isnan(error.literal[index]) else _bar(error, index)
            for error in bars.values()
        },
        "deflection": {"mean": float(result["deflection_error"].isel(trial=0))},
    }


def _add_shapes(data: dict[str, Any], cube: xr.Dataset) -> None:
    for entry in data["modes"]:
        reference = cube["reference_deflection"].sel(mode=entry["mode"])
        entry["reference_mm"] = (reference * 1000).values.tolist()
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

    def read_pressure(of: str, *dims: str) -> ComplexArray:
        parts = (cube[f"pressure_{of}_{part}"].transpose(*dims, ...) for part in ("real", "imag"))
        real, imaginary = (part.values[..., ::FIELD_STEP, ::FIELD_STEP] for part in parts)
        return np.asarray(real.astype(float) + 1j * imaginary.astype(float))

    ideal = read_pressure("reference", "mode")
    measured = read_pressure("measured", "case", "mode", "extreme")
    silent = np.isnan(cube["independent_ratio"].values)  # nodal planes
    for m, entry in enumerate(data["modes"]):
        entry["fields"] = {
            name: encode_field(ideal[m, p]) for p, name in enumerate(names) if not silent[m, p]
        }
    for c, case in enumerate(data["cases"]):
        first = np.flatnonzero(cube["case"].values == case["name"])[0]
        case["extremes"] = {
            str(entry["mode"]): {
                extreme: {
                    "index": int(cube["best_and_worst"].values[c, m, x] - first),
                    "fields": {
                        name: encode_field(measured[c, m, x, p] - ideal[m, p])
                        for p, name in enumerate(names)
                    },
                }
                for x, extreme in enumerate(("best", "worst"))
            }
            for m, entry in enumerate(data["modes"])
        }


def encode_field(field: ComplexArray) -> dict[str, Any]:
    """Encode a complex field as signed bytes, on a scale of its own."""
    parts = field.real, field.imag
    scale = max(float(np.abs(part).max()) for part in parts) or 1.0
    coded = [np.clip(np.rint(part / scale * 127), -127, 127).astype(np.int8) for part in parts]
    real, imaginary = (base64.b64encode(part.tobytes()).decode() for part in coded)
    return {"scale": float(f"{scale:.6g}"), "re": real, "im": imaginary}


def _round_drawn(values: xr.DataArray) -> list[float]:
    """Round numbers to :data:`DRAWN_DIGITS` significant digits."""
    return [float(f"{value:.{DRAWN_DIGITS}g}") for value in values.values.tolist()]
