"""What code a file of this project rests on: followed from import to import, never run."""

from __future__ import annotations

import ast
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from thesis_lib.files import shipped


def library() -> Path:
    """The folder of the library."""
    return Path(__file__).parents[1]


def folders() -> tuple[Path, ...]:
    """Where modules of the project are: the library, its tests with their scenes, benchmarks."""
    root = shipped()
    return library().parent, root / "tests", root


def file_of(module: str) -> Path:
    """The file of a module of the library, or of another that can be imported.

    Raises
    ------
    ModuleNotFoundError
        If there is none.
    """
    found = _file(module, folders())
    if found is None:
        spec = find_spec(module)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(module)
        found = Path(spec.origin)
    return found


def reached(*files: Path) -> dict[Path, int]:
    """All files of this project that some Python files rest on, and how many imports away each is.

    The files themselves, modules, tests, scripts or notebooks, are 0 away. A name that is imported
    through a package's ``__init__`` counts as the module that defines it. Imports inside functions
    count, too; what is only named in a string does not.
    """
    found, todo, places = dict.fromkeys(files, 0), [*files], folders()
    packages = tuple(map(_as_it_is, _packages()))
    for one in todo:
        for other in _imported(one, places, packages, _as_it_is(one)) - found.keys():
            found[other] = found[one] + 1
            todo.append(other)
    return found


def digest(file: Path) -> str:
    """The first 16 digits of a file's SHA-256."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def imports(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """Return all imports of a Python file, those inside functions included."""
    every = statements([ast.parse(path.read_text(encoding="utf-8"))])
    return [node for node in every if isinstance(node, ast.Import | ast.ImportFrom)]


def statements(nodes: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """All statements, those inside others included."""
    for node in nodes:
        yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            inside = getattr(node, part, ())
            yield from statements(inside if isinstance(inside, list) else ())


@cache
def _packages() -> tuple[Path, ...]:
    """The files of the library that may pass names on."""
    return tuple(sorted(library().rglob("__init__.py")))


@cache
def _imported(
    file: Path, places: tuple[Path, ...], _packages: object, _as_it_is: object
) -> frozenset[Path]:
    """The files in some places that a Python file itself imports from, while packages are so."""
    found = (_defining(module, name, places) for module, name, _ in _imports(file))
    return frozenset(one for one in found if one) - {file}


def _imports(file: Path) -> tuple[tuple[str, str, str], ...]:
    """Module, name in it and name here of every import of a file; names may be empty."""
    return _imports_of(file, _as_it_is(file))


def _as_it_is(file: Path) -> tuple[int, ...]:
    now = file.stat()
    return now.st_ino, now.st_size, now.st_mtime_ns, now.st_ctime_ns


@cache
def _imports_of(file: Path, _as_it_is: tuple[int, ...]) -> tuple[tuple[str, str, str], ...]:
    found = []
    for node in imports(file) if file.suffix == ".py" else _of_notebook(file):
        if isinstance(node, ast.Import):
            found += [(alias.name, "", alias.asname or alias.name) for alias in node.names]
        else:
            module = node.module or ""
            if node.level:
                folder = file.parents[node.level - 1]
                home = next((one for one in folders() if file.is_relative_to(one)), None)
                if home is None:  # a reader's own folder
                    found += [
                        (str(folder / module.replace(".", os.sep)), alias.name, "")
                        for alias in node.names
                    ]
                    continue
                module = ".".join([*folder.relative_to(home).parts, *filter(None, [module])])
            found += [(module, alias.name, alias.asname or alias.name) for alias in node.names]
    return tuple(found)


def _of_notebook(file: Path) -> list[ast.Import | ast.ImportFrom]:
    """The imports in a notebook's cells of code."""
    cells = json.loads(file.read_bytes())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    every = statements(ast.parse("\n".join(code)).body)
    return [node for node in every if isinstance(node, ast.Import | ast.ImportFrom)]


def _defining(module: str, name: str, places: tuple[Path, ...]) -> Path | None:
    """The file where a name of a module is defined; None if that is not of this project."""
    if os.sep in module:
        files = (Path(module, f"{name}.py"), Path(f"{module}.py"))
        return next((one for one in files if one.is_file()), None)
    file = _file(f"{module}.{name}", places) or _file(module, places)
    if file and file.name == "__init__.py" and name:
        for source, inner, here in _imports(file):
            if here == name and (through := _defining(source, inner, places)):
                return through
    return file


@cache
def _file(module: str, places: tuple[Path, ...]) -> Path | None:
    """The file of a module by its name, if it is one of this project's."""
    own = module.partition(".")[0] == library().name
    for folder in places[:1] if own else places[1:]:
        place = folder.joinpath(*module.rstrip(".").split("."))
        for file in (place.with_name(f"{place.name}.py"), place / "__init__.py"):
            if file.is_file():
                return file
    return None
