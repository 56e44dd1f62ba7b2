"""The notebooks: what they carry, and that nbval and papermill hold them to it."""

import re
import shutil

import nbformat
import pytest
import xarray as xr
from nbval.plugin import get_sanitize_patterns
from notebook_pages import build_figures_cell, display_figures

from conftest import PROJECT, until_study
from thesis_lib.figure_sets.display import list_captions
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES, validate_request
from thesis_lib.notebook import show as notebook
from thesis_lib.notebook.show import cube_of
from thesis_lib.runs import postprocess
from thesis_lib.studies.request import ParameterError

MARK = "# NBVAL_CHECK_OUTPUT"
LAYOUT = {"m*y": [[[60, 30], [-60, 30]]]}


def cells(path):
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]


def committed(name):
    return cells(PROJECT / "notebooks" / f"{name}.ipynb")


def texts(cell):
    found = []
    for output in cell.outputs:
        found += [output.text] if "text" in output else list(output.get("data", {}).values())
    return found


# What is committed.


@pytest.mark.parametrize("name", STUDIES)
def test_committed_notebooks_are_plain_counted_and_have_numbers_to_check(name):
    document = nbformat.read(PROJECT / "notebooks" / f"{name}.ipynb", as_version=4)
    nbformat.validate(document)
    assert not {"widgets", "papermill"} & set(document.metadata)
    every = committed(name)
    for cell in every:
        for output in cell.outputs:
            assert output.output_type in {"stream", "display_data", "execute_result"}
            assert output.get("execution_count") in {None, cell.execution_count}
            assert all(kind.startswith("text/") for kind in output.get("data", {}))
        if "nbval-ignore-output" in cell.metadata.get("tags", []):
            assert cell.outputs == []
        for text in texts(cell):
            assert str(PROJECT) not in text
            assert "Traceback" not in text
    counts = [cell.execution_count for cell in every]
    assert counts == list(range(1, len(counts) + 1))  # nbval compares nothing that has no count
    marked = [cell for cell in every if MARK in cell.source.splitlines()]
    for cell in marked:  # where all stated values are met there is a count alone
        assert any(re.search(r"\d", text) for text in texts(cell)), cell.id
        assert all(sanitised(text) == text for text in texts(cell))  # every number counts
    assert sum(bool(re.search(r"\d+\.\d", "".join(texts(cell)))) for cell in marked) >= 2
    cut = {"remove-input", "remove_input", "remove-cell", "remove_cell"}
    hidden = [cell.id for cell in every if cut & set(cell.metadata.get("tags", []))]
    assert hidden in ([], [f"{name}-live"])


# What may differ.


def sanitised(text):
    rules = (PROJECT / "tests" / "nbval_sanitize.cfg").read_text(encoding="utf-8")
    for pattern, replacement in get_sanitize_patterns(rules):
        text = re.sub(pattern, replacement, text)
    return text


def told(cell):
    """What nbval compares of a cell: all that it printed, and the text of its results."""
    printed = "".join(output.text for output in cell.outputs if "text" in output)
    kinds = [sorted(output.get("data", {}).items()) for output in cell.outputs]
    shown = [text for each in kinds for kind, text in each if kind.startswith("text/")]
    return [sanitised(text) for text in (printed, *shown)]


@pytest.mark.book
@pytest.mark.parametrize("name", STUDIES)
def test_executed_for_the_book_it_told_what_is_committed(name):
    """As nbval finds, which executes it once more: two in `make test`, all of them at night."""
    executed = {cell.id: cell for cell in cells(PROJECT / "book" / "executed" / f"{name}.ipynb")}
    for cell in committed(name):
        if "nbval-ignore-output" not in cell.metadata.get("tags", []):
            assert told(executed[cell.id]) == told(cell), cell.id


# Steps.


SEEN = [{}, {"rest": "known"}, {"estimator": "interval", "noise_px": 0.1}, {"azimuth_zero": "X"},
        {"amplitude_mm": "force"}, {"trials": 0}]  # fmt: skip
OTHERWISE = {
    "beam-distance": SEEN,
    "plate-distance": [{"estimator": "analytic-centre"}, {"principal_offset_px": 0.2}],
    "sound-distance": [{}, {"modes": [4]}, {"modes": [1], "speed_of_sound_m_s": 1500.0}],
    "experiment-resolution": [{"cases": ["literal"], "widths_px": [1280]},
                              {"cases": ["aligned"]}, {"cases": ["harmonic"], "trials": 0}],
    "cameras": [{"distances_mm": [900.123456789, 600]}, {"f_numbers": [22], "circle_mm": 0.3}],
}  # fmt: skip
CHEAP = {
    "sound-distance": {"distances_mm": [650], "plane_shape": [15, 10]},
    "experiment-resolution": {"widths_px": [640]},
}


@pytest.mark.slow
@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("name", "values"),
    [(name, values) for name, every in OTHERWISE.items() for values in every],
    ids=str,
)
def test_the_steps_are_the_first_row_of_the_cube_whatever_is_asked(name, values, capsys):
    namespace = {}
    for cell in committed(name):
        if "result" in namespace and "-step-" not in cell.id:
            break
        exec(compile(cell.source, cell.id, "exec"), namespace)  # the cube's asserts it
        if "parameters" in cell.metadata.get("tags", []):
            namespace.update({"trials": 5, **CHEAP.get(name, {}), **values})
    assert namespace["asked"].name == namespace["result"].attrs.get("figure_set", name) == name
    told = capsys.readouterr().out
    assert re.search(r"\d\.\d", told)
    if name.endswith("-distance"):
        assert "mean error" in told
        assert len(namespace["errors"]) == namespace["asked"].trials + 1


# Captions.


@pytest.mark.parametrize("name", STUDIES)
def test_captions_come_from_the_data(name):
    document = nbformat.read(PROJECT / "notebooks" / f"{name}.ipynb", as_version=4)
    assert not any(set(cell.metadata) - {"tags"} for cell in document.cells)
    found = [one for cell in document.cells for one in list_captions(STUDIES[name](), cell.source)]
    assert len({one.name for one in found}) == len({one.text for one in found}) == len(found) > 0
    shown = [c for c in document.cells if re.search(r"\.(figures|picture)\(", c.source)]
    for cell in shown:
        assert list(list_captions(STUDIES[name](), cell.source)), cell.source
        assert cell.metadata.tags == ["hide-input", "nbval-ignore-output"]
    for one in found:
        assert "{" not in one.name + one.text + one.alt
        assert one.alt or FIGURE_SETS[name].figure  # of which the panels tell


@pytest.mark.slow
def test_each_figure_gets_a_cell_with_its_words():
    request = validate_request("beam-arrays", {"trials": 1, "cases": ["4a'"], "layouts": LAYOUT})
    cell = build_figures_cell(display_figures(cube_of(request).sel(mode=[1, 3])))
    for output in cell.outputs:
        assert 'alt="Panels: (a) setups: cameras varied; (b) ' in output.data["text/html"]
    page = nbformat.v4.new_notebook(cells=[cell])
    postprocess.place_figures(page)
    nbformat.validate(page)
    words = [cell.metadata.mystnb.figure for cell in page.cells]
    assert [one.name for one in words] == [
        "fig-3-25", "fig-3-27", "fig-beam-arrays-m-y-mode-1", "fig-beam-arrays-m-y-mode-3"
    ]  # fmt: skip
    title = "beside the beam, wide to narrow"
    assert words[0].caption == f"Figure 3.25 of the thesis. Case 4a′, mode 1: {title}."
    assert words[2].caption == "Case m&#42;y, mode 1."
    for cell in page.cells:
        assert cell.source.strip()  # or a book leaves it out
        assert [list(output.data) for output in cell.outputs] == [["image/svg+xml"]]
        assert "law of rounding" in cell.metadata.mystnb.image.alt


def test_a_figure_of_another_lens_says_that_it_is_the_thesiss_only_in_kind():
    given = {"trials": 1, "modes": [1], "focal_length_mm": 35}
    (figure,) = display_figures(cube_of(validate_request("beam-distance", given)))
    words = "With the parameters of this run, after: Figure 3.4 of the thesis. Case 1, mode 1: "
    assert figure.about["caption"].startswith(words)


# papermill without the command.


@pytest.mark.nightly
def test_one_changed_digit_fails(own_checkout):
    """Of the first cells of a notebook that nbval executes one fails, and all others pass."""
    shutil.copytree(PROJECT / "tests", own_checkout.root / "tests")
    shutil.copy(PROJECT / "conftest.py", own_checkout.root)
    document = nbformat.read(PROJECT / "notebooks" / "beam-distance.ipynb", as_version=4)
    marked = next(cell for cell in document.cells if cell.id == "beam-distance-06")
    assert MARK in marked.source.splitlines()
    document.cells = document.cells[: document.cells.index(marked) + 1]
    data = marked.outputs[0].data
    before = data["text/markdown"]
    found = re.search(r"\d+\.(\d) ·", before)
    digit = str((int(found[1]) + 1) % 10)
    data["text/markdown"] = before[: found.start(1)] + digit + before[found.end(1) :]
    folder = own_checkout.root / "doctored"
    folder.mkdir()
    nbformat.write(document, folder / "changed.ipynb")
    words = ["-m", "pytest", "--nbval", "-p", "no:cacheprovider", "-p", "no:xdist", folder]
    done = own_checkout.python(*words, cwd=folder, timeout=200)
    others = len(cells(folder / "changed.ipynb")) - 1
    assert f"1 failed, {others} passed" in done.stdout, done.stdout


def test_a_value_given_to_papermill_is_refused_like_the_commands():
    injected = {"In": ["# Parameters\nelevation_deg = 91\n"], "elevation_deg": 91}
    with pytest.raises(ParameterError, match="beam-distance: elevation_deg: given 91, allowed: "):
        notebook.checked("beam-distance", injected)
    given = '{"4b": "printed", "4b": "reversed"}'
    injected = {"In": [f"# Parameters\npair_order = {given!r}\n"], "pair_order": given}
    with pytest.raises(ParameterError, match="beam-arrays: pair_order: '4b' is given twice"):
        notebook.checked("beam-arrays", injected)


@pytest.mark.slow
def test_papermill_reads_a_list_as_json_and_writes_the_cube_into_the_project(checkout, tmp_path):
    checkout.change("beam-distance", until_study)
    given = ["-p", "cube", "made/out.nc", "-p", "trials", "2", "-p", "distances_mm", "[600]"]
    words = ["-m", "papermill", checkout.notebook("beam-distance"), tmp_path / "out.ipynb"]
    done = checkout.python(*words, *given, "--no-progress-bar", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["out.ipynb"]
    with xr.open_dataset(checkout.root / "made" / "out.nc") as cube:
        assert cube["value"].values.tolist() == [600]
        assert cube.sizes["trial"] == 3
