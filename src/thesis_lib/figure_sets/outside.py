"""Figure sets of a reader's own: a folder with its modules and notebooks, anywhere.

The folder is what one beside this file is (:mod:`thesis_lib.figure_sets.figure_set`), with the
notebook ``NAME.ipynb`` of each of its sets. Kernels find it by the environment variable
:data:`SETS_VARIABLE`.
"""

from __future__ import annotations

import hashlib
import os
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

from thesis_lib.figure_sets.registry import CHAPTER_SETS, FIGURE_SETS, STUDIES
from thesis_lib.studies.request import ParameterError, validate_values
from thesis_lib.text import one_line

SETS_VARIABLE = "THESIS_FIGURE_SETS"
_LOADED_FOLDERS: dict[str, Path] = {}  # of the sets that were loaded, by name


def load_sets(folder: Path) -> list[str]:
    """Make the figure sets of a folder known, in this process and in the kernels it starts.

    Raises
    ------
    ParameterError
        In one line: the file, and what is wrong with it.
    """
    folder = folder.resolve()
    if there := [name for name, place in _LOADED_FOLDERS.items() if place == folder]:
        return there
    file = folder / "figure_set.py"
    if not file.is_file():
        wanted = "a list FIGURE_SETS of what the folder holds"
        raise ParameterError(f"{file} is missing; wanted: {wanted}")
    package = ModuleType(f"figure_set_{hashlib.sha256(str(folder).encode()).hexdigest()[:10]}")
    package.__path__ = [str(folder)]
    sys.modules[package.__name__] = package
    try:
        found = {
            one.request.name: one
            for one in import_module(f"{package.__name__}.figure_set").FIGURE_SETS
        }
        for one in found.values():
            fields = one.request.model_fields.items()
            validate_values(
                one.request, {n: f.get_default(call_default_factory=True) for n, f in fields}
            )
    except Exception as error:  # whatever a reader's module does
        why = f"{type(error).__name__}: {one_line(str(error))}"
        raise ParameterError(f"{file} cannot be used: {why}") from None
    for name in found:
        if name in FIGURE_SETS or name in CHAPTER_SETS:
            raise ParameterError(f"{file}: the name {one_line(name)} is taken; wanted: another")
        if not (folder / f"{name}.ipynb").is_file():
            raise ParameterError(
                f"{folder / name}.ipynb is missing; wanted: the notebook of {name}"
            )
    for name, one in found.items():
        FIGURE_SETS[name], STUDIES[name], _LOADED_FOLDERS[name] = one, one.request, folder
        one.request.folder = str(folder)
    named = os.environ.get(SETS_VARIABLE, "").split(os.pathsep)
    os.environ[SETS_VARIABLE] = os.pathsep.join(dict.fromkeys([*filter(None, named), str(folder)]))
    return list(found)


def is_known(name: str, here: bool = False) -> bool:
    """Return whether there is a figure set of this name, or in a folder of :data:`SETS_VARIABLE`.

    With `here`, in the working directory, too: for a notebook, whose code is executed anyway. No
    command executes code that merely lies where it is called.
    """
    if name not in FIGURE_SETS:
        named = os.environ.get(SETS_VARIABLE, "").split(os.pathsep)
        named += [os.curdir] * (here and Path("figure_set.py").is_file())
        for folder in filter(None, named):
            load_sets(Path(folder))
    return name in FIGURE_SETS


def outside_notebook(name: str) -> Path | None:
    """Return the notebook of a set that was loaded from a folder; None of the book's own."""
    return _LOADED_FOLDERS[name] / f"{name}.ipynb" if name in _LOADED_FOLDERS else None
