"""Result cubes: what made them, what they say in a table, and how two of them differ."""

from __future__ import annotations

import datetime
import hashlib
import importlib.metadata
import json
import platform
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib import __version__, effort, kept
from thesis_lib.camera_study import LEAST_SQUARES
from thesis_lib.chunks import Outline
from thesis_lib.cube_check import check
from thesis_lib.files import library_digest, library_files, project_root
from thesis_lib.parameters import STUDIES, Study
from thesis_lib.storage import fill_in, opened, write

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
    study: Study, compute: Callable[[Any], xr.Dataset | Outline], sources: Sequence[Path] = ()
) -> xr.Dataset:
    """A study's cube, computed once for its parameters and the library as it is.

    Notebooks that need the same cube share it through ``build/cache``. What takes long names the
    `sources` that it depends on; without them it depends on the whole library. An outline that is
    too large to be held is filled in on disk, and read from there as it is needed.
    """
    total = hashlib.sha256(f"{study.name} {study.digest}".encode())
    lock = project_root() / "requirements" / "book.txt"
    for file in [*sorted(sources), lock] if sources else library_files():
        total.update(file.read_bytes())
    path = project_root() / "build" / "cache" / f"{study.name}-{total.hexdigest()[:16]}.nc"
    if (cube := kept.read(path)) is not None:
        spared = float(cube.attrs["run_time_s"])
        effort.note_loaded(spared, float(cube.attrs.get("peak_memory_mb", 0)))
        return with_provenance(cube, study, spared)  # of today's commit
    seconds = effort.stopwatch()
    made = compute(study)
    if isinstance(made, Outline) and not made.is_held:
        frame = replace(made, cube=with_provenance(made.cube, study, 0.0))
        fill_in(frame, path, seconds)
    else:
        cube = made.in_memory() if isinstance(made, Outline) else made
        write(with_provenance(cube, study, seconds()), path)
    kept.keep(path)
    cube = opened(path)
    return with_provenance(cube, study, float(cube.attrs["run_time_s"]))


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
    name = str(cube.attrs.get("figure_set"))
    if name in OWN:
        check(cube, path, set(OWN[name]), set())
    else:
        check(cube, path, set(KEYS), {variable for variable, _ in ERRORS.values()})
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
