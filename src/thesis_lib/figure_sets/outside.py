"""Figure sets of a reader's own: a folder with its modules and notebooks, anywhere.

The folder is what one beside this file is (:mod:`thesis_lib.figure_sets.figure_set`), with the
notebook ``NAME.ipynb`` of each of its sets. Kernels find it by the environment variable
:data:`ENVIRONMENT`.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

from thesis_lib.figure_sets.figure_set import FigureSet
from thesis_lib.figure_sets.registry import CHAPTERS, FIGURE_SETS, STUDIES
from thesis_lib.studies.fields import suggestion
from thesis_lib.studies.request import ParameterError, Study, validated
from thesis_lib.text import one_line

ENVIRONMENT = "THESIS_FIGURE_SETS"
_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_WORDS = ("title", "subject", "study", "varied", "varied_label")
_PLACES: dict[str, Path] = {}  # of the sets that were loaded, by name


def load(folder: Path) -> list[str]:
    """Make the figure sets of a folder known, in this process and in the kernels it starts.

    Raises
    ------
    ParameterError
        In one line: the file, what is wrong with it, and what is wanted.
    """
    folder = folder.resolve()
    if there := [name for name, place in _PLACES.items() if place == folder]:
        return there
    found = _declared(folder)
    for one in found:
        if problem := next(_problems(one, folder), ""):
            raise ParameterError(problem)
    for one in found:
        name = one.request.name
        FIGURE_SETS[name], STUDIES[name], _PLACES[name] = one, one.request, folder
        one.request.folder = str(folder)
    known = os.environ.get(ENVIRONMENT, "").split(os.pathsep)
    os.environ[ENVIRONMENT] = os.pathsep.join(dict.fromkeys([*filter(None, known), str(folder)]))
    return [one.request.name for one in found]


def is_known(name: str, here: bool = False) -> bool:
    """Return whether there is a figure set of this name, or in a folder of :data:`ENVIRONMENT`.

    With `here`, in the working directory, too: for a notebook, whose code is executed anyway. No
    command executes code that merely lies where it is called.
    """
    if name not in FIGURE_SETS:
        named = os.environ.get(ENVIRONMENT, "").split(os.pathsep)
        named += [os.curdir] * (here and Path("figure_set.py").is_file())
        for folder in filter(None, named):
            load(Path(folder))
    return name in FIGURE_SETS


def notebook(name: str) -> Path | None:
    """Where the notebook of a set is that was loaded from a folder; None of the book's own."""
    return _PLACES[name] / f"{name}.ipynb" if name in _PLACES else None


def notebook_problems(request: type[Study], notebook: Path) -> Iterator[str]:
    """What is wrong with the parameters of a notebook, one after another."""
    try:
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        tagged = [c for c in cells if "parameters" in c["metadata"].get("tags", [])]
        code = ast.parse("".join(tagged[0]["source"])).body if tagged else []
    except FileNotFoundError:
        yield f"{notebook} is missing; wanted: the notebook of {request.name}"
        return
    except (OSError, ValueError, LookupError, TypeError, SyntaxError) as error:
        yield f"{notebook} is no notebook ({type(error).__name__}: {one_line(str(error))})"
        return
    if len(tagged) != 1:
        yield f"{notebook} has {len(tagged)} cells with the tag parameters; wanted: one"
        return
    given = _assigned(code)
    fields = list(request.model_fields)
    for name in given:
        if name not in fields:
            hint = suggestion(name, fields)
            yield f"{notebook} sets {one_line(name)}, which {request.name} does not declare{hint}"
    if lacks := [name for name in fields if name not in given]:
        yield f"{notebook} does not set {', '.join(lacks)}; wanted: all of {request.name}"
    defaults = request()
    for name, value in given.items():
        default = getattr(defaults, name, None)
        if name in fields and not _gives(request, name, value, default):
            text = one_line(ast.unparse(value)) if value else "nothing"
            wanted = f"wanted: {one_line(repr(default))}, as declared"
            yield f"{notebook} gives {name} = {text}; {wanted}"


def _gives(request: type[Study], name: str, value: ast.expr | None, default: object) -> bool:
    """Whether a literal is the default of a parameter."""
    try:
        given = validated(request, {name: ast.literal_eval(value or "")})
    except (ParameterError, ValueError):
        return False
    return bool(getattr(given, name) == default)


def _assigned(code: list[ast.stmt]) -> dict[str, ast.expr | None]:
    """Names and values of the assignments of a cell."""
    found: dict[str, ast.expr | None] = {}
    for line in code:
        if isinstance(line, ast.AnnAssign):
            found[ast.unparse(line.target)] = line.value
        elif isinstance(line, ast.Assign):
            found |= {ast.unparse(target): line.value for target in line.targets}
    return found


def _declared(folder: Path) -> list[FigureSet]:
    """What a folder's module ``figure_set`` declares."""
    file = folder / "figure_set.py"
    if not folder.is_dir():
        raise ParameterError(f"{folder}: no such folder; wanted: one with figure_set.py")
    if not file.is_file():
        raise ParameterError(
            f"{file} is missing; wanted: a list FIGURE_SETS of what the folder holds"
        )
    digest = hashlib.sha256(str(folder).encode()).hexdigest()[:10]
    package = ModuleType(f"figure_set_{digest}")
    package.__path__ = [str(folder)]
    sys.modules[package.__name__] = package
    try:
        module = import_module(f"{package.__name__}.figure_set")
    except ModuleNotFoundError as error:
        own, _, rest = str(error.name).partition(".")
        lacks = folder.joinpath(*rest.split(".")).with_suffix(".py")
        if own != package.__name__:
            raise ParameterError(f"{file} cannot be imported: {one_line(str(error))}") from None
        raise ParameterError(f"{lacks} is missing; {file.name} imports it") from None
    except Exception as error:  # whatever a reader's module does
        raise ParameterError(
            f"{file} cannot be imported: {type(error).__name__}: {one_line(str(error))}"
        ) from None
    found = getattr(module, "FIGURE_SETS", None)
    if (
        not isinstance(found, list)
        or not found
        or not all(isinstance(one, FigureSet) for one in found)
    ):
        raise ParameterError(
            f"{file}: FIGURE_SETS is {one_line(repr(found))}; wanted: a list of FigureSet"
        )
    return found


def _problems(one: FigureSet, folder: Path) -> Iterator[str]:
    """What is wrong with a figure set, one after another."""
    file, name = folder / "figure_set.py", str(getattr(one.request, "name", ""))
    if not _NAME.fullmatch(name):
        yield f"{file}: the name {one_line(name)!r}; wanted: lower-case words joined by hyphens"
    if name in FIGURE_SETS or name in CHAPTERS:
        yield f"{file}: the name {name} is taken; wanted: another"
    if one.chapter and one.chapter not in CHAPTERS:
        known = ", ".join(CHAPTERS)
        yield f"{file}: the chapter {one_line(repr(one.chapter))}; wanted: empty, or of {known}"
    if lacks := [word for word in _WORDS if not hasattr(one.request, word)]:
        yield f"{file}: {one.request.__name__} does not say {', '.join(lacks)}"
    try:
        fields = one.request.model_fields.items()
        validated(one.request, {n: f.get_default(call_default_factory=True) for n, f in fields})
    except ParameterError as error:
        yield f"{file}: of its defaults, {error}"
    modules = {"module": one.module, "figure": one.figure.partition(":")[0]}
    for field, module in modules.items():
        own, _, rest = module.partition(".")
        place = folder.joinpath(*rest.split(".")).with_suffix(".py")
        if own.startswith("figure_set_") and not place.is_file():
            yield f"{place} is missing; wanted: what {field} of {name} names"
    yield from notebook_problems(one.request, folder / f"{name}.ipynb")
