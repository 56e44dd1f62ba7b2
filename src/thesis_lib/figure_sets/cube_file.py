"""Computation, cache and files of the cube of a request.

A cached cube is found by a digest of all its inputs: folders of code (each as a whole), facts,
recordings, and the lock file. A figure set lists the folders that not all figure sets depend on in
its :attr:`~thesis_lib.figure_sets.figure_set.FigureSet.rooms`.

A file is accepted only if it holds exactly what its own request asks for.
"""

import hashlib
import json
import time
from collections.abc import Iterator
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib import files
from thesis_lib.facts.setups import data_folder
from thesis_lib.figure_sets import registry
from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.studies import cubes, schema, storage
from thesis_lib.studies.request import ParameterError, Study
from thesis_lib.text import one_line


def cube_of(asked: Study, scheduler: str = "") -> xr.Dataset:
    """Return the cube of a figure set.

    Parameters
    ----------
    asked : Study
        A validated request.
    scheduler : str
        Address of workers for figure sets that are computed in blocks
        (:func:`thesis_lib.studies.workers.check_address`); empty: compute in this process.
    """
    figure_set = registry.FIGURE_SETS[asked.name]
    library, compute = code_digest(figure_set), partial(figure_set.compute, asked, scheduler)
    if figure_set.kept:  # under a name with the digest of all inputs of the cube
        name = f"{asked.name}-{request_key(asked)[:16]}.nc"
        result = storage.load_or_compute(files.cache_folder() / name, compute)
        seconds = float(result.attrs.pop("run_time_s"))
    else:
        begun = time.perf_counter()
        result = compute()
        seconds = time.perf_counter() - begun
    return schema.with_provenance(result, asked, seconds, library)


PACKAGE_FOLDER = Path(__file__).parents[1]
SCIENCE_ROOMS = ("acoustics", "arrays.py", "facts", "studies", "vibration", "vision")
FACT_FILES = ("assumptions.toml", "setups.toml", "structures.toml")
LOCK_FILE = Path("requirements", "book.txt")


def source_files(figure_set: FigureSet) -> list[Path]:
    """Return the files of code and facts that can change a cube, and the lock file."""
    own = Path(import_module(figure_set.package).__path__[0])
    rooms = [PACKAGE_FOLDER / room for room in (*SCIENCE_ROOMS, *figure_set.rooms)]
    facts = sorted(data_folder().iterdir())
    if "ledger" not in figure_set.rooms:
        facts = [one for one in facts if one.name in FACT_FILES]
    code = [
        path
        for path in files.folder_files([*rooms, own])
        if path.suffix == ".py" or path.name == schema.VARIABLES_FILE
    ]
    return [*code, *facts, files.shipped() / LOCK_FILE]


@cache
def code_digest(figure_set: FigureSet) -> str:
    """Return the digest of code, facts and packages that is stored in a cube.

    It is computed once per process, whose imported code does not change either.
    """
    own = files.digest_of(source_files(figure_set))
    return hashlib.sha256(f"{own} {storage.package_versions()}".encode()).hexdigest()


def request_key(asked: Any) -> str:
    """Return the digest of all inputs of a request's cube, including cubes of other requests."""
    figure_set = registry.FIGURE_SETS[asked.name]
    stored = [asked.recordings.stored_path] if figure_set.rendered else []
    needed = [*map(request_key, figure_set.reads()), files.digest_of(stored)]
    text = json.dumps([asked.name, asked.digest, code_digest(figure_set), *needed])
    return hashlib.sha256(text.encode()).hexdigest()


def read_cube(path: Path) -> xr.Dataset:
    """Open and validate a cube of this project.

    Raises
    ------
    CubeError
        In one line: the file, and what is wrong with it.
    """
    cube = rename_variables(storage.open_netcdf(path))
    if command := _other_command(cube):
        why = f"a result of `thesis {command}`; compare takes those of `thesis run`"
        raise cubes.CubeError(f"{path}: {why}")
    try:
        problem = next(_problems(cube), "")
    except (TypeError, ValueError, IndexError, KeyError, OverflowError) as error:
        problem = f"its values are of another kind: {one_line(str(error))}"
    if problem:
        raise cubes.CubeError(f"{path}: not a cube of this project ({problem})")
    return cube


def _other_command(cube: xr.Dataset) -> str:
    """Return the command whose result this is, if it is another than run."""
    if str(cube.attrs.get("source", "")).startswith("measurement by thesis_lib"):
        return "measure"
    return "plan" if cube.attrs.get("figure_set") == "plan" else ""


def rename_variables(cube: xr.Dataset) -> xr.Dataset:
    """Rename the variables and dimensions of a cube of version 0 to the current names."""
    if "thesis_lib 0." not in str(cube.attrs.get("source", "")):
        return cube
    table = files.shipped() / "data" / "published" / "renamed-variables.json"
    renamed = json.loads(table.read_text(encoding="utf-8"))
    names = {*map(str, cube.variables), *map(str, cube.dims)}
    return cube.rename({old: new for old, new in renamed.items() if old in names})


def read_built(study: Study) -> xr.Dataset | str:
    """Return the cube of the last ``thesis book``, or one line on why it cannot be used."""
    return read_usable(files.workplace() / "data" / "results" / f"{study.name}.nc", study)


def read_usable(path: Path, study: Study) -> xr.Dataset | str:
    """Return the cube in a file, or one line on why it cannot be used for this study."""
    try:
        cube = read_cube(path)
    except cubes.CubeError:
        state = "is not readable" if path.exists() else "is missing"
    else:
        of = (cube.attrs.get(key) for key in ("figure_set", "parameters_hash", "library_sha256"))
        if tuple(of) == (study.name, study.digest, code_digest(registry.FIGURE_SETS[study.name])):
            return cube
        state = "is outdated: the library or its parameters were others"
    return f"cube {path.name} {state}: run `thesis book`"


def _problems(cube: xr.Dataset) -> Iterator[str]:
    """Yield the faults of a cube; after the first one, the next checks may raise an error."""
    listed, present = cubes.list_dimension(cube), set(map(str, cube.variables))
    errors = sorted({name for name, _ in cubes.ERROR_VARIABLES.values()} & present)
    if listed:
        dims = dict.fromkeys(cubes.LISTED_VARIABLES[listed], (listed,))
    else:
        dims = dict.fromkeys(cubes.SETTING_KEYS, ("setting",)) | {"mode": ("mode",)}
    lacks = {"figure_set", "parameters", "parameters_hash"} - set(cube.attrs)
    lacks |= {*dims, *(() if listed or errors else ["errors"])} - present
    if lacks:
        yield f"it lacks {', '.join(sorted(lacks))}"
    name, given = str(cube.attrs["figure_set"]), str(cube.attrs["parameters"])
    if not registry.is_known(name):
        trusted = f"name its folder: {registry.SETS_VARIABLE}=FOLDER thesis …"
        yield f"its figure set {one_line(name)} is not known; if you trust its code, {trusted}"
    try:
        values = json.loads(given)
        request = registry.validate_request(name, values)
        key = hashlib.sha256(json.dumps([name, values]).encode()).hexdigest()[:10]
    except (ParameterError, ValueError, AttributeError, RecursionError) as error:
        why = str(error) if isinstance(error, ParameterError) else one_line(given)
        yield f"its parameters are none: {why}"
    if key != str(cube.attrs["parameters_hash"]):
        yield "its parameters are not those of its parameters_hash"
    for variable, along in dims.items():
        if cube[variable].dims != along or not cube[variable].size:
            yield f"its {variable} is not along {along[0]}, or empty"
    rows = [cube[variable].values.tolist() for variable in dims if dims[variable] != ("mode",)]
    found = rows[0] if listed else list(zip(*rows, strict=True))
    modes = cube["mode"].values.tolist() if not listed else []
    if any(len(set(values)) < len(values) for values in (found, modes)):
        yield f"it has a {listed or 'setting or mode'} twice"
    if "value" in dims and cube["value"].dtype.kind not in "fiu":
        yield "its value is no number"
    if listed:
        return
    asked = [(s.case, float(s.value), s.label, s.pair_order) for s in request.settings()]
    if other := [row for row in found if row not in asked]:
        yield f"its setting {one_line(repr(other[0]))} is none of its parameters"
    if cube["mode"].dtype.kind not in "iu" or set(modes) - set(getattr(request, "modes", modes)):
        yield f"its modes {one_line(repr(modes))} are none of its parameters"
    for variable in errors:
        values, known = cube[variable], {"setting", "mode", "trial"}
        if set(values.dims) - {"plane"} != known or values.dtype.kind != "f" or not values.size:
            yield f"its {variable} is not a number for each setting, mode and trial"
    cubes.cube_errors(cube)  # raises an error if a plane is missing
    if cube.sizes["trial"] > request.trials + 1:
        yield f"it has {cube.sizes['trial']} trials, of {request.trials + 1} asked for"
    marked = registry.FIGURE_SETS[name].in_pieces and "point" in cube.dims
    if marked and not np.allclose([cube["x"], cube["y"]], request.structure.markers, 0, 1e-9):  # m
        yield "its points are not the markers of its structure"
