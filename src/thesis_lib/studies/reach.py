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


def folders() -> list[Path]:
    """Where modules of the project are: the library, its tests with their scenes, benchmarks."""
    root = shipped()
    return [library().parent, root / "tests", root]


def file_of(module: str) -> Path:
    """The file of a module of the library, or of another that can be imported.

    Raises
    ------
    ModuleNotFoundError
        If there is none.
    """
    found = _file(module)
    if found is None:
        spec = find_spec(module)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(module)
        found = Path(spec.origin)
    return found


def reached(file: Path) -> dict[Path, int]:
    """All files of this project that a Python file rests on, itself included.

    A name that is imported through a package's ``__init__`` counts as the module that defines it.
    Imports inside functions count, too; what is only named in a string does not.

    Parameters
    ----------
    file : pathlib.Path
        A module, a test, a script or a notebook of the project.

    Returns
    -------
    dict
        How many imports away each file is; 0 is the file itself.
    """
    found, todo = {file: 0}, [file]
    for one in todo:
        for other in imported(one) - found.keys():
            found[other] = found[one] + 1
            todo.append(other)
    return found


def digest(file: Path) -> str:
    """The first 16 digits of a file's SHA-256."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def imported(file: Path) -> frozenset[Path]:
    """The files of this project that a Python file itself imports from."""
    found = {_defining(module, name) for module, name, _ in _imports(file)}
    return frozenset(found - {None, file})  # type: ignore[arg-type]


def _imports(file: Path) -> tuple[tuple[str, str, str], ...]:
    """Module, name in it and name here of every import of a file; names may be empty."""
    now = file.stat()
    return _imports_of(file, (now.st_ino, now.st_size, now.st_mtime_ns, now.st_ctime_ns))


@cache
def _imports_of(file: Path, _as_it_is: tuple[int, ...]) -> tuple[tuple[str, str, str], ...]:
    found = []
    for node in _statements(ast.parse(_source(file)).body):
        if isinstance(node, ast.Import):
            found += [(alias.name, "", alias.asname or alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
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


def _source(file: Path) -> bytes:
    """The Python of a module or, of a notebook, of its cells of code."""
    if file.suffix != ".ipynb":
        return file.read_bytes()
    cells = json.loads(file.read_bytes())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    return "\n".join(code).encode()


def _statements(nodes: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """All statements, those inside others included."""
    for node in nodes:
        yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from _statements(getattr(node, part, ()))


def _defining(module: str, name: str) -> Path | None:
    """The file where a name of a module is defined; None if that is not of this project."""
    if os.sep in module:
        places = (Path(module, f"{name}.py"), Path(f"{module}.py"))
        return next((one for one in places if one.is_file()), None)
    file = _file(f"{module}.{name}") or _file(module)
    if file and file.name == "__init__.py" and name:
        for source, inner, here in _imports(file):
            if here == name and (through := _defining(source, inner)):
                return through
    return file


def _file(module: str) -> Path | None:
    """The file of a module by its name, if it is one of this project's."""
    own = module.partition(".")[0] == library().name
    for folder in folders()[:1] if own else folders()[1:]:
        if found := _below(folder, module):
            return found
    return None


@cache
def _below(folder: Path, module: str) -> Path | None:
    place = folder.joinpath(*module.rstrip(".").split("."))
    files = (place.with_name(f"{place.name}.py"), place / "__init__.py")
    return next((file for file in files if file.is_file()), None)
