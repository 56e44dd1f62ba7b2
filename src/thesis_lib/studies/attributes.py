"""Attributes of a cube: what it is, and how it was made."""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import platform
import subprocess

import numpy as np
import xarray as xr

from thesis_lib import __version__
from thesis_lib.facts import setups
from thesis_lib.files import NoCloneError, library_digest, project_root
from thesis_lib.studies import effort, outlines
from thesis_lib.studies.request import Study

THESIS = "thesis on flexural vibration measurement with multiple cameras"
RUN_DEPENDENT = ("commit", "created", "run_time_s", "peak_memory_mb")


def _commit() -> str:
    """Commit of the checkout, with a plus sign if it has changes; `unknown` elsewhere."""
    try:  # where there is no checkout, a commit would be of whatever the package lies in
        command = ["git", "-C", str(project_root()), "describe", "--always", "--abbrev=12"]
        done = subprocess.run(
            [*command, "--dirty=+", "--exclude=*"], capture_output=True, text=True, timeout=10
        )
    except (NoCloneError, OSError, subprocess.TimeoutExpired):
        return "unknown"
    return done.stdout.strip() or "unknown"


def with_provenance(
    cube: xr.Dataset, study: Study, seconds: float, library: str = ""
) -> xr.Dataset:
    """The cube with attributes that say what it is and how it was made.

    `commit`, `created`, `run_time_s` and `peak_memory_mb` differ from run to run; all else is a
    function of the parameters, the library and the versions of the packages it computes with.
    `library` is the digest of the code that the cube rests on; without it the whole library counts.
    """
    cube = described(cube, study).assign_attrs(
        title=study.title,
        **({"references": f"{THESIS}, {study.section}"} if study.section else {}),
        figure_set=study.name,
        parameters=json.dumps(study.request),
        parameters_hash=study.digest,
        seed=np.int64(study.seed),
        run_dependent=" ".join(RUN_DEPENDENT),
        run_time_s=np.float64(seconds),
        peak_memory_mb=np.float64(effort.peak_memory_mb()),
        library_sha256=library or library_digest(),
    )
    return with_origin(cube, f"simulation by thesis_lib {__version__}, figure set {study.name}")


def described(cube: xr.Dataset, study: Study) -> xr.Dataset:
    """The cube with words of its study, and of settings: titles, numbers in the thesis, outline."""
    cube = cube.assign_attrs(
        varied=study.varied,
        varied_label=study.varied_label,
        trial_0=study.first,
        predicts=study.predicted_by,
        draws=cube.attrs.get("draws", study.draws),
        in_the_thesis=np.int8(study.is_of_the_thesis),
    )
    if "case" not in cube.coords or cube["case"].dims != ("setting",) or "mode" not in cube.coords:
        return cube
    kind = study.subject, study.study
    cases, modes = cube["case"].values.tolist(), cube["mode"].values.tolist()
    titles = [setups.case_title(*kind, case) for case in cases]
    numbers = [[setups.figure_number(*kind, case, mode) for mode in modes] for case in cases]
    words = {"long_name": "description of the case", "units": "1"}
    figure = {
        "long_name": "number of the figure in the thesis, if there is one",
        "units": "1",
    }
    return cube.assign_coords(
        case_title=("setting", titles, words),
        thesis_figure=(("setting", "mode"), np.array(numbers), figure),
        outline=outlines.outline(study.structure),
    )


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
