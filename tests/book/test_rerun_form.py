"""The form of the rerun page: the command's words, the command's values, in a real browser."""

import json
import random
import shlex

import pytest
from book.rerun_form import as_in_page, fill
from browser import open_offline, write_page
from command import read_command
from refused import refusal
from scenes.changes import OWN_CHANGES

from thesis_lib.book import explorer
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.in_page import COMPUTED_SETS
from thesis_lib.figure_sets.registry import CHAPTER_SETS, STUDIES, validate_request
from thesis_lib.notebook.show import form_data
from thesis_lib.runs.command_line import build_requests, parse_assignments
from thesis_lib.studies import effort
from thesis_lib.studies.request import ParameterError
from thesis_lib.text import RefusedError

DISTANCE, ARRAYS = "beam-distance", "beam-arrays"

# Set, field, what is typed, and the value that this is to the command.
SILLY = [
    (DISTANCE, "azimuth_deg", "", ""),
    (DISTANCE, "azimuth_deg", "30,5", "30,5"),
    (DISTANCE, "azimuth_deg", "007", "007"),
    (DISTANCE, "azimuth_deg", "true", True),
    (DISTANCE, "azimuth_deg", "1.50e5", 1.5e5),
    (DISTANCE, "azimuth_deg", '{"b": 1, "a": [null]}', {"b": 1, "a": [None]}),
    (DISTANCE, "azimuth_deg", "long" * 20, "long" * 20),
    (DISTANCE, "distances_mm", "", []),
    (DISTANCE, "distances_mm", "500, [750]", [500, [750]]),
    (DISTANCE, "distances_mm", "[500, 750, 500.0]", [500, 750, 500.0]),
    (DISTANCE, "resolution_px", "320, 180, 3", [320, 180, 3]),
    (DISTANCE, "trials", "2.5", 2.5),
    (DISTANCE, "seed", "-1", -1),
    (DISTANCE, "amplitude_mm", "[5, \"force\"]", [5, "force"]),
    ("beam-aperture", "half_apertures_deg", "8, 180", [8, 180]),
    (ARRAYS, "pair_order", '{"4f": "printed"}', {"4f": "printed"}),
    (ARRAYS, "layouts", '{"mine": [[[80, 10], [80, 0]]]}', {"mine": [[[80, 10], [80, 0]]]}),
    (ARRAYS, "layouts", '{" x": [[[1, 2], [3, 4]]]}', {" x": [[[1, 2], [3, 4]]]}),
    (ARRAYS, "layouts", '{"a\\nb": 1}', {"a\nb": 1}),
    ("lab-layout", "directions_deg", "[[10, 22], [10, 22.0]]", [[10, 22], [10, 22.0]]),
]  # fmt: skip


def typed(value, rng):
    """A value as a reader may type it: with or without a point or the brackets of a list."""
    if isinstance(value, str):
        return value
    text = json.dumps(value, ensure_ascii=rng.random() < 0.5)
    if rng.random() < 0.3 and text.endswith(".0") and value:
        text = text.removesuffix(".0")
    flat = isinstance(value, list) and not any(isinstance(one, list) for one in value)
    return text[1:-1] if flat and rng.random() < 0.5 else text


def test_a_chapter_offers_what_its_sets_agree_in():
    data = form_data()
    for name, members in CHAPTER_SETS.items():
        chapter = data["chapters"][name]
        shown = [data["fields"][n]["name"] for n in chapter["shown"]]
        assert len(set(shown)) == len(shown)
        every = {key for one in members for key in STUDIES[one].model_fields} - {"cube"}
        assert set(shown) | set(chapter["differ"]) == every
        assert not set(shown) & set(chapter["differ"])


def test_a_chapter_takes_the_memory_of_the_two_largest_sets(monkeypatch):
    costs = {name: effort.Effort(20.0, 100.0 + 10 * i, 1.0) for i, name in enumerate(STUDIES)}
    monkeypatch.setattr(effort, "read_efforts", lambda: costs)
    data = form_data()
    for name, members in CHAPTER_SETS.items():
        memory = sum(sorted(costs[one].peak_memory_mb for one in members)[-2:])
        assert f"and {memory:.0f} MB," in data["chapters"][name]["takes"]
    assert "takes 20 s and 100 MB," in data["sets"][next(iter(STUDIES))]["takes"]


# --- in a browser


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write_page(tmp_path_factory.mktemp("rerun") / "a form.html", explorer.rerun_form_html())


@pytest.mark.slow
def test_silly_values_get_the_commands_own_words(chromium, path):
    with open_offline(chromium, path) as opened:
        found = fill(opened, *((name, {field: text}) for name, field, text, _ in SILLY))
        for (name, field, text, value), said in zip(SILLY, found, strict=True):
            line = as_in_page(refusal(name, **{field: value}))
            assert {f"{name}: {words}" for words in said["problems"].values()} == {line}, text
            assert list(said["problems"]) == said["invalid"] == [field]
            assert said["status"] == f"thesis: {line}"
            assert said["commands"] == []


def test_nothing_changed_is_the_plain_command(chromium, path):
    with open_offline(chromium, path) as opened:
        names = [*STUDIES, *CHAPTER_SETS]
        for name, said in zip(names, fill(opened, *((name, {}) for name in names)), strict=True):
            assert said["problems"] == {}
            assert said["status"] == "As published, no parameter changed:"
            assert said["commands"] == [f"thesis run {name}"]
        same = {"focal_length_mm": "24.0", "modes": "[1, 2, 3]", "principal_offset_px": "-0.0"}
        (said,) = fill(opened, (DISTANCE, same))
        assert said["commands"][0] == "thesis run beam-distance"


def filled(rng, name):
    """Some parameters of a set with other values."""
    fields = STUDIES[name].model_fields
    changes = OWN_CHANGES[name] | {
        "layouts": {"4a′ it's $HOME `x` \"é\" 😀 \\": [[[80.5, 10], [-80, 1e1]], [
            [80.5, 10], [-80, 10], [0, 5e-7]]], "2": [[[0, 20], [90, 20]]]},
        "cases": STUDIES[name]().cases[1:] if "cases" in fields else [],
        "amplitude_mm": rng.choice([0.0000001, 5, [1, 2.5, 0.001], "force"]
                                   if issubclass(STUDIES[name], CameraStudy) else [1e-05, 5]),
        "readings": ["1 N", "last marker at the tip, 26 mm lens"],
        "first_marker_mm": 0, "azimuth_zero": "X", "torsion_phase_deg": -0.0,
        "principal_offset_px": 0.125, "seed": 2**53 - 1,
    }  # fmt: skip
    keys = [key for key in fields if key in changes and rng.random() < 0.4]
    return {key: changes[key] for key in keys}


def outcome(name, values):
    try:
        return validate_request(name, values)
    except ParameterError as error:
        return str(error)


@pytest.mark.slow
def test_commands_say_what_the_form_holds(chromium, path):
    rng = random.Random(7)
    cases = [(name, filled(rng, name)) for name in STUDIES]
    named = ("cases", "readings", "topics", "camera_counts")
    texts = [(name, {k: v if k in named else typed(v, rng) for k, v in values.items()})
             for name, values in cases]  # fmt: skip
    accepted = 0
    with open_offline(chromium, path) as opened:
        for (name, values), said in zip(cases, fill(opened, *texts), strict=True):
            assert said["problems"] == {}, values
            wanted = outcome(name, values)
            # The page knows these relations, too.
            if isinstance(wanted, str) and name in COMPUTED_SETS:
                assert said["status"] == f"thesis: {as_in_page(wanted)}"
                assert said["commands"] == []
                continue
            (line,) = said["commands"]
            again, given = read_command(line)
            assert again == name
            assert outcome(name, given) == wanted
            if not isinstance(wanted, str):  # else a relation that the command checks
                accepted += 1
                number = len(given)
                assert said["status"].startswith(f"{number} parameter" if number else "As publ")
        assert accepted > 10


def test_a_chapters_command_reaches_each_set(chromium, path):
    texts = {"focal_length_mm": "35", "distances_mm": "600, 900", "modes": "1"}
    with open_offline(chromium, path, query="set=ch3") as opened:
        (said,) = fill(opened, ("ch3", texts))
        (line,) = said["commands"]
        name, given = read_command(line)
        studies = build_requests([name], given)
        assert [one.name for one in studies] == CHAPTER_SETS["ch3"]
        assert studies[0].request["distances_mm"] == [600, 900]
        assert all(one.request["focal_length_mm"] == 35 for one in studies)


def test_a_number_of_cameras_is_answered_by_how_to_say_it():
    for names in (["ch3"], ["beam-arrays"], ["sound-distance"]):
        with pytest.raises(RefusedError) as caught:
            build_requests(names, {"cameras": 5})
        (words,) = [one for one in shlex.split(str(caught.value)) if one.startswith("layouts=")]
        layouts = parse_assignments([words])
        assert validate_request(ARRAYS, layouts).request["layouts"] == layouts["layouts"]


@pytest.mark.slow
def test_the_address_keeps_the_form(chromium, path):
    query = (
        "set=beam-arrays&other=1&focal_length_mm=35&cases=%5B%224a%22%2C%224e%22%5D&rest=%3Cb%3E"
    )
    with open_offline(chromium, path, query=f"{query}#top") as opened:
        code = opened.page.locator("pre code").first
        wanted = """thesis run beam-arrays -p focal_length_mm=35 -p 'cases=["4a", "4e"]'"""
        assert code.inner_text() == wanted
        opened.page.get_by_label("azimuth_zero").select_option("X")
        opened.page.get_by_label("layouts").fill('{"ü & 2": [[[0, 20], [90, 20]]]}')
        opened.page.get_by_role("checkbox", name="4e").uncheck()
        line = code.inner_text()
        opened.page.reload()
        assert code.inner_text() == line
        study = validate_request(*read_command(line))
        assert study.request["layouts"] == {"ü & 2": [[[0, 20], [90, 20]]]}
        assert study.request["cases"] == ["4a"]
        assert "other=1" in opened.page.url
        assert opened.page.url.endswith("#top")

        opened.page.get_by_label("Figure set or chapter").select_option("beam-distance")
        assert code.inner_text() == (  # what both have is kept
            "thesis run beam-distance -p focal_length_mm=35 -p azimuth_zero=X"
        )
        assert "layouts" not in opened.page.url
        opened.page.get_by_role("button", name="Reset").click()
        assert code.inner_text() == "thesis run beam-distance"
        start = path.resolve().as_uri()
        assert opened.page.url == f"{start}?set=beam-distance&other=1#top"
    with open_offline(chromium, path, query="set=%3Cb%3E&seed=%00&__proto__=1") as opened:
        assert "given" in opened.page.locator(".tl-rerun-status").inner_text()
