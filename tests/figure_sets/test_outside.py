"""A figure set of a reader's own, begun by ``thesis new-set``."""

import re
import shutil
import sys

import nbformat
import pytest
import xarray as xr
from command import refusal, thesis

from conftest import PROJECT
from thesis_lib.figure_sets import registry
from thesis_lib.figure_sets.cube_file import code_digest, request_key
from thesis_lib.notebook import show
from thesis_lib.notebook.new_set import write_set
from thesis_lib.studies import storage


@pytest.fixture
def footprint(tmp_path, monkeypatch):
    """The folder that the command makes; nothing of it stays known."""
    monkeypatch.setenv(registry.SETS_VARIABLE, "")
    known = dict(registry.FIGURE_SETS), dict(registry.STUDIES)
    folder, _ = write_set(str(tmp_path / "footprint"), "Footprint of a pixel")
    yield folder
    for now, before in zip((registry.FIGURE_SETS, registry.STUDIES), known, strict=True):
        now.clear()
        now.update(before)
    for name in [name for name in sys.modules if name.startswith("figure_set_")]:
        del sys.modules[name]


def test_a_new_set_is_refused_where_something_of_its_name_is(footprint):
    for name in (footprint, "claims", "ch3", "registry", "./Some Name"):
        assert "allowed: " in refusal(thesis("new-set", name))
    assert sorted(file.suffix for file in footprint.iterdir()) == [".ipynb", *[".py"] * 4, ".toml"]


@pytest.mark.parametrize(
    "title", ["Camera footprint at 1 m", 'A "Footprint of a pixel" in C:\\new']
)
def test_a_title_is_taken_as_it_is_given(tmp_path, title):
    folder, notebook = write_set(str(tmp_path / "spot"), title)
    made = {"__name__": "spot"}
    exec((folder / "figure_set.py").read_text(encoding="utf-8"), made)
    assert (made["Spot"].name, made["Spot"].title) == ("spot", title)
    assert nbformat.read(notebook, as_version=4).cells[0].source.splitlines()[0] == f"# {title}"


@pytest.mark.slow
def test_a_cube_of_it_is_known_where_its_folder_is_named(footprint, tmp_path, monkeypatch):
    assert "focal_length_mm" in thesis("list", footprint).out
    asked = ["run", footprint, "--out", tmp_path / "out"]
    assert thesis(*asked).status == 0
    page = (tmp_path / "out" / "footprint.html").read_text(encoding="utf-8")
    assert "image/svg+xml" in page
    assert f"thesis run {footprint}" in page
    for known in (registry.FIGURE_SETS, registry.STUDIES):
        known.pop("footprint")
    monkeypatch.setenv(registry.SETS_VARIABLE, "")
    monkeypatch.chdir(tmp_path)
    cube = tmp_path / "out" / "footprint.nc"
    said = refusal(thesis("compare", cube))
    assert "its figure set footprint is not known; if you trust its code, name its folder" in said
    said = refusal(thesis("run", "footprint"))
    assert "for the folder here: thesis run ./footprint" in said
    monkeypatch.chdir(footprint)
    refusal(thesis("compare", cube))
    monkeypatch.setenv(registry.SETS_VARIABLE, str(footprint))
    assert thesis("compare", cube).status == 0


def test_compare_executes_nothing_that_lies_beside_a_cube(tmp_path, monkeypatch):
    """As one does with an archive of a cube and a module."""
    attrs = {"figure_set": "footprint", "parameters": "{}", "parameters_hash": "0" * 10}
    storage.write_netcdf(xr.Dataset({"mean_error": ("x", [1.0])}, attrs=attrs), tmp_path / "x.nc")
    (tmp_path / "figure_set.py").write_text("from pathlib import Path; Path('ran').touch()\n")
    monkeypatch.chdir(tmp_path)
    refusal(thesis("compare", "x.nc"))
    refusal(thesis("compare", tmp_path / "x.nc", "x.nc"))
    assert not (tmp_path / "ran").exists()


@pytest.mark.slow
def test_a_failing_cell_is_counted_as_in_the_notebook(footprint, tmp_path):
    file = footprint / "footprint.ipynb"
    document = nbformat.read(file, as_version=4)
    document.metadata.pop("kernelspec")  # nor is a kernel needed
    (drawn,) = [cell for cell in document.cells if '"line"' in cell.source]
    drawn.source = drawn.source.replace('"line"', '"lines"')
    nbformat.write(document, file)
    done = thesis("run", footprint, "--out", tmp_path / "out")
    assert done.status == 1
    assert "footprint: cell 4 failed with AttributeError" in done.err
    assert "has no attribute 'lines'" in done.err


def test_it_is_refused_as_others_are(footprint, tmp_path):
    said = refusal(thesis("run", footprint, "-p", "focal_length_mm=-1", "--out", tmp_path / "out"))
    assert said == ("thesis: footprint: focal_length_mm: given -1, allowed: a number above 0, "
                    "at most 100000, in mm")  # fmt: skip
    assert "did you mean focal_length_mm" in refusal(
        thesis("run", footprint, "-p", "focal_lenght_mm=1", "--out", tmp_path / "out")
    )
    assert not (tmp_path / "out").exists()


def test_it_is_stale_when_what_it_rests_on_changes(footprint):
    (name,) = registry.load_sets(footprint)
    one = registry.FIGURE_SETS[name]
    before = request_key(one.request())
    for file in ("figure_set.py", "compute.py"):
        with (footprint / file).open("a") as stream:
            stream.write("another = 1\n")
        code_digest.cache_clear()
        now = request_key(one.request())
        assert now != before
        before = now


def test_a_notebook_beside_it_finds_it_without_the_command(footprint, monkeypatch):
    monkeypatch.chdir(footprint)
    cube = show.study("footprint", {"distances_mm": [100.0]})
    assert cube["quantity"].values.tolist() == ["pixel at 100 mm"]
    assert "<svg" in show.picture(cube, "line").svg


def rewrite(file, old, new):
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")


BROKEN = {
    "no figure_set.py": (lambda f: (f / "figure_set.py").unlink(), "figure_set.py is missing"),
    "default": (
        lambda f: rewrite(f / "figure_set.py", "= 24.0", "= -24.0"),
        "focal_length_mm: given -24.0"),
    "syntax": (lambda f: (f / "figure_set.py").write_text("def"), "SyntaxError"),
    "name taken": (lambda f: rewrite(f / "figure_set.py", '"footprint"', '"planner"'), "is taken"),
}  # fmt: skip


@pytest.mark.parametrize("how", BROKEN)
def test_what_is_wrong_with_it_is_said_in_one_line_and_nothing_written(footprint, how):
    damage, words = BROKEN[how]
    damage(footprint)
    said = refusal(thesis("run", footprint, "--out", footprint.parent / "out"))
    assert words in said
    assert str(footprint) in said
    assert len(said) <= 400
    assert not (footprint.parent / "out").exists()


@pytest.mark.nightly
def test_in_the_library_it_passes_the_tests_of_all_figure_sets(own_checkout, tmp_path):
    name = "pixel-size"
    assert own_checkout.thesis("new-set", name, cwd=tmp_path).returncode == 0
    publish = (
        "from thesis_lib.figure_sets import cube_file; from pathlib import Path;"
        "from thesis_lib.studies.cubes import publish_errors;"
        f"publish_errors(cube_file.read_cube(Path('out/{name}.nc')))"
    )
    for said in ("nothing is published yet", "no difference from published (3 quantities"):
        done = own_checkout.thesis("run", name, "--out", "out", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert said in done.stdout
        assert own_checkout.python("-c", publish, cwd=tmp_path).returncode == 0
    for part in ("tests", "benchmarks"):
        shutil.copytree(PROJECT / part, own_checkout.root / part)
    contracts = ["tests/figure_sets", "tests/notebook", "-m", "not book and not nightly"]
    asked = ["-m", "pytest", "-q", "-k", name, *contracts]
    done = own_checkout.python(*asked, cwd=own_checkout.root, timeout=400)
    assert done.returncode == 0, done.stdout
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) == 8
