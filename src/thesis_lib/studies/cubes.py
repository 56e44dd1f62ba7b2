"""Result cubes: summary tables, published errors, and the differences of two cubes."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.files import shipped, whole_text
from thesis_lib.text import RefusedError, describe_damage, one_line

_ERRORS = {  # name in the tables: variable, plane if it has one, short label, and its meaning
    "mean_error": ("mean_error", None, "mean", "rms over the markers"),
    "max_point_error": ("max_point_error", None, "peak", "largest error of a marker"),
    "plane_error_xz": ("plane_error", "XZ", "XZ", "error of the pressure on that plane"),
    "plane_error_yz": ("plane_error", "YZ", "YZ", "error of the pressure on that plane"),
    "power_error": ("power_error", None, "power", "error of the sound power"),
}
ERROR_VARIABLES = {name: (variable, plane) for name, (variable, plane, *_) in _ERRORS.items()}
SHORT_LABELS = {name: label for name, (*_, label, _) in _ERRORS.items()}
LISTED_VARIABLES = {  # compared variables of a cube whose results are a list, by its dimension
    "claim": ("claim", "verdict"),
    "quantity": ("quantity", "value", "unit"),
}
SETTING_KEYS = ["case", "value", "label", "pair_order"]  # identify a setting
ROW_KEYS = [*SETTING_KEYS, "mode"]
STATISTIC_NAMES = ["trial_0", "median", "low", "high"]
BAND_QUANTILES = (0.05, 0.5, 0.95)  # quantiles of the trials

_Cube = TypeVar("_Cube", xr.Dataset, xr.DataArray)


class CubeError(RefusedError):
    """A file that is not one of our cubes; the message is one line."""


def iterate_slices(cube: _Cube, dim: str) -> Iterator[_Cube]:
    """Iterate over a cube along a dimension."""
    return (cube.isel({dim: index}) for index in range(cube.sizes[dim]))


def complex_of(data: xr.Dataset, name: str) -> ComplexArray:
    """Return the complex values of a variable that is stored as real and imaginary part."""
    return np.asarray(data[f"{name}_real"].values + 1j * data[f"{name}_imag"].values)


def list_dimension(cube: xr.Dataset) -> str:
    """Return the dimension along which a cube lists results; empty if it holds errors."""
    return next((name for name in LISTED_VARIABLES if name in cube.dims), "")


def cube_errors(cube: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the errors that a cube holds in %, by their names in the tables."""
    return {
        name: cube_error(cube, name)
        for name, (variable, _) in ERROR_VARIABLES.items()
        if variable in cube
    }


def cube_error(cube: xr.Dataset, name: str) -> xr.DataArray:
    """Return one error of a cube in %, by its name in the tables."""
    variable, plane = ERROR_VARIABLES[name]
    return cube[variable] if plane is None else cube[variable].sel(plane=plane)


def predicted_value(cube: xr.Dataset, error: str) -> xr.DataArray:
    """Return the predicted error in %, by the name of the error in the tables."""
    variable, plane = ERROR_VARIABLES[error]
    own = f"predicted_{variable}"  # of a cube with errors of several kinds
    values = cube[own if own in cube else "predicted_error"]
    return values if plane is None else values.sel(plane=plane)


def summarise_errors(cube: xr.Dataset) -> pd.DataFrame:
    """Tabulate each error by setting and mode: nominal run; median, 5 % and 95 % of random trials.

    Without random trials the latter three are NaN. A ledger gives the verdict on every claim; a
    cube that lists quantities gives each with its value and unit.
    """
    if name := list_dimension(cube):
        return pd.DataFrame({column: cube[column].values for column in LISTED_VARIABLES[name]})
    tables = []
    for quantity, values in cube_errors(cube).items():
        nominal = values.isel(trial=0).transpose("setting", "mode").values
        low, median, high = trial_band(values)
        rows: dict[str, Any] = {
            key: np.repeat(cube[key].values, cube.sizes["mode"])
            for key in ("case", "value", "pair_order", "label")
        }
        rows |= {"mode": np.tile(cube["mode"].values, cube.sizes["setting"]), "error": quantity}
        found = zip(STATISTIC_NAMES, (nominal, median, low, high), strict=True)
        tables.append(pd.DataFrame(rows | {name: each.ravel() for name, each in found}))
    if not tables:
        return pd.DataFrame()
    numbers = dict.fromkeys(("value", *STATISTIC_NAMES), float)
    return pd.concat(tables, ignore_index=True).astype(numbers)


def trial_band(values: xr.DataArray) -> Any:
    """Return the 5, 50 and 95 % quantiles of errors over the random trials.

    Shape (3, setting, ...), NaN without random trials. One setting is read at a time.
    """
    here = values.transpose("setting", ..., "trial")
    bands = np.full((len(BAND_QUANTILES), *here.shape[:-1]), np.nan)
    for setting in range(here.sizes["setting"] if here.sizes["trial"] > 1 else 0):
        drawn = here.isel(setting=setting).values[..., 1:]
        bands[:, setting] = np.quantile(drawn, BAND_QUANTILES, axis=-1)
    return bands


def typical_error(values: xr.DataArray) -> Array:
    """Return the median over the random trials, or the nominal run if there are none.

    Shape (setting, ...). Settings are ranked by it, since a single run ranks them by chance.
    """
    literal: Array = values.isel(trial=0).transpose("setting", ...).values
    median = trial_band(values)[1]
    return np.where(np.isfinite(median), median, literal)


def trials_are(cube: xr.Dataset) -> str:
    """Return the name of a cube's trials in tables and legends."""
    draws = str(cube.attrs.get("draws", ""))
    return draws if draws.endswith(("recording", "recordings")) else "trials"


def percent_text(value: float) -> str:
    """Return a percentage with one decimal, below 1 with two, below 0.1 with three."""
    size = abs(value)
    return f"{value:.1f}" if size >= 0.995 else f"{value:.2f}" if size >= 0.095 else f"{value:.3f}"


def band_text(median: float, low: float, high: float) -> str:
    """Format a median and band for tables; a dash where there were no trials."""
    text = percent_text
    return "—" if np.isnan(median) else f"{text(median)} ({text(low)}–{text(high)})"


_TEXT_COLUMNS = ("case", "pair_order", "label", "error", "claim", "verdict", "quantity", "unit")
_NUMBER_COLUMNS = ("value", *STATISTIC_NAMES)


def summary_path(name: str) -> Path:
    """Return the path of a figure set's published errors."""
    return shipped() / "data" / "published" / f"{name}.csv"


def publish_errors(cube: xr.Dataset) -> Path:
    """Make this cube's errors the published ones; return the file."""
    path = summary_path(cube.attrs["figure_set"])
    whole_text(path, summarise_errors(cube).to_csv(index=False, float_format="%.6g", na_rep="nan"))
    return path


def read_published(name: str) -> pd.DataFrame | None:
    """Return the published summary of a figure set, if there is one.

    Raises
    ------
    CubeError
        If the file is damaged.
    """
    path = summary_path(name)
    if not path.is_file():
        return None
    types = {**dict.fromkeys(_TEXT_COLUMNS, str), **dict.fromkeys(_NUMBER_COLUMNS, float)}
    missing = dict.fromkeys(_NUMBER_COLUMNS, "nan")
    try:
        table = pd.read_csv(
            path, dtype=types | {"mode": int}, keep_default_na=False, na_values=missing
        )
    except (OSError, ValueError, OverflowError) as error:
        raise CubeError(describe_damage(path, error)) from None
    listed = next((one for one in LISTED_VARIABLES if one in table), "")
    keys = [listed] if listed else [*ROW_KEYS, "error"]
    columns = LISTED_VARIABLES.get(listed, (*keys, *STATISTIC_NAMES))
    is_shifted = not isinstance(table.index, pd.RangeIndex)  # a row has too many values
    if is_shifted or set(table) != set(columns) or table.duplicated(keys).any():
        needed = f"needs the columns {', '.join(columns)}, and each {', '.join(keys)} once"
        raise CubeError(describe_damage(path, needed))
    return table


# Differences by rounded files and machines, relative to the largest value, by bytes of a number.
MAX_EQUAL_DIFFERENCES = {4: 2.5e-4, 8: 1.5e-7}
MAX_LISTED_NAMES = 12  # names in a list


def compare_summaries(
    new: pd.DataFrame, old: pd.DataFrame, how: Literal["inner", "left"] = "inner"
) -> pd.DataFrame:
    """Merge two summaries, for the settings and modes that both have.

    With `how` left, for all that `new` has; values that `old` lacks are NaN.
    Columns of `old` end in ``_old``; ``difference`` is that of the medians in percentage points,
    and ``apart`` is true where the 5–95 % bands do not overlap.
    """
    keys = next(([one] for one in LISTED_VARIABLES if one in new), [*ROW_KEYS, "error"])
    table = new.merge(old, how, on=keys, suffixes=("", "_old"), validate="one_to_one")
    if "median" in table:
        table["difference"] = table["median"] - table["median_old"]
        table["apart"] = (table["low"] > table["high_old"]) | (table["high"] < table["low_old"])
    return table


def difference_lines(
    cube: xr.Dataset, other: xr.Dataset | None = None, name: str = ""
) -> list[str]:
    """Describe how a cube's errors differ from those of another, or from the published run.

    A line per setting and mode, in % of the largest deflection.
    """
    old_name = name if other is not None else "published"
    before = read_published(cube.attrs["figure_set"]) if other is None else summarise_errors(other)
    if before is None:
        return ["nothing is published yet to compare with"]
    table = compare_summaries(summarise_errors(cube), before)
    if "verdict" in table:
        changed = table[table["verdict"] != table["verdict_old"]]
        lines = [f"{r.claim}: {r.verdict_old} → {r.verdict}" for r in changed.itertuples()]
        return lines or [f"no difference from {old_name} ({len(table)} claims compared)"]
    if table.empty:
        return [f"no setting in common with {old_name}"]
    if "quantity" in table:
        same = np.isclose(table["value"], table["value_old"], rtol=1e-4, equal_nan=True)
        lines = [
            f"{r.quantity}: {r.value_old:.5g} → {r.value:.5g}" + f" {r.unit}" * (r.unit != "1")
            for r in table[~same].itertuples()
        ]
        return lines or [f"no difference from {old_name} ({len(table)} quantities compared)"]
    old = table[[f"{name}_old" for name in STATISTIC_NAMES]]
    changed = ~np.isclose(table[STATISTIC_NAMES], old, rtol=1e-4, equal_nan=True)
    if not changed.any():
        return [f"no difference from {old_name} ({len(table)} errors compared)"]
    return _tabulate_errors(table, cube.attrs["trial_0"], old_name)


def _tabulate_errors(table: pd.DataFrame, first: str, old_name: str) -> list[str]:
    """Return a header, a line per setting and mode, and a legend; `first` describes trial 0."""
    row = "{:>6} {:>12} {:>4} {:>5} | {:>7} | {:>20} | {:>7} | {:>20} | {:>7}".format
    names = "trial 0", "median (5–95 %)", "trial 0", old_name, "change"
    header, lines = row("case", "setting", "mode", "error", *names), []
    for one in table[np.isfinite(table["trial_0"])].itertuples():
        new = percent_text(one.trial_0), band_text(one.median, one.low, one.high)
        old = "—" if np.isnan(one.trial_0_old) else percent_text(one.trial_0_old)
        old_band = band_text(one.median_old, one.low_old, one.high_old)
        change = "—" if np.isnan(one.difference) else f"{round(one.difference, 1) + 0.0:+.1f}"
        of = one.case, one.label, one.mode, SHORT_LABELS[one.error]
        lines.append(row(*of, *new, old, old_band, change) + " *" * one.apart)
    errors = [_ERRORS[name] for name in dict.fromkeys(table["error"])]
    meanings = "; ".join(f"{label}: {meaning}" for *_, label, meaning in errors)
    legend = (
        f"errors in % of the largest reference value; trial 0: {first}; * the bands do not meet; "
        f"{meanings}"
    )
    return [header, "-" * len(header), *lines, legend]


def published_comparison(cube: xr.Dataset) -> pd.DataFrame:
    """Merge a run's summary with the published one, with NaN where nothing is published."""
    table = summarise_errors(cube)
    if table.empty:
        return table
    published = read_published(cube.attrs["figure_set"])
    return compare_summaries(table, table.iloc[:0] if published is None else published, "left")


def error_lines(cube: xr.Dataset) -> list[str]:
    """Return a line per setting and mode with the errors of a run, and those published for it.

    For a cube that lists quantities, return these if none are published, else nothing.
    """
    table = published_comparison(cube)
    if "trial_0" not in table:
        new = "quantity" in table and read_published(cube.attrs["figure_set"]) is None
        return [f"{r.quantity}: {r.value:.5g} {r.unit}" for r in table.itertuples() if new]
    return _tabulate_errors(table, cube.attrs["trial_0"], "published")


def all_difference_lines(
    cube: xr.Dataset, other: xr.Dataset | None = None, name: str = ""
) -> list[str]:
    """Describe all differences of a cube: errors, every variable and coordinate, parameters.

    Without `other`, compare with the published run, which has only errors; `name` names `other`.
    """
    lines = difference_lines(cube, other, name)
    if other is None:
        known = {*ROW_KEYS, *(name for name, _ in ERROR_VARIABLES.values())}
        known |= set(LISTED_VARIABLES.get(list_dimension(cube), ()))
        here = sorted({str(variable) for variable in cube.variables} - known)
        return [*lines, f"not compared, since only errors are published: {_names(here)}"]
    found: dict[str, list[str]] = {}
    shared = _select_shared(cube, other)
    for each in sorted({str(n) for n in (*cube.variables, *other.variables)}):
        outcome, words = _compare_variable(each, *shared)
        found.setdefault(outcome, []).append(words)
    same, differ = len(found.pop("same", [])), found.pop("differs", [])
    apart = ", those above apart" if differ else ""
    lines += [*differ, f"no difference from {name} in {same} variables and coordinates{apart}"]
    lines += [f"not compared, since {why}: {_names(names)}" for why, names in found.items()]
    new, old = (json.loads(one.attrs["parameters"]) for one in (cube, other))
    for key in sorted({*new, *old}):
        if new.get(key) != old.get(key):
            before, now = (one_line(json.dumps(one.get(key))) for one in (old, new))
            lines.append(f"parameter {key}: {before} → {now}")
    return lines


def _compare_variable(name: str, cube: xr.Dataset, other: xr.Dataset) -> tuple[str, str]:
    """Return ``same``, ``differs`` or why a variable is not compared, and its name or change."""
    if name not in cube.variables or name not in other.variables:
        return "only in the first" if name in cube.variables else "only in the second", name
    new, old = cube[name], other[name]
    if new.dims != old.dims or new.shape != old.shape:
        return "of another shape", name
    off = _differing(new.values, old.values)
    if not off.any():
        return "same", name
    far = ""
    if new.dtype.kind in "iuf" and old.dtype.kind in "iuf":
        apart = np.abs(new.values.astype(float) - old.values.astype(float))
        far = f", by up to {np.nanmax(apart):.3g}" if np.isfinite(apart).any() else ""
    dims = f"({', '.join(map(str, new.dims))})" if new.dims else ""
    return "differs", f"{name}{dims}: {off.sum()} of {off.size} values differ{far}"


def _select_shared(cube: xr.Dataset, other: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset]:
    """Return the parts of two cubes that both have: settings, modes, lists, and first trials."""
    both = cube, other
    if all(name in one.variables for one in both for name in SETTING_KEYS):
        rows = [zip(*(one[k].values.tolist() for k in SETTING_KEYS), strict=True) for one in both]
        cube = cube.assign_coords(setting=list(map(repr, rows[0])))
        other = other.assign_coords(setting=list(map(repr, rows[1])))
    trials = slice(min(cube.sizes.get("trial", 0), other.sizes.get("trial", 0)) or None)
    cube, other = (one.isel(trial=trials, missing_dims="ignore") for one in (cube, other))
    labelled = {"setting", "mode", *LISTED_VARIABLES} & set(cube.indexes) & set(other.indexes)
    exclude = {*cube.dims, *other.dims} - labelled
    return xr.align(cube, other, join="inner", copy=False, exclude=exclude)


def _differing(new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """Return which values differ by more than :data:`MAX_EQUAL_DIFFERENCES`."""
    kinds = {new.dtype.kind, old.dtype.kind}
    if kinds <= {"f", "i", "u"} and "f" in kinds:
        size = min(one.dtype.itemsize for one in (new, old) if one.dtype.kind == "f")
        finite = np.abs(np.where(np.isfinite(old), old, 0.0))
        allowed = MAX_EQUAL_DIFFERENCES.get(size, 1e-9) * (finite.max() if finite.size else 0.0)
        return ~np.isclose(new, old, rtol=0, atol=allowed, equal_nan=True)
    if not kinds <= {"i", "u", "b"}:
        new, old = new.astype(str), old.astype(str)
    return np.asarray(new != old)


def _names(names: list[str]) -> str:
    more = len(names) - MAX_LISTED_NAMES
    return ", ".join(names[:MAX_LISTED_NAMES]) + (f" and {more} more" if more > 0 else "")
