"""The cube of a request: computed, kept, and read from a file.

What is kept is computed once, and found by digests of all that made it: folders of code, facts,
recordings, and the lock. A folder counts as a whole. What a figure set does not share with all
others, it names in its :attr:`~thesis_lib.figure_sets.figure_set.FigureSet.rooms`.

A file is read only if it is what its own request asks for, no more and no less.
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
        Workers that compute what can be cut into pieces
        (:func:`thesis_lib.studies.workers.check_address`); empty computes here.
    """
    figure_set = registry.FIGURE_SETS[asked.name]
    library, compute = code_digest(figure_set), partial(figure_set.compute, asked, scheduler)
    if figure_set.kept:  # under a name that tells what determines the cube
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
    """Return the files of code and facts that can change a cube, and the lock."""
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
    """Return the digest that a cube carries of the code, facts and packages that made it.

    It is that of the files when this process first asked, as what it has imported is, too.
    """
    own = files.digest_of(source_files(figure_set))
    return hashlib.sha256(f"{own} {storage.package_versions()}".encode()).hexdigest()


def request_key(asked: Study) -> str:
    """Return the digest of all that determines the cube of a request, others' included."""
    figure_set = registry.FIGURE_SETS[asked.name]
    needed = [*map(request_key, figure_set.reads()), files.digest_of(figure_set.stored(asked))]
    text = json.dumps([asked.name, asked.digest, code_digest(figure_set), *needed])
    return hashlib.sha256(text.encode()).hexdigest()


def read_cube(path: Path) -> xr.Dataset:
    """Open one of our cubes.

    Raises
    ------
    CubeError
        In one line: the file, and what is wrong with it.
    """
    cube = rename_variables(storage.open_netcdf(path))
    listed = cubes.list_dimension(cube)
    needed = set(cubes.LISTED_VARIABLES[listed] if listed else cubes.ROW_KEYS)
    errors = {variable for variable, _ in cubes.ERROR_VARIABLES.values()} & set(cube.data_vars)
    lacks = {"figure_set", "parameters", "parameters_hash"} - set(cube.attrs)
    lacks |= needed - set(map(str, cube.variables))
    if not (listed or errors):
        lacks.add("errors")
    if lacks:
        raise _refusal(path, f"it lacks {', '.join(sorted(lacks))}")
    request = _request(cube, path)
    try:
        found = _list_problems(cube, listed) if listed else _problems(cube, request, errors)
        problem = next(found, "")
    except (TypeError, ValueError, IndexError, KeyError, OverflowError) as error:
        problem = f"its values are of another kind: {one_line(str(error))}"
    if problem:
        raise _refusal(path, problem)
    return cube


def rename_variables(cube: xr.Dataset) -> xr.Dataset:
    """Return a cube with today's names of variables and dimensions, if it is of version 0."""
    if "thesis_lib 0." not in str(cube.attrs.get("source", "")):
        return cube
    table = files.shipped() / "data" / "published" / "renamed-variables.json"
    renamed = json.loads(table.read_text(encoding="utf-8"))
    names = {*map(str, cube.variables), *map(str, cube.dims)}
    return cube.rename({old: new for old, new in renamed.items() if old in names})


def read_built(study: Study) -> xr.Dataset | str:
    """Return the cube of the last ``thesis book``, or in one line why there is none to judge by."""
    return read_usable(files.workplace() / "data" / "results" / f"{study.name}.nc", study)


def read_usable(path: Path, study: Study) -> xr.Dataset | str:
    """Return a cube of this study by this library, or in one line why the file is not that."""
    try:
        cube = read_cube(path)
    except cubes.CubeError:
        state = "is not readable" if path.exists() else "is missing"
        return f"cube {path.name} {state}: run `thesis book`"
    if cube.attrs["figure_set"] != study.name:
        return f"cube {path.name} is of {cube.attrs['figure_set']}: run `thesis book`"
    if cube.attrs.get("parameters_hash") != study.digest:
        return f"cube {path.name} was run with other parameters: run `thesis book`"
    if cube.attrs.get("library_sha256") != code_digest(registry.FIGURE_SETS[study.name]):
        return f"cube {path.name} is outdated, the library has changed since: run `thesis book`"
    return cube


def _refusal(path: Path, problem: str) -> cubes.CubeError:
    return cubes.CubeError(f"{path}: not a cube of this project ({problem})")


def _request(cube: xr.Dataset, path: Path) -> Study:
    """Return the request that a cube was computed for."""
    name, given = str(cube.attrs["figure_set"]), str(cube.attrs["parameters"])
    if not registry.is_known(name):
        trusted = (
            f"if you trust its code, name its folder: {registry.SETS_VARIABLE}=FOLDER thesis …"
        )
        raise _refusal(path, f"its figure set {one_line(name)} is not known; {trusted}")
    try:
        values = json.loads(given)
        request = registry.validate_request(name, values)
        text = json.dumps([name, values])
    except (ParameterError, ValueError, AttributeError, RecursionError) as error:
        why = str(error) if isinstance(error, ParameterError) else one_line(given)
        raise _refusal(path, f"its parameters are none: {why}") from None
    if hashlib.sha256(text.encode()).hexdigest()[:10] != str(cube.attrs["parameters_hash"]):
        raise _refusal(path, "its parameters are not those of its parameters_hash")
    return request


def _problems(cube: xr.Dataset, request: Study, errors: set[str]) -> Iterator[str]:
    """Yield the faults of a cube of errors, one after another."""
    for dim in ("setting", "mode", "trial"):
        if not cube.sizes.get(dim):
            yield f"it has no {dim}"
    for name in cubes.ROW_KEYS:
        if cube[name].dims != (("mode" if name == "mode" else "setting"),):
            yield f"its {name} is not along its dimension"
    found = list(zip(*(cube[name].values.tolist() for name in cubes.SETTING_KEYS), strict=True))
    asked = [(s.case, float(s.value), s.label, s.pair_order) for s in request.settings()]
    yield from _not_asked("setting", found, asked)
    modes = cube["mode"].values.tolist()
    yield from _not_asked("mode", modes, getattr(request, "modes", modes))
    if cube.sizes["trial"] > request.trials + 1:
        yield f"it has {cube.sizes['trial']} trials, of {request.trials + 1} asked for"
    for name in errors:
        dims = {"setting", "mode", "trial"} | ({"plane"} & set(cube[name].dims))
        if set(cube[name].dims) != dims or cube[name].dtype.kind != "f":
            yield f"its {name} is not a number for each setting, mode and trial"
    if "plane" in cube.dims and set(cube["plane"].values.tolist()) != {"XZ", "YZ"}:
        yield "its planes are not XZ and YZ"
    if registry.FIGURE_SETS[request.name].in_pieces and "point" in cube.dims:
        for axis, own in zip(("x", "y"), request.structure.markers, strict=True):
            given = cube[axis].values if axis in cube else np.array([])
            shaped = given.shape == own.shape and given.dtype.kind == "f"
            if not shaped or not np.all(np.abs(given - own) < 1e-9):  # m
                yield "its points are not the markers of its structure"


def _not_asked(what: str, found: list[Any], asked: list[Any]) -> Iterator[str]:
    """Yield variables and coordinates of a cube that are doubled or not part of its request."""
    if len(set(found)) < len(found):
        yield f"it has a {what} twice"
    other = [one for one in found if one not in asked]
    if other or any(type(one) is float for one in found if what == "mode"):
        yield f"its {what} {one_line(repr((other or found)[0]))} is none of its parameters"


def _list_problems(cube: xr.Dataset, first: str) -> Iterator[str]:
    """List problems of a cube of results by name: each once, and all of one length."""
    needed = sorted(cubes.LISTED_VARIABLES[first])
    for name in needed:
        if cube[name].dims != (first,):
            yield f"its {name} is not along {first}"
    if len(set(cube[first].values.tolist())) < cube.sizes[first]:
        yield f"it has a {first} twice"
    if "value" in needed and cube["value"].dtype.kind not in "fiu":
        yield "its value is no number"
