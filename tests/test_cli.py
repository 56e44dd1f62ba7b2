"""The ``thesis`` command as people call it: from another folder.

What runs notebooks does so in a process of its own; what is listed, compared or refused is asked in
this one, and once by the command.
"""

import csv
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from command import Done, refusal, thesis
from lxml.html import document_fromstring

from thesis_lib.cli import RENAMED_COMMANDS
from thesis_lib.figure_sets.registry import CHAPTER_SETS, STUDIES, validate_request
from thesis_lib.planning.request import PlanRequest
from thesis_lib.studies import effort

RUN = ["run", "beam-distance", "-p", "trials=3", "-p", "distances_mm=[500,800]"]
KINDS = ("ipynb", "nc", "html")


def refused(cwd, *arguments):
    """The one line of a refused request, which writes nothing."""
    before = sorted(cwd.rglob("*"))
    line = refusal(thesis(*arguments, cwd=cwd))
    assert sorted(cwd.rglob("*")) == before
    return line


def as_json(*arguments):
    """What a command prints as JSON; nothing in it is not a number."""
    done = thesis(*arguments, "--json")
    assert (done.status, done.err) == (0, "")
    return json.loads(done.out, parse_constant=pytest.fail)


def parsed(page):
    return document_fromstring(page.read_text(encoding="utf-8"))


def files(folder):
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


# Help.


@pytest.mark.parametrize(("old", "new"), RENAMED_COMMANDS.items())
def test_old_names_of_commands_work_and_are_reported(old, new):
    done, now = thesis(old, "--help"), thesis(new, "--help")
    assert (done.status, done.err) == (0, f"thesis: `thesis {old}` is now `thesis {new}`\n")
    assert done.out.partition("\n")[2] == now.out.partition("\n")[2]


@pytest.mark.skipif(sys.platform == "win32", reason="keeps folders that are in use")
def test_a_deleted_working_directory_is_named(tmp_path):
    line = f"mkdir gone && cd gone && rmdir ../gone && {sys.executable} -m thesis_lib list"
    done = subprocess.run(["sh", "-c", line], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "the working directory has been deleted" in done.stderr


# What is listed.


def test_list_names_sets_and_chapters():
    done = thesis("list")
    assert (done.status, done.err) == (0, "")
    costs = effort.read_efforts()
    for name, model in STUDIES.items():
        line = next(line for line in done.out.splitlines() if line.startswith(name))
        if name in costs:
            assert re.search(rf" {costs[name].time} +{costs[name].memory} ", line)
        number = len(model().settings())
        assert not number or re.search(rf"^{name} +{number} ", line)
        assert line.endswith(model.title)
    for chapter, names in CHAPTER_SETS.items():
        line = next(line for line in done.out.splitlines() if line.startswith(f"{chapter} "))
        assert all(name in line for name in names)


def test_json_lists_sets_and_parameters():
    assert {row["figure_set"]: row["title"] for row in as_json("list")} == {
        name: model.title for name, model in STUDIES.items()
    }
    for row in as_json("list", "ch3"):
        defaults = STUDIES[row["figure_set"]]().model_dump(mode="json")
        assert {one["name"]: one["default"] for one in row["parameters"]} == defaults
    defaults = PlanRequest().model_dump(mode="json")
    assert {one["name"]: one["default"] for one in as_json("plan", "--parameters")} == defaults


# The ledger.


def test_claims_without_results_are_refused_at_once(checkout, tmp_path):
    done = checkout.thesis("claims", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "thesis: claims: there is no result yet, allowed: after `thesis book`\n"


@pytest.mark.slow
def test_claims_as_json_has_every_claim_once():
    entries = as_json("claims")
    ids = [entry["id"] for entry in entries]
    assert len(set(ids)) == len(ids) > 400
    assert {entry["kind"] for entry in entries} == {"figure", "trend", "number"}
    assert all(entry["note"] for entry in entries if entry["verdict"] == "undefined")


# What is refused.


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "beam-aperture2"], ["did you mean beam-aperture?", "`thesis list`"]),
        (["run", "beam-distance", "nosuch", "-p", "layouts={}"], ["nosuch: no such figure set"]),
        (["run"], ["NAME...", "`thesis list` names"]),
        (["run", "beam-distance", "-p", "trials"], ["-p", "'trials'", "KEY=VALUE"]),
        (["run", "beam-distance", "-p", "trials=1", "-p", "trials=1"], ["'trials'", "twice"]),
        (["run", "beam-distance", "-p", "cube=a.nc"], ["cube", "--out"]),
        (["run", "ch3", "-p", "azimut_deg=1"], ["no parameter azimut_deg", "mean azimuth_deg?"]),
        (["run", "ch3", "-p", "widths_px=[1]"], ["beam-resolution: widths_px[0]: given 1", "px"]),
        (["run", "beam-distance", "-p", f"trials={'9' * 5000}"], ["trials: given", "whole"]),
        (["run", "claims", "-p", 'readings=["51 mm lens"]'], ["51 mm lens", "rest known"]),
        (["plan", "--out", "x" * 300], ["--out", "xxx"]),
        (["run", "beam-distance", "--out", f"{__file__}/below"], ["--out", "allowed: a folder"]),
        (["compare", "x\ny.nc"], ["y.nc"]),
        (["compare", ""], ["A.nc", "it is empty"]),
        (["run", ""], ['"": no such figure set']),
        (["new-set", ""], ['given ""', "small letters"]),
        (["new-set", "./none"], ["./none is taken", "allowed: another name"]),
        (["new-set", "./figure-set"], ["./figure-set is taken", "allowed: another name"]),
        (["measure"], ["given none", "one of MANIFEST.yaml"]),
        (["measure", "--new", "a", "--out", "b"], ["--out is given", "with MANIFEST.yaml"]),
        (["measure", "--new", "a", "--check"], ["--check is given", "with MANIFEST.yaml"]),
        (["measure", "--example", "a", "--json"], ["--json is given", "with MANIFEST.yaml"]),
        (["plan", "--parameters", "-p", "trials=1"], ["-p is given beside --parameters"]),
        (["plan", "--parameters", "--out", "a"], ["--out is given beside --parameters"]),
        (["print", "board", "b.pdf", "--tile-mm", "nan"], ["--tile-mm", "nan is no number"]),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, list) else None,
)
def test_wrong_request_is_one_line_and_writes_nothing(tmp_path, arguments, words):
    if arguments[0] == "run" and "--out" not in arguments:
        arguments = [*arguments, "--out", "out"]
    message = refused(tmp_path, *arguments)
    assert message.startswith("thesis: ")
    for word in words:
        assert word in message


def test_the_command_refuses_in_the_same_words(checkout, tmp_path):
    wrong = ["run", "beam-distance", "-p", "rest=known\nrebuilt", "--out", "out"]
    done = checkout.thesis(*wrong, cwd=tmp_path)
    assert r"rest: given" in done.stderr
    assert r"known\nrebuilt" in done.stderr
    assert list(tmp_path.iterdir()) == []
    assert Done(done.returncode, done.stdout, done.stderr) == thesis(*wrong, cwd=tmp_path)


# A run.


@pytest.fixture(scope="module")
def ran(checkout, tmp_path_factory):
    """Folder and report of a small run."""
    cwd = tmp_path_factory.mktemp("small")
    done = checkout.thesis(*RUN, "--out", "out", cwd=cwd)
    assert done.returncode == 0, done.stderr
    return cwd / "out", done


def test_run_writes_notebook_cube_and_page_and_tells_errors_beside_those_published(ran):
    folder, done = ran
    assert files(folder) == sorted(f"beam-distance.{kind}" for kind in KINDS)
    assert not list(folder.glob(".staging-*"))
    assert f"Open {folder / 'beam-distance.html'}" in done.stdout
    assert "beam-distance: done in" in done.stderr
    row = re.compile(r"^ +1 +(\d+) mm +(\d) +(mean|peak) \|.*\| +(\S+)( \S+)?$", re.MULTILINE)
    found = [(*one[:3], one[3] != "—") for one in row.findall(done.stdout)]
    assert found == [
        (distance, mode, error, distance == "500")
        for error in ("mean", "peak")
        for distance in ("500", "800")
        for mode in "123"
    ]


@pytest.mark.nightly
def test_another_run_takes_the_place_of_the_first_and_its_json_has_the_errors_of_the_cube(
    ran, checkout, tmp_path
):
    folder = shutil.copytree(ran[0], tmp_path / "out")
    done = checkout.thesis(*RUN, "-p", "seed=1", "--out", folder, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (run,) = json.loads(done.stdout, parse_constant=pytest.fail)
    request = {"trials": 3, "distances_mm": [500, 800], "seed": 1}
    assert run["parameters"] == validate_request("beam-distance", request).request
    assert (run["figure_set"], run["page"]) == ("beam-distance", str(folder / "beam-distance.html"))
    with xr.open_dataset(folder / "beam-distance.nc") as cube:
        assert cube.attrs["seed"] == 1
        nominal = cube["mean_error"].isel(trial=0).values.ravel()
    rows = [row for row in run["results"] if row["error"] == "mean_error"]
    np.testing.assert_allclose([row["trial_0"] for row in rows], nominal)
    assert [row["median_old"] is None for row in rows] == [False] * 3 + [True] * 3


def test_page_is_self_contained(ran):
    page = parsed(ran[0] / "beam-distance.html")
    loaded = page.xpath("//@src | //@srcset | //@poster | //@action | //*[not(self::a)]/@href")
    assert loaded
    assert all(address.startswith(("data:", "#")) for address in loaded)
    styles = "".join(page.xpath("//style/text()"))
    assert not re.search(r"url\(\s*['\"]?(?!data:|#)|@import", styles)
    assert "800 mm" in page.text_content()
    assert "Parameters of this run" in page.text_content()


def test_nothing_tells_where_it_was_made(ran, checkout):
    folder = ran[0]
    for kind in KINDS:
        content = (folder / f"beam-distance.{kind}").read_bytes()
        for place in (folder.parent, checkout.root, checkout.root.parent, Path.home()):
            assert str(place).encode() not in content, kind
        assert b".staging-" not in content, kind


@pytest.mark.nightly
def test_chapter_makes_four_pages_and_an_index(checkout, tmp_path):
    chapter = ["run", "ch3", "-p", "trials=2", "-p", "focal_length_mm=35", "--out", "out"]
    done = checkout.thesis(*chapter, cwd=tmp_path, timeout=280)
    assert done.returncode == 0, done.stderr
    names = CHAPTER_SETS["ch3"]
    assert files(tmp_path / "out") == sorted(
        [*(f"{name}.{kind}" for name in names for kind in KINDS), "index.html"]
    )
    index = parsed(tmp_path / "out" / "index.html")
    assert index.xpath("//a/@href") == [f"{name}.html" for name in names]
    assert all(STUDIES[name].title in index.text_content() for name in names)
    assert done.stderr.count("done in") == 4
    for name in names:
        with xr.open_dataset(tmp_path / "out" / f"{name}.nc") as cube:
            assert json.loads(cube.attrs["parameters"])["focal_length_mm"] == 35


@pytest.mark.slow
def test_failing_cell_is_told_with_what_where_and_how_to_go_on(own_checkout, tmp_path):
    def breaks(document):
        viewer = next(cell for cell in document.cells if cell.id == "beam-distance-04")
        viewer.source = "raise RuntimeError('the lamp went out')"

    own_checkout.change("beam-distance", breaks)
    done = own_checkout.thesis(*RUN, "--out", "out", cwd=tmp_path)
    assert done.returncode == 1
    message = done.stderr.splitlines()[-1]
    failed = r"thesis: beam-distance: cell \d+ failed with RuntimeError: the lamp went out"
    assert re.match(f"{failed}.*run the same command again", message)
    log = own_checkout.root / "build" / "logs" / "beam-distance.txt"
    assert str(log) in message
    assert "the lamp went out" in log.read_text(encoding="utf-8")
    assert "\x1b" not in log.read_text(encoding="utf-8")
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert not (tmp_path / "out").exists()


# A plan.

PLAN = ["plan", "-p", "starts=0", "-p", "step_deg=30", "-p", "counts=[2]", "-p", "trials=2"]


def test_plan_as_json_has_the_cameras_of_its_table(tmp_path):
    done = thesis(*PLAN, "-p", "target_percent=40", "--out", "out", "--json", cwd=tmp_path)
    assert done.status == 0, done.err
    made = json.loads(done.out, parse_constant=pytest.fail)
    table = list(csv.DictReader((tmp_path / "out" / "plan.csv").open(encoding="utf-8")))
    assert [{name: float(value) for name, value in row.items()} for row in table] == made["cameras"]
    assert [row["mode"] for row in made["errors"]] == [1, 2, 3]
    assert all(0 < row["predicted_error"] <= 40 for row in made["errors"])
    assert made["page"] == str(tmp_path / "out" / "plan.html")


# Two cubes.


def test_cube_compared_with_the_published_run(ran):
    done = thesis("compare", ran[0] / "beam-distance.nc")
    assert (done.status, done.err) == (0, "")
    told, _, rest = done.out.partition("not compared, since only errors are published: ")
    assert re.findall(r"^ +1 +(\d+) mm +(\d) +(mean|peak) \|", told, re.MULTILINE) == [
        ("500", mode, error) for error in ("mean", "peak") for mode in "123"
    ]
    assert "camera_azimuth" in rest


def test_compare_shows_what_differs(ran, tmp_path):
    cube = ran[0] / "beam-distance.nc"
    with xr.open_dataset(cube) as opened:
        other = opened.load()
    error = other["mean_error"].astype(float).values
    error[1, 2, :] += 5
    other = other.assign(mean_error=(other["mean_error"].dims, error))
    other.to_netcdf(tmp_path / "other.nc")
    assert thesis("compare", cube, cube).out.startswith("no difference from beam-distance.nc")
    done = thesis("compare", tmp_path / "other.nc", cube)
    assert (done.status, done.err) == (0, "")
    line = next(line for line in done.out.splitlines() if "+5.0" in line)
    assert line.split()[:4] == ["1", "800", "mm", "3"]
    assert " mean | " in line
    assert done.out.count("+5.0") == 1


def test_compare_refuses_what_is_not_a_cube(ran, tmp_path):
    cube = ran[0] / "beam-distance.nc"
    (tmp_path / "text.nc").write_text("not netCDF at all")
    for name in ("text.nc", "missing.nc"):
        assert f"{name}: " in refused(tmp_path, "compare", name)
    assert "text.nc: " in refused(tmp_path, "compare", cube, "text.nc")
    assert "A.nc" in refused(tmp_path, "compare")
