"""The schema of cubes: declared variables, shared coordinates, attributes.

Each folder whose modules write results declares their variables in ``variables.toml``.
"""

import datetime
import importlib.metadata
import json
import platform
import subprocess
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib import __version__, files
from thesis_lib.acoustics.planes import Plane
from thesis_lib.arrays import Array, IntArray, NDArray, stack_padded
from thesis_lib.facts import setups
from thesis_lib.facts.setups import Setting
from thesis_lib.studies import cubes, effort, fields, request
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.structure import Structure

VARIABLES_FILE = "variables.toml"


@dataclass(frozen=True)
class Variable:
    """Meaning and unit of a variable's values."""

    dims: tuple[str, ...]
    units: str  #: "1" if it has none; "name" for names, which get no unit in a file
    long_name: str

    @property
    def attributes(self) -> dict[str, str]:
        """Return the attributes of the variable in a file."""
        units = {} if self.units == "name" else {"units": self.units}
        return units | {"long_name": self.long_name}


def read_variables(module_file: str, table: str) -> dict[str, Variable]:
    """Return the variables that ``variables.toml`` in a module's folder declares in one table.

    Examples
    --------
    >>> read_variables(__file__, "cameras")["camera_distance"]
    Variable(dims=('setting', 'camera'), units='m', long_name='camera distance')
    """
    text = Path(module_file).with_name(VARIABLES_FILE).read_text(encoding="utf-8")
    return {
        name: Variable(tuple(filter(None, dims.split(", "))), units, words)
        for name, (dims, units, words) in tomllib.loads(text)[table].items()
    }


def label_values(
    values: Mapping[str, Any], table: Mapping[str, Variable], over: Iterable[str] = ()
) -> dict[str, tuple[tuple[str, ...], Any, Any]]:
    """Return the values as variables of a dataset, whose dimensions begin with those of `over`."""
    return {
        name: ((*over, *table[name].dims), np.asarray(each), table[name].attributes)
        for name, each in values.items()
    }


def split_complex(name: str, values: NDArray[np.inexact]) -> dict[str, NDArray[np.inexact]]:
    """Return the two variables as which complex values are stored."""
    return {f"{name}_real": values.real, f"{name}_imag": values.imag}


def list_quantities(rows: Iterable[tuple[str, float, str]]) -> dict[str, Any]:
    """Return the variables quantity, value and unit from rows of (name, value, unit)."""
    return dict(zip(("quantity", "value", "unit"), zip(*rows, strict=True), strict=True))


# The outline of a structure, and the cells of its markers.


def structure_extent(cube: xr.Dataset) -> tuple[float, float]:
    """Return the length and width of a cube's structure in m."""
    about = cube["outline"].attrs
    return float(about["length"]), float(about["width"])


def structure_contours(cube: xr.Dataset) -> list[Array]:
    """Return closed curves (corners, 2) in m: the outline, then holes the other way."""
    rows = cube["outline"].values
    ends = np.flatnonzero(np.isnan(rows[:, 0]))
    return [part[~np.isnan(part[:, 0])] for part in np.split(rows, ends)[:-1]]


def marker_cells(cube: xr.Dataset) -> tuple[Array, Array, IntArray]:
    """Return a plate's marker columns x and rows y in m, and each marker's cell, x fastest."""
    if (grid := cube["outline"].attrs.get("grid")) is not None:
        x, y = (
            (np.arange(count) + 0.5) * size / count
            for count, size in zip(grid, structure_extent(cube), strict=True)
        )
    else:
        x, y = (np.unique(np.round(cube[axis].values, 9)) for axis in ("x", "y"))
    column, row = (
        np.argmin(np.abs(cube[name].values[:, None] - axis), axis=1)
        for name, axis in (("x", x), ("y", y))
    )
    return x, y, row * len(x) + column


def fill_cells(values: Array, place: IntArray, count: int) -> Array:
    """Place markers' values (..., markers) in cells (..., count); NaN in empty cells."""
    filled = np.full((*values.shape[:-1], count), np.nan)
    filled[..., place] = values
    return filled


# Variables and coordinates that many cubes have.

VARIABLES = read_variables(__file__, "camera_study")
"""Variables of a camera study; each also has the dimension ``setting``."""
FIELD_COORDINATES = read_variables(__file__, "fields")
SHORT_TYPES = {"measured_deflection": "float32"}
"""Types on disk other than float64, for variables whose rounding does not matter."""
CAMERA_VARIABLES = read_variables(__file__, "cameras")
REFERENCE_VARIABLE = read_variables(__file__, "reference")
SETTING_COORDINATES = read_variables(__file__, "settings")
DESCRIBING_COORDINATES = read_variables(__file__, "descriptions")


def extreme_settings(plate_cube: xr.Dataset) -> dict[str, list[tuple[int, int]]]:
    """Return settings with the lowest and highest typical error, by case and mode."""
    error = cubes.typical_error(plate_cube["mean_error"])
    low, high = (np.where(np.isnan(error), beyond, error) for beyond in (np.inf, -np.inf))
    result: dict[str, list[tuple[int, int]]] = {}
    for case in dict.fromkeys(plate_cube["case"].values.tolist()):
        rows = np.flatnonzero(plate_cube["case"].values == case)
        result[case] = [
            (int(rows[np.argmin(low[rows, m])]), int(rows[np.argmax(high[rows, m])]))
            for m in range(error.shape[1])
        ]
    return result


def field_coordinates(planes: tuple[Plane, ...], cases: list[str]) -> dict[str, Any]:
    """Return the coordinates of fields on planes, and of the extreme settings of each case."""
    values = cases, [plane.name for plane in planes], ["best", "worst"], planes[0].u, planes[0].z
    return label_values(dict(zip(FIELD_COORDINATES, values, strict=True)), FIELD_COORDINATES)


def label_settings(
    settings: list[Setting], results: Sequence[Mapping[str, Any]], table: Mapping[str, Variable]
) -> dict[str, Any]:
    """Label the results of settings in the order of a table, and the camera positions."""
    values = {
        name: np.array([one[name] for one in results]).astype(SHORT_TYPES.get(name, "float64"))
        for name in table
    }
    return label_values(values, table, over=["setting"]) | camera_places(settings)


def camera_places(settings: list[Setting]) -> dict[str, Any]:
    """Return the distance, azimuth and elevation of each setting's cameras, NaN-padded."""
    rows = ([(one.distance_mm / 1000, *d) for d in one.directions_deg] for one in settings)
    table = np.moveaxis(stack_padded(rows), -1, 0)
    return label_values(dict(zip(CAMERA_VARIABLES, table, strict=True)), CAMERA_VARIABLES)


def study_coordinates(
    study: request.Study, modes: Sequence[int], structure: Structure, settings: list[Setting]
) -> dict[str, Any]:
    """Return the coordinates of a study's cube: settings, modes, trials, points."""
    x, y = structure.markers
    hertz = structure.angular_frequencies(max(modes)) / (2 * np.pi)
    values = {
        "case": [one.case for one in settings],
        "parameter": [study.varied_parameters.get(one.case, study.varied) for one in settings],
        "value": [float(one.value) for one in settings],
        "label": [one.label for one in settings],
        "n_cameras": [len(one.directions_deg) for one in settings],
        "width_px": [one.resolution_px[0] for one in settings],
        "height_px": [one.resolution_px[1] for one in settings],
        "pair_order": [one.pair_order for one in settings],
        "mode": modes,
        "frequency": hertz[np.array(modes) - 1],
        "trial": range(study.trials + 1),
        "x": x,
        "y": y,
    }
    coords = label_values(values, SETTING_COORDINATES)
    unit = fields.unit_of_field(study.varied)
    coords["value"][2]["units"] = {"mm": "mm", "°": "degree", "Hz": "Hz"}.get(unit, "1")
    if len(set(values["parameter"])) > 1:
        coords["value"][2]["long_name"] += ", in the unit that the variable parameter names"
    return coords


# Attributes: description and provenance of a cube.

THESIS_TITLE = "thesis on flexural vibration measurement with multiple cameras"
RUN_DEPENDENT = ("commit", "created", "run_time_s", "peak_memory_mb")


def describe_commit() -> str:
    """Describe the checkout's commit, with a plus sign if it has changes; `unknown` elsewhere."""
    try:  # without a checkout, git would report a repository around the package
        command = ["git", "-C", str(files.project_root()), "describe", "--always", "--abbrev=12"]
        command += ["--dirty=+", "--exclude=*"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=10)
    except (files.NoCloneError, OSError, subprocess.TimeoutExpired):
        return "unknown"
    return done.stdout.strip() or "unknown"


def with_provenance(
    cube: xr.Dataset, study: request.Study, seconds: float, library: str = ""
) -> xr.Dataset:
    """Return the cube with attributes on its content and provenance.

    `commit`, `created`, `run_time_s` and `peak_memory_mb` differ from run to run; all else is a
    function of the parameters, the library and the versions of the packages it computes with.
    `library` is the digest of the code that computed the cube, by default of the whole library.
    """
    cube = describe_study(cube, study).assign_attrs(
        title=study.title,
        **({"references": f"{THESIS_TITLE}, {study.section}"} if study.section else {}),
        figure_set=study.name,
        parameters=json.dumps(study.request),
        parameters_hash=study.digest,
        seed=np.int64(study.seed),
        run_dependent=" ".join(RUN_DEPENDENT),
        run_time_s=np.float64(seconds),
        peak_memory_mb=np.float64(effort.peak_memory_mb()),
        library_sha256=library or files.library_digest(),
    )
    return with_origin(cube, f"simulation by thesis_lib {__version__}, figure set {study.name}")


def describe_study(cube: xr.Dataset, study: request.Study) -> xr.Dataset:
    """Add the description of a study and its settings: titles, figure numbers, outline.

    The outline is closed curves (corner, xy) in world X and Y in m, a row of NaN after each: that
    of the structure, then holes the other way. Its attributes are the kind of structure, its size
    and, for a panel, the grid of cells in which its markers are.
    """
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
    structure = study.structure
    half = np.array(structure.extent) / 2
    about = {
        "structure": type(structure).__name__.lower(),
        "length": np.float64(structure.extent[0]),
        "width": np.float64(structure.extent[1]),
    }
    if isinstance(structure, Panel):
        curves = [curve - half for curve in structure.contours]
        about["grid"] = np.array(structure.grid)
    else:
        curves = [half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]]
    rows = [np.insert(curve, len(curve), np.nan, axis=0) for curve in curves]
    values = titles, numbers, np.concatenate(rows)
    named = dict(zip(DESCRIBING_COORDINATES, values, strict=True))
    coords = label_values(named, DESCRIBING_COORDINATES)
    coords["outline"][2].update(about)
    return cube.assign_coords(coords)


def with_origin(data: xr.Dataset, source: str) -> xr.Dataset:
    """Return the data with attributes on their origin and the package versions."""
    packages = ("numpy", "xarray", "h5netcdf", "h5py")
    versions = {name: importlib.metadata.version(name) for name in packages}
    return data.assign_attrs(
        Conventions="CF-1.11",
        source=source,
        versions=json.dumps({"python": platform.python_version(), **versions}),
        commit=describe_commit().ljust(16),  # fixed length: later bytes stay in place
        created=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    )
