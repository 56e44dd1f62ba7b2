"""The controls of a live notebook, as models and in a kernel that a front end would talk to."""

import json
import queue
import time

import ipywidgets
import nbformat
import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from jupyter_client.manager import start_new_kernel

from conftest import PROJECT
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric.figures import error_table
from thesis_lib.figure_sets.registry import STUDIES, validate_request
from thesis_lib.notebook import controls as live
from thesis_lib.notebook import show as notebook
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


@pytest.mark.parametrize("name", LIVE)
def test_controls_begin_with_the_request_and_give_it_back(name):
    request = validate_request(name, {"trials": 7, "seed": 2**60})
    made = live.controls(request)
    assert set(made.inputs) == set(STUDIES[name].model_fields) - {"cube"}
    assert validate_request(name, made.values) == request
    assert made.message.value == ""
    assert study_command(request).split(" -p ")[1] in made.command.value

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
        ("focal_length_mm", -1.0, "allowed: a number above 0"),
        ("distances_mm", "[100]", "the reach of the structure"),
        ("modes", "<b>", "whole numbers from 1 to 30"),
    ],
)
def test_a_refused_value_says_so_in_one_line_and_runs_nothing(monkeypatch, key, value, words):
    made = live.controls(validate_request("beam-distance", {}))
    monkeypatch.setattr(notebook, "study", lambda *_: pytest.fail("it ran"))
    made.inputs[key].value = value
    assert made.button.disabled
    assert made.command.value == ""
    assert f"beam-distance: {key}" in made.message.value
    assert words in made.message.value
    assert "<b>" not in made.message.value
    assert "\n" not in made.message.value
    made.button.click()
    assert made.output.outputs == ()


def text_of(made):
    return "".join(one["text"] for one in made.output.outputs if one["output_type"] == "stream")


def test_a_click_gives_the_librarys_cube_and_shows_what_changed():
    kept = []
    start = validate_request("beam-distance", {"trials": 4, "modes": [1]})
    made = live.controls(start, kept.append)
    made.inputs["azimuth_deg"].value = 45.0
    made.button.click()
    expected = studies.run(
        validate_request("beam-distance", {**start.request, "azimuth_deg": 45.0})
    )
    (cube,) = kept
    np.testing.assert_array_equal(cube["mean_error"], expected["mean_error"])
    assert "\n".join(cubes.difference_lines(cube)) in text_of(made)
    shown = [one["data"] for one in made.output.outputs if one["output_type"] == "display_data"]
    assert "application/vnd.jupyter.widget-view+json" in shown[0]
    assert error_table(cube).data == shown[1]["text/markdown"]


def test_what_fails_is_told(monkeypatch):
    def failing(*_):
        raise RuntimeError("out of film")

    monkeypatch.setattr(notebook, "study", failing)
    made = live.controls(validate_request("beam-distance", {"trials": 1}))
    made.button.click()
    assert made.output.outputs[-1]["text"] == "RuntimeError: out of film\n"
    assert not made.button.disabled


# The notebooks.


@pytest.mark.parametrize("name", LIVE)
def test_notebooks_end_with_the_controls_which_the_book_does_not_show(name):
    last = committed(name).cells[-1]
    assert last.source.splitlines()[-1] == f'live.rerun("{name}", globals())'
    assert last.metadata.tags == ["remove-cell", "nbval-ignore-output"]
    assert last.outputs == []


def test_a_run_for_a_file_has_no_controls():
    assert live.rerun("beam-distance", {"cube": "somewhere.nc"}) is None


class FrontEnd:
    """What a browser does with a kernel: runs cells, knows the widgets, sets and presses them."""

    def __init__(self, client):
        self.client = client
        self.states = {}

    def listen(self, identity, until=60.0):
        """Messages that a request caused, up to the kernel's being idle again."""
        found, end = [], time.monotonic() + until
        while time.monotonic() < end:
            try:
                message = self.client.get_iopub_msg(timeout=1)
            except queue.Empty:
                continue
            content, kind = message["content"], message["msg_type"]
            if kind == "comm_open":
                self.states[content["comm_id"]] = dict(content["data"]["state"])
            if kind == "comm_msg" and content["data"].get("method") == "update":
                self.states[content["comm_id"]].update(content["data"]["state"])
            if message["parent_header"].get("msg_id") == identity:
                found.append(message)
                if kind == "status" and content["execution_state"] == "idle":
                    return found
        raise TimeoutError("the kernel does not get idle")

    def run(self, code):
        messages = self.listen(self.client.execute(code))
        assert not [m["content"] for m in messages if m["msg_type"] == "error"]
        return "".join(m["content"]["text"] for m in messages if m["msg_type"] == "stream")

    def send(self, comm, data):
        message = self.client.session.msg("comm_msg", {"comm_id": comm, "data": data})
        self.client.shell_channel.send(message)
        self.listen(message["header"]["msg_id"])

    def named(self, description):
        (found,) = [c for c, s in self.states.items() if s.get("description") == description]
        return found

    def set(self, name, value):
        self.send(self.named(name), {"method": "update", "state": {"value": value}})

    def press(self, description):
        self.send(self.named(description), {"method": "custom", "content": {"event": "click"}})

    def says(self, words):
        """Whether any text on the screen has these words."""
        return any(words in str(state.get("value", "")) for state in self.states.values())

    def printed(self):
        """What stands in the output below the button."""
        outputs = [state["outputs"] for state in self.states.values() if "outputs" in state]
        return "".join(one.get("text", "") for some in outputs for one in some)


@pytest.fixture
def front_end():
    manager, client = start_new_kernel(kernel_name="python3", cwd=str(PROJECT))
    yield FrontEnd(client)
    client.stop_channels()
    manager.shutdown_kernel(now=True)


@pytest.mark.slow
def test_controls_in_a_kernel_rerun_by_the_library(front_end):
    codes = [cell.source for cell in committed("beam-distance").cells if cell.cell_type == "code"]
    front_end.run(f"{codes[0]}\ntrials = 3\n{codes[1]}")
    front_end.run(codes[-1])
    front_end.set("distances_mm", "[10]")
    assert front_end.says("beam-distance: distances_mm")
    assert front_end.states[front_end.named("Rerun")]["disabled"]
    front_end.set("distances_mm", "[600, 900]")
    front_end.set("elevation_deg", 40)
    assert front_end.says("distances_mm=[600.0, 900.0]")
    front_end.press("Rerun")
    got = json.loads(front_end.run("print(result['mean_error'].values.tolist())"))
    asked = {"distances_mm": [600, 900], "elevation_deg": 40, "trials": 3}
    expected = studies.run(validate_request("beam-distance", asked))["mean_error"]
    np.testing.assert_array_equal(np.array(got), expected.values)
    assert "running beam-distance" in front_end.printed()
    assert "no setting in common with published" in front_end.printed()
