"""The wheel without the project: what a reader has who installs it in a project of their own."""

import os
import signal
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from command import hears_signals
from scenes import own

from conftest import PARTS, PROJECT
from thesis_lib import files
from thesis_lib.facts import setups
from thesis_lib.figure_sets.cube_file import code_digest
from thesis_lib.figure_sets.record import experiments
from thesis_lib.figure_sets.registry import FIGURE_SETS, validate_request
from thesis_lib.studies import storage
from thesis_lib.vibration.motion import Component

pytestmark = pytest.mark.slow  # installs a wheel, and runs it
NAME, VALUES = "beam-distance", {"trials": 3, "modes": [1]}
PARAMETERS = [part for key, value in VALUES.items() for part in ("-p", f"{key}={value}")]
GUARD = """
import sys

def refuse(event, given):
    if event == "open" and str(given[0]).startswith({project}):
        raise RuntimeError(f"{{given[0]}} is of the project")

sys.addaudithook(refuse)
"""
EVERYTHING = """
import pkgutil, sys
import thesis_lib
from thesis_lib import files
from thesis_lib.figure_sets.record import experiments

for module in pkgutil.walk_packages(thesis_lib.__path__, "thesis_lib."):
    if not module.name.endswith("__main__"):
        __import__(module.name)
stored = [n for n, (one, request) in experiments().items() if one.stored(request) is not None]
print(files.library_digest(), *stored)
print(*{m.__file__ for n, m in sys.modules.items() if n.startswith("thesis_lib")})
"""


class Reader:
    """A folder under git with an environment that has the wheel, and packages of this one."""

    def __init__(self, root):
        self.root, self.bin = root, root / ".venv" / "bin"
        other = {"PYTHONPATH", "PYTHONHOME"}
        self.environment = {
            k: v for k, v in os.environ.items() if k not in other and "JUPYTER" not in k
        }
        who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
        for command in (["init", "-q"], [*who, "commit", "-qm", "mine", "--allow-empty"]):
            subprocess.run(["git", *command], cwd=root, check=True)
        # Wheels are built, as `pip wheel` does, by the build backend.
        build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", root]
        subprocess.run(build, cwd=PROJECT, check=True, capture_output=True)
        subprocess.run([sys.executable, "-m", "venv", root / ".venv"], check=True)
        (wheel,) = root.glob("*.whl")
        words = ["-m", "pip", "install", "-q", "--no-index", "--no-deps", wheel]
        self.call("python", *words).check_returncode()
        wheel.unlink()
        ours = sysconfig.get_paths(vars={"base": str(root / ".venv")})["purelib"]
        (Path(ours) / "present.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
        (root / ".venv" / "share").mkdir(exist_ok=True)
        (root / ".venv" / "share" / "jupyter").symlink_to(Path(sys.prefix, "share", "jupyter"))
        project = tuple(str(PROJECT / part) for part in PARTS)
        (Path(ours) / "sitecustomize.py").write_text(GUARD.format(project=project))
        self.package = Path(ours) / "thesis_lib"

    def call(self, program, *arguments):
        return subprocess.run(
            [self.bin / program, *map(str, arguments)], cwd=self.root, env=self.environment,
            text=True, capture_output=True, encoding="utf-8", stdin=subprocess.DEVNULL, timeout=600,
        )  # fmt: skip

    def written(self):
        """What there is besides the environment."""
        return sorted({path.name for path in self.root.iterdir()} - {".git", ".venv"})


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    return Reader(tmp_path_factory.mktemp("reader"))


@pytest.fixture(scope="module")
def run(reader):
    done = reader.call("thesis", "run", NAME, *PARAMETERS)
    assert done.returncode == 0, done.stderr
    (folder,) = (reader.root / "runs").iterdir()
    assert f"Open {folder / NAME}.html" in done.stdout
    return folder


def test_the_project_is_out_of_reach_and_all_of_it_is_there(reader):
    done = reader.call("python", "-c", f"open({str(PROJECT / 'pyproject.toml')!r})")
    assert "is of the project" in done.stderr
    done = reader.call("python", "-c", EVERYTHING)
    ours, places = (line.split() for line in done.stdout.splitlines())
    assert ours == [files.library_digest(), *experiments()]
    assert len(places) > 200
    assert all(Path(place).is_relative_to(reader.package) for place in places)


def test_what_needs_a_clone_says_so(reader):
    for name in ("book", "render", "pdf", "claims"):
        done = reader.call("thesis", name)
        assert (done.returncode, done.stdout) == (2, "")
        (line,) = done.stderr.splitlines()
        assert "this needs a clone of the project" in line
    before = reader.written()
    done = reader.call("thesis", "list")
    assert (done.returncode, done.stderr) == (0, "")
    assert NAME in done.stdout
    assert "MB" in done.stdout  # of the published run
    assert reader.written() == before


@pytest.mark.nightly
def test_a_run_is_the_one_of_a_clone(reader, run):
    cube, page = run / f"{NAME}.nc", run / f"{NAME}.html"
    made_by = storage.open_netcdf(cube).attrs
    assert made_by["commit"].strip() == "unknown"  # and not the reader's own
    assert made_by["parameters_hash"] == validate_request(NAME, VALUES).digest
    assert made_by["library_sha256"] == code_digest(FIGURE_SETS[NAME])
    assert files.sha256(cube) in page.read_text(encoding="utf-8")
    assert set(reader.written()) <= {"build", "example", "plan", "runs"}


@pytest.mark.nightly
def test_measurements_need_no_clone(reader):
    part = Component(amplitude=0.003, frequency=6.3)
    rig = own.short_rig(setups.thesis_beam(), [(12, 30), (-150, 35)], part, steady=0.8)
    done = reader.call("thesis", "measure", own.make(reader.root / "example", rig, {}))
    assert done.returncode == 0, done.stderr
    assert (reader.root / "example" / "measured" / "report.html").is_file()


def test_the_example_needs_no_clone(reader):
    """It begins to be rendered, for which no more files are read; all of it is `test_measure`'s."""
    command = [reader.bin / "thesis", "measure", "--example", "rendered"]
    given = {"cwd": reader.root, "env": reader.environment, "stdin": subprocess.DEVNULL}
    with subprocess.Popen(
        command, **given, stdout=-1, stderr=-1, text=True, preexec_fn=hears_signals
    ) as running:
        first = running.stdout.readline()  # of two threads
        assert first.startswith("rendering camera "), running.communicate()
        running.send_signal(signal.SIGINT)
        _, said = running.communicate(timeout=60)
    assert running.returncode == 130, said
    assert not (reader.root / "rendered").exists()
