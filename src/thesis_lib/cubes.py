"""Result cubes: what made them, what they say in a table, and how two of them differ."""

from __future__ import annotations

import datetime
import hashlib
import importlib.metadata
import json
import platform
import subprocess
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib import __version__, effort
from thesis_lib.camera_study import LEAST_SQUARES
from thesis_lib.chunks import Outline
from thesis_lib.files import library_digest, library_files, project_root, whole_file
from thesis_lib.parameters import STUDIES, Study
from thesis_lib.storage import CubeError, fill_in, opened, write

ERRORS = {  # name in the tables: variable, and plane if it has one
    "mean_error": ("mean_error", None),
    "max_point_error": ("max_point_error", None),
    "plane_error_xz": ("plane_error", "XZ"),
    "plane_error_yz": ("plane_error", "YZ"),
    "power_error": ("power_error", None),
}
SHORT = {"mean_error": "mean", "max_point_error": "peak",
         "plane_error_xz": "XZ", "plane_error_yz": "YZ", "power_error": "power"}  # fmt: skip
SECTIONS = {"cameras": "chapter 2, appendices A, B", "beam": "section 3.3", "plate": "section 4.2",
            "experiment": "section 5.2", "lab": "section 5.3", "sound": "section 6.2",
            "design": "sections 1.2, 3.4, 4.3", "shape": "section 7.1",
            "claims": "all chapters"}  # fmt: skip
_QUANTITIES = ("quantity", "value", "unit")
OWN = {  # what is compared of figure sets without settings of the thesis
    "claims": ("claim", "verdict"), "cameras": _QUANTITIES, "design-law": _QUANTITIES,
    "planner": _QUANTITIES,
}  # fmt: skip
KEYS = ["case", "value", "label", "pair_order", "mode"]
STATISTICS = ["trial_0", "median", "low", "high"]
BAND = (0.05, 0.5, 0.95)  # quantiles of the trials
RUN_DEPENDENT = ("commit", "created", "run_time_s", "peak_memory_mb")


def cached(
    study: Study, compute: Callable[[Any], xr.Dataset | Outline], sources: Iterable[Path] = ()
) -> xr.Dataset:
    """A study's cube, computed once for its parameters and the library as it is.

    Notebooks that need the same cube share it through ``build/cache``. What takes long names the
    `sources` that it depends on; without them it depends on the whole library. An outline that is
    too large to be held is filled in on disk, and read from there as it is needed.
    """
    total = hashlib.sha256(f"{study.name} {study.digest}".encode())
    for file in sorted(sources) or library_files():
        total.update(file.read_bytes())
    path = project_root() / "build" / "cache" / f"{study.name}-{total.hexdigest()[:16]}.nc"
    start, before = time.perf_counter(), effort.loaded_seconds()
    if path.is_file():
        cube = opened(path)
        spared = float(cube.attrs["run_time_s"])
        effort.note_loaded(spared, float(cube.attrs.get("peak_memory_mb", 0)))
        return with_provenance(cube, study, spared)  # of today's commit
    made = compute(study)
    if isinstance(made, Outline) and not made.is_held:
        frame = replace(made, cube=with_provenance(made.cube, study, 0.0))
        fill_in(frame, path, lambda: time.perf_counter() - start + effort.loaded_seconds() - before)
        cube = opened(path)
        return with_provenance(cube, study, float(cube.attrs["run_time_s"]))
    cube = with_provenance(made.in_memory() if isinstance(made, Outline) else made, study, 0.0)
    seconds = time.perf_counter() - start + effort.loaded_seconds() - before
    write(cube.assign_attrs(run_time_s=seconds), path)
    return with_provenance(opened(path), study, seconds)


def predicts(cube: xr.Dataset) -> str:
    """What `predicted_error` stands for, as legends say it."""
    words = STUDIES[cube.attrs["figure_set"]].predicts
    estimator = json.loads(cube.attrs["parameters"]).get("estimator", LEAST_SQUARES)
    return words if estimator == LEAST_SQUARES else f"{words} of least squares"


def _commit() -> str:
    """Commit of the checkout, with a plus sign if it has changes; `unknown` elsewhere."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--abbrev=12"]
    try:
        done = subprocess.run(
            [*command, "--dirty=+", "--exclude=*"], capture_output=True, text=True, timeout=10
        )
    except (OSError, subprocess.TimeoutExpired):
        return "unknown"
    return done.stdout.strip() or "unknown"


def with_provenance(cube: xr.Dataset, study: Study, seconds: float) -> xr.Dataset:
    """The cube with attributes that say what it is and how it was made.

    `commit`, `created`, `run_time_s` and `peak_memory_mb` differ from run to run; all else is a
    function of the parameters, the library and the versions of the packages it computes with.
    """
    cube = cube.assign_attrs(
        title=study.title,
        references="thesis on flexural vibration measurement with multiple cameras, "
        + SECTIONS[study.subject],
        figure_set=study.name,
        parameters=json.dumps(study.request),
        parameters_hash=study.digest,
        seed=np.int64(study.seed),
        run_dependent=" ".join(RUN_DEPENDENT),
        run_time_s=np.float64(seconds),
        peak_memory_mb=np.float64(effort.peak_memory_mb()),
        library_sha256=library_digest(),
    )
    return with_origin(cube, f"simulation by thesis_lib {__version__}, figure set {study.name}")


def with_origin(data: xr.Dataset, source: str) -> xr.Dataset:
    """The data with attributes that say where they come from, and with which versions."""
    packages = ("numpy", "xarray", "h5netcdf", "h5py")
    versions = {name: importlib.metadata.version(name) for name in packages}
    now = datetime.datetime.now(datetime.UTC).replace(microsecond=0)
    return data.assign_attrs(
        Conventions="CF-1.11",
        source=source,
        versions=json.dumps({"python": platform.python_version(), **versions}),
        commit=_commit().ljust(16),  # of one length: bytes after it stay in place
        created=now.isoformat(),
    )


def read(path: Path) -> xr.Dataset:
    """Open one of our cubes.

    Raises
    ------
    CubeError
        In one line: the file, and what is wrong with it.
    """
    cube = opened(path)
    missing = {"figure_set", "parameters"} - set(cube.attrs)
    if (name := str(cube.attrs.get("figure_set"))) in OWN:
        missing |= set(OWN[name]) - set(cube.variables)
    else:
        missing |= set(KEYS) - set(cube.variables)
        errors_ = {variable for variable, _ in ERRORS.values()}
        missing |= set() if errors_ & set(cube) else {"errors"}
    if missing or str(cube.attrs["figure_set"]) not in STUDIES:
        lacks = ", ".join(sorted(map(str, missing))) or "a known figure set"
        raise CubeError(f"{path}: not a cube of this project (it lacks {lacks})")
    return cube


def errors(cube: xr.Dataset) -> dict[str, xr.DataArray]:
    """The errors that a cube holds in %, by their names in the tables."""
    return {
        name: cube[variable] if plane is None else cube[variable].sel(plane=plane)
        for name, (variable, plane) in ERRORS.items()
        if variable in cube
    }


def predicted(cube: xr.Dataset, error: str) -> xr.DataArray:
    """What is predicted of an error by its name in the tables, in %."""
    variable, plane = ERRORS[error]
    own = f"predicted_{variable}"  # of a cube with errors of several kinds
    values = cube[own if own in cube else "predicted_error"]
    return values if plane is None else values.sel(plane=plane)


def summary(cube: xr.Dataset) -> pd.DataFrame:
    """Each error by setting and mode: trial 0, and median, 5 % and 95 % of the other trials.

    Without other trials the latter three are NaN. Of the ledger: the verdict on every claim; of
    ``cameras``, ``design-law`` and ``planner``: every quantity with its value and unit.
    """
    if (name := cube.attrs["figure_set"]) in OWN:
        return pd.DataFrame({column: cube[column].values for column in OWN[name]})
    rows: list[dict[str, Any]] = []
    for quantity, values in errors(cube).items():
        literal = values.isel(trial=0).transpose("setting", "mode").values
        low, median, high = band(values)
        for s in range(cube.sizes["setting"]):
            for m, mode in enumerate(cube["mode"].values):
                rows.append(
                    {
                        "case": str(cube["case"].values[s]),
                        "value": float(cube["value"].values[s]),
                        "pair_order": str(cube["pair_order"].values[s]),
                        "label": str(cube["label"].values[s]),
                        "mode": int(mode),
                        "error": quantity,
                        "trial_0": float(literal[s, m]),
                        "median": float(median[s, m]),
                        "low": float(low[s, m]),
                        "high": float(high[s, m]),
                    }
                )
    return pd.DataFrame(rows)


def band(values: xr.DataArray) -> Any:
    """Quantiles 5, 50 and 95 % of errors over their trials but the literal run.

    They are (3, setting, ...), NaN without such trials. One setting is read at a time.
    """
    here = values.transpose("setting", ..., "trial")
    bands = np.full((len(BAND), *here.shape[:-1]), np.nan)
    for setting in range(here.sizes["setting"] if here.sizes["trial"] > 1 else 0):
        drawn = here.isel(setting=setting).values[..., 1:]
        bands[:, setting] = np.quantile(drawn, BAND, axis=-1)
    return bands


def percent_text(value: float) -> str:
    """A percentage with one decimal, below 1 with two, below 0.1 with three."""
    size = abs(value)
    return f"{value:.1f}" if size >= 0.995 else f"{value:.2f}" if size >= 0.095 else f"{value:.3f}"


def band_text(median: float, low: float, high: float) -> str:
    """Median and band as they stand in tables; a dash where there were no trials."""
    text = percent_text
    return "—" if np.isnan(median) else f"{text(median)} ({text(low)}–{text(high)})"


def published_path(name: str) -> Path:
    """Where the published figures of a figure set are kept."""
    return project_root() / "data" / "published" / f"{name}.csv"


def read_published(name: str) -> pd.DataFrame | None:
    """The published summary of a figure set, if there is one."""
    path = published_path(name)
    text = dict.fromkeys(("case", "label", "pair_order", "claim", "quantity", "unit"), str)
    return (
        pd.read_csv(path, dtype=text, keep_default_na=False, na_values=["nan"])
        if path.is_file()
        else None
    )


def publish(cube: xr.Dataset) -> Path:
    """Make this cube's errors the published ones; returns the file."""
    path = published_path(cube.attrs["figure_set"])
    table = summary(cube)
    whole_file(
        path, lambda part: table.to_csv(part, index=False, float_format="%.6g", na_rep="nan")
    )
    return path


def compare(new: pd.DataFrame, old: pd.DataFrame) -> pd.DataFrame:
    """Two summaries side by side, for the settings and modes that both have.

    Columns of `old` end in ``_old``; ``difference`` is that of the medians in percentage points,
    and ``apart`` tells whether the 5–95 % bands do not meet.
    """
    for key in ("claim", "quantity"):
        if key in new:
            return new.merge(old, on=key, suffixes=("", "_old"), validate="one_to_one")
    keys, old = [*KEYS, "error"], old.astype({"value": float})
    table = new.merge(old, on=keys, suffixes=("", "_old"), validate="one_to_one")
    table["difference"] = table["median"] - table["median_old"]
    table["apart"] = (table["low"] > table["high_old"]) | (table["high"] < table["low_old"])
    return table


def comparison_lines(table: pd.DataFrame, old_name: str) -> list[str]:
    """The comparison as text: one line per setting and mode, in % of the largest deflection."""
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
    old = table[[f"{name}_old" for name in STATISTICS]]
    changed = ~np.isclose(table[STATISTICS], old, rtol=1e-4, equal_nan=True)
    if not changed.any():
        return [f"no difference from {old_name} ({len(table)} errors compared)"]
    header = (
        f"{'case':>6} {'setting':>12} {'mode':>4} {'error':>5} | "
        f"{'median (5–95 %)':>20} | {old_name:>20} | {'change':>7} | {'trial 0':>15}"
    )
    lines = [header, "-" * len(header)]
    for row in table[np.isfinite(table["trial_0"])].itertuples():
        new = band_text(row.median, row.low, row.high)
        old = band_text(row.median_old, row.low_old, row.high_old)
        change = "—" if np.isnan(row.difference) else f"{round(row.difference, 1) + 0.0:+.1f}"
        lines.append(
            f"{row.case:>6} {row.label:>12} {row.mode:>4} "
            f"{SHORT[row.error]:>5} | "
            f"{new:>20} | {old:>20} | {change:>7} | "
            f"{percent_text(row.trial_0_old):>6} → {percent_text(row.trial_0):>6}"
            f"{' *' if row.apart else ''}"
        )
    lines.append("errors in % of the largest reference value; * the bands do not meet")
    return lines


def difference_lines(
    cube: xr.Dataset, other: xr.Dataset | None = None, name: str = ""
) -> list[str]:
    """How a cube's errors differ from those of another, or from the published run."""
    if other is not None:
        return comparison_lines(compare(summary(cube), summary(other)), name)
    published = read_published(cube.attrs["figure_set"])
    if published is None:
        return ["nothing is published yet to compare with"]
    return comparison_lines(compare(summary(cube), published), "published")
