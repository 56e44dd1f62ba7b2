"""The controls at the end of a live notebook: what they allow, tell, run and give back."""

import ipywidgets
import nbformat
import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell

from conftest import PROJECT
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric.figures import error_table
from thesis_lib.figure_sets.registry import STUDIES, validate_request
from thesis_lib.notebook import controls as live, show as notebook
from thesis_lib.studies import cubes
from thesis_lib.studies.request import study_command

LIVE = [name for name in STUDIES if name != "claims"]


def committed(name):
    return nbformat.read(PROJECT / "notebooks" / f"{name}.ipynb", as_version=4)


@pytest.fixture(autouse=True)
def shell():
    """Displays are formatted by the shell of the notebook."""
    yield InteractiveShell.instance()
    InteractiveShell.clear_instance()


# The controls.


@pytest.mark.parametrize(
    ("name", "given"),
    [
        *((name, {"trials": 7, "seed": 2**60}) for name in LIVE),
        ("beam-distance", {"elevation_deg": 0.2}),  # next to bounds
        ("experiment-resolution", {"azimuth_deg": 89.8, "amplitude_mm": 0.004}),
    ],
)
def test_controls_begin_with_the_request_and_give_it_back(name, given):
    request = validate_request(name, given)
    made = live.Controls(request)
    assert set(made.inputs) == set(STUDIES[name].model_fields) - {"cube"}
    assert validate_request(name, made.values) == request
    assert study_command(request).split(" -p ")[1] in made.message.value

    schemas = STUDIES[name].model_json_schema()["properties"]
    for key, widget in made.inputs.items():  # sliders end at what is allowed
        if isinstance(widget, ipywidgets.FloatSlider):
            assert widget.min >= schemas[key].get("minimum", -np.inf)
            assert widget.min > schemas[key].get("exclusiveMinimum", -np.inf)
            assert widget.max <= schemas[key].get("maximum", np.inf)
            assert widget.max < schemas[key].get("exclusiveMaximum", np.inf)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("focal_length_mm", "-1.0", "allowed: a number above 0"),
        ("distances_mm", "[100]", "the reach of the structure"),
        ("modes", "<b>", "whole numbers from 1 to 30"),
    ],
)
def test_a_refused_value_says_so_in_one_line_and_runs_nothing(monkeypatch, key, value, words):
    made = live.Controls(validate_request("beam-distance", {}))
    monkeypatch.setattr(notebook, "cube_of", lambda *_: pytest.fail("it ran"))
    made.inputs[key].value = value
    assert made.button.disabled
    assert "command" not in made.message.value
    assert f"beam-distance: {key}" in made.message.value
    assert words in made.message.value
    assert "<b>" not in made.message.value
    assert "\n" not in made.message.value
    made.button.click()
    assert made.output.outputs == ()


def test_what_fails_is_told(monkeypatch):
    def failing(*_):
        raise RuntimeError("out of film")

    monkeypatch.setattr(notebook, "cube_of", failing)
    made = live.Controls(validate_request("beam-distance", {"trials": 1}))
    made.button.click()
    assert made.output.outputs[-1]["text"] == "RuntimeError: out of film\n"
    assert not made.button.disabled


# The notebooks.


@pytest.mark.parametrize("name", LIVE)
def test_notebooks_end_with_the_controls_which_the_book_does_not_show(name):
    last = committed(name).cells[-1]
    assert last.source.splitlines()[-1] == f'live.rerun("{name}", globals())'
    assert last.metadata.tags == ["remove-cell", "nbval-ignore-output"]


def test_a_run_for_a_file_has_no_controls():
    assert live.rerun("beam-distance", {"cube": "somewhere.nc"}) is None


def test_the_last_cell_begins_with_the_notebooks_parameters_and_gives_it_the_librarys_cube():
    first, second, *_ = (
        c.source for c in committed("beam-distance").cells if "code" in c.cell_type
    )
    namespace = {}
    exec(f"{first}\ntrials = 4\nmodes = [1]\n{second}", namespace)
    *rows, button, _, output = live.rerun("beam-distance", namespace).widget.children
    inputs = [row.children[0] for row in rows if isinstance(row, ipywidgets.HBox)]
    next(one for one in inputs if one.description == "azimuth_deg").value = 45.0
    button.click()
    asked = {"trials": 4, "modes": [1], "azimuth_deg": 45.0}
    expected = studies.run(validate_request("beam-distance", asked))
    cube = namespace["result"]
    np.testing.assert_array_equal(cube["mean_error"], expected["mean_error"])
    told = [one["text"] for one in output.outputs if one["output_type"] == "stream"]
    assert "\n".join(cubes.difference_lines(cube)) in "".join(told)
    shown = [one["data"] for one in output.outputs if one["output_type"] == "display_data"]
    assert "application/vnd.jupyter.widget-view+json" in shown[0]
    assert error_table(cube).data == shown[1]["text/markdown"]
