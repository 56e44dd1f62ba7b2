"""Figures have the same bytes, whoever draws beside them and whatever is configured."""

import hashlib
import os
import subprocess
import sys
import threading

import matplotlib
import pytest

from conftest import PROJECT
from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.display import as_svg
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.plotting import style

LAYOUTS = {"$\\frac$": [[[20, 30], [-20, 30]]], "a$b$_c^d\\": [[[20, 30], [-20, 30]]]}


@pytest.fixture(scope="module")
def cube():
    return cube_of(camera_study("beam-distance", {"trials": 2, "modes": [1]}))


def drawn(cube):
    return as_svg(cube, "1", 1)


@pytest.mark.slow
def test_threads_at_once_and_what_others_set_change_no_drawing(cube):
    alone, found = drawn(cube), []
    before = dict(matplotlib.rcParams)

    def draw():
        found.append(drawn(cube))

    def other():
        for size in (5, 30):
            with style.in_style({"font.size": size, "axes.titlelocation": "center"}):
                style.figure_svg(style.subplots()[0])

    threads = [threading.Thread(target=work) for work in (draw, other, draw, other)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [alone] * 2
    with pytest.raises(KeyError), style.in_style({"font.size": 30}):
        raise KeyError
    assert dict(matplotlib.rcParams) == before
    with matplotlib.rc_context({"font.size": 30, "axes.titlelocation": "center"}):
        assert drawn(cube) == alone
        assert matplotlib.rcParams["font.size"] == 30


def test_dollars_in_a_name_are_drawn_as_they_are():
    given = {"trials": 1, "modes": [1], "cases": [], "layouts": LAYOUTS}
    cube = cube_of(camera_study("beam-arrays", given))
    for name in LAYOUTS:
        assert as_svg(cube, name, 1).startswith("<?xml")


FOREIGN = {
    "in the working directory": ("work/matplotlibrc", "font.size: 30\nlines.linewidth: 9\n", {}),
    "in the home": (
        "home/.config/matplotlib/matplotlibrc", "text.usetex: True\nsvg.fonttype: path\n", {}
    ),
    "broken": ("work/matplotlibrc", "no such thing: 1\nfont.size\n", {}),
    "a style by environment": ("work/my.rc", "axes.grid: False\n", {"MATPLOTLIBRC": "my.rc"}),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("kind", FOREIGN)
def test_foreign_configuration_changes_no_byte(cube, tmp_path, kind):
    file, text, environment = FOREIGN[kind]
    path, work = tmp_path / file, tmp_path / "work"
    work.mkdir()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    code = (
        "import hashlib; from thesis_lib.figure_sets.display import as_svg;"
        "from thesis_lib.figure_sets.cube_file import cube_of;"
        "from thesis_lib.figure_sets.parametric.figure_set import camera_study;"
        "cube = cube_of(camera_study('beam-distance', {'trials': 2, 'modes': [1]}));"
        "print(hashlib.sha256(as_svg(cube, '1', 1).encode()).hexdigest())"
    )
    home = {"HOME": str(tmp_path / "home"), "PYTHONPATH": str(PROJECT / "src")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=work, env={**os.environ, **home, **environment},
        capture_output=True, text=True, timeout=100, check=True,
    )  # fmt: skip
    assert done.stdout.strip() == hashlib.sha256(drawn(cube).encode()).hexdigest()
