"""Rerun in the page: beam and plate, computed by the page, are what the library computes."""

import json
import random
import re

import numpy as np
import pytest
from book.rerun_form import as_in_page, fill
from browser import focused, open_offline, tab_through, write_page
from command import read_command
from refused import refusal

from thesis_lib.book import explorer
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.parametric import compute
from thesis_lib.figure_sets.parametric.in_page import COMPUTED_SETS
from thesis_lib.figure_sets.registry import STUDIES, validate_request
from thesis_lib.notebook import show
from thesis_lib.studies.cubes import read_published
from thesis_lib.vision.pinhole import hemisphere_directions

FORM = ".tl-rerun"
STATUS, SENTENCE, CODE = ".tl-rerun-status", ".tl-rerun-sentence", ".tl-rerun pre code"


def atlas(name, **values):
    """Return the viewer of a figure set's page, with the parameters above it."""
    return show.viewer(cube_file.cube_of(validate_request(name, values)))


@pytest.fixture(scope="module")
def form(tmp_path_factory):
    file = tmp_path_factory.mktemp("recompute") / "a form.html"
    return write_page(file, explorer.rerun_form_html())


@pytest.fixture(scope="module")
def distance(tmp_path_factory):
    file = tmp_path_factory.mktemp("recompute") / "beam distance.html"
    return write_page(file, "<h1 id='top'>x</h1>", atlas("beam-distance"))


def until(opened, what):
    """Wait for the nominal run (`literal`) of the last request, or for all its draws (`drawn`)."""
    script = """([form, drawn]) => {
      const data = document.querySelector(form).recompute.data();
      const isDrawn = ({ modes }) => modes.every(({ median }) => Number.isFinite(median));
      return data && (!drawn || data.all.every(isDrawn)); }"""
    opened.page.wait_for_function(script, arg=[FORM, what == "drawn"], timeout=120_000)


def shown(opened):
    data = f"document.querySelector('{FORM}').recompute.model.get('data')"
    return opened.page.evaluate(f"() => JSON.parse(JSON.stringify({data}))")


def type_in(opened, name, values):
    as_is = ("cases",)  # boxes to tick
    fill(opened, (name, {k: v if k in as_is or isinstance(v, str) else json.dumps(v)
                         for k, v in values.items()}))  # fmt: skip


def asked(opened, name, values, what="literal"):
    """A request typed into the form, and what the page makes of it."""
    type_in(opened, name, values)
    until(opened, what)
    return shown(opened)


def said(opened, css):
    return opened.page.locator(css).first.inner_text()


# --- equal to the library


def drawn_request(rng, name):
    """A random request that the library takes, with cameras well apart."""
    fields, near = STUDIES[name].model_fields, 420 if name.startswith("beam") else 700

    def some(low, high, digits=1):
        return round(rng.uniform(low, high), digits)

    def directions(count):
        while True:
            found = [[some(-180, 180), some(5, 88)] for _ in range(count)]
            away = hemisphere_directions(*np.radians(found).T)
            cosines = (away @ away.T)[np.triu_indices(count, 1)]
            if np.all(np.abs(cosines) < np.cos(np.radians(4))):
                return found

    halves, elevations = ([some(5, 40), some(41, 80)] for _ in range(2))
    layout = [directions(2), directions(24 if rng.random() < 0.2 else 3)]
    force, highest = rng.random() < 0.15, 30 if rng.random() < 0.3 else 4
    modes = sorted(rng.sample(range(1, 5 if force else 1 + highest), 2))
    peak = [some(0.5, 12) for _ in modes] if rng.random() < 0.4 else some(0.5, 12)
    every = {
        "azimuth_deg": some(8, 80), "elevation_deg": some(5, 75),
        "distance_mm": some(near, 2000),
        "distances_mm": sorted({some(near, 2500) for _ in range(3)}),
        "half_apertures_deg": halves, "elevations_deg": elevations,
        "resolution_px": rng.choice([[320, 180], [640, 360], [333, 201], [1920, 1080]]),
        "widths_px": rng.sample([123, 320, 321, 1001, 1920, 4000], 3),
        "cases": sorted(rng.sample(STUDIES[name]().cases, 2)) if "cases" in fields else [],
        "pair_order": {"4b": "reversed"} if rng.random() < 0.5 else {},
        "layouts": {"mine": layout},
        "focal_length_mm": some(12, 60), "sensor_width_mm": rng.choice([36, 23.5]), "modes": modes,
        "amplitude_mm": "force" if force else peak, "azimuth_zero": rng.choice("YX"),
        "rest": rng.choice(["rebuilt", "known"]),
        "principal_offset_px": rng.choice([0, 0.5, -0.125, 0.31]),
        "first_marker_mm": some(0, 23), "grid": rng.choice([[15, 10], [6, 5], [9, 17]]),
    }  # fmt: skip
    own = {key: value for key, value in every.items() if key in fields}
    return validate_request(name, {**own, "trials": 0})


def held(conforms, request, there):
    """What the page shows of a request against the library's cube."""
    cube, settings = compute.run(request), request.settings()
    # 1e-9 of the peak (in %), and the last digits of coordinates, more where a peak is nanometres
    peak = min(request.peaks_m)
    near = {"atol": 1e-7 + 100 * 4e-15 / peak, "rtol": 1e-9 if peak > 1e-5 else 1e-6}
    found = [one for case in there["cases"] for one in case["settings"]]
    assert [one["label"] for one in found] == [one.label for one in settings]
    assert [case["name"] for case in there["cases"]] == list(
        dict.fromkeys(s.case for s in settings)
    )
    for i, (one, setting) in enumerate(zip(found, settings, strict=True)):
        assert one["value"] == setting.value
        assert tuple(one["resolution"]) == setting.resolution_px
        places = [[setting.distance_mm, *map(float, pair)] for pair in setting.directions_deg]
        np.testing.assert_allclose(one["cameras"], places, rtol=0, atol=1e-12)
        assert one["in_view"] == pytest.approx(float(cube["in_view"][i]), abs=1e-12)
        for m, mode in enumerate(one["modes"]):
            here = cube.isel(setting=i, mode=m)
            literal = here.isel(trial=0)
            for key, name in (("mean", "mean_error"), ("largest", "max_point_error")):
                conforms.independent(mode[key], float(literal[name]), **near)  # in %
            conforms.independent(mode["point_error"], here["point_error"].values, **near)
            conforms.independent(mode["predicted"], float(here["predicted_error"]), **near)
            peak = 1000 * float(np.max(np.abs(here["reference_deflection"])))
            single = 1000 * literal["measured_deflection"].values  # kept in single precision
            np.testing.assert_allclose(mode["measured_mm"], single, rtol=2e-7, atol=1e-6 * peak)
    for m, mode in enumerate(there["modes"]):
        reference = 1000 * cube["reference_deflection"].isel(mode=m).values
        np.testing.assert_allclose(mode["reference_mm"], reference, rtol=1e-9, atol=1e-12)
        assert mode["frequency_hz"] == pytest.approx(float(cube["frequency"][m]), rel=1e-5)


def typed(request):
    left = {"trials", "seed", "estimator", "noise_px"}
    return {key: one for key, one in request.request.items() if key not in left}


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [22, 23])
def test_random_requests_of_every_set_are_what_the_library_makes_of_them(
    conforms, chromium, form, seed
):
    rng = random.Random(seed)
    with open_offline(chromium, form) as opened:
        for name in COMPUTED_SETS * 7:
            request = drawn_request(rng, name)
            held(conforms, request, asked(opened, name, typed(request)))
            again, given = read_command(said(opened, CODE))
            assert validate_request(again, {**given, "trials": 0}) == request


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("name", COMPUTED_SETS)
def test_the_published_run_comes_out_and_stands_behind(conforms, chromium, form, name):
    """All settings and modes as they are, with their ties; draws of its own, the same spread."""
    table = read_published(name)
    table = table[table["error"] == "mean_error"]
    with open_offline(chromium, form, query=f"set={name}") as opened:
        until(opened, "drawn")
        seen = [one["in_view"] for one in shown(opened)["all"]]
        modes = [mode for one in shown(opened)["all"] for mode in one["modes"]]
        words = said(opened, SENTENCE)
    for key, name in (("mean", "trial_0"), ("median",) * 2, ("low",) * 2, ("high",) * 2):
        known, found = table[name].values, np.array([mode[key] for mode in modes])
        assert [mode["published"][key] for mode in modes] == known.tolist()
        if key == "mean":
            conforms.independent(found, known, rtol=6e-6)
        else:
            conforms.sampled(found, known, rtol=0.35)
            conforms.sampled(np.mean(found / known), 1, rtol=0.03)
    start = "With the published parameters the median error over 200 pixel grids is "
    assert re.match(rf"{start}(0\.9[7-9]|1\.0) times the published one \(", words), words
    assert ("out of view" in words) == any(share < 1 for share in seen)


# --- refused, and left to the command

PAIR = [[0, 20], [90, 20]]
REFUSED = [
    ("beam-distance", {"distances_mm": [320], "amplitude_mm": [5, 8.5, 9]}),
    ("beam-distance", {"azimuth_deg": 360}),
    ("beam-distance", {"amplitude_mm": [1, 1, 2], "modes": [2]}),
    ("plate-aperture", {"half_apertures_deg": [10, 179.99999999]}),
    ("plate-resolution", {"distance_mm": 400}),
    ("beam-arrays", {"cases": []}),
    ("plate-arrays", {"layouts": {"mine": [PAIR, [[0, 20], [360, 20], [7, 8]]]}}),
]


def test_what_the_library_refuses_the_page_refuses_in_its_words(chromium, form):
    with open_offline(chromium, form) as opened:
        for name, values in REFUSED:
            type_in(opened, name, values)
            line = as_in_page(refusal(name, **values))
            assert said(opened, STATUS) == f"thesis: {line}"
            assert not opened.page.locator(".tl-rerun-output").is_visible()
            assert not opened.page.locator(SENTENCE).is_visible()
        asked(opened, "beam-distance", {"azimuth_deg": 31})
        assert said(opened, CODE) == "thesis run beam-distance -p azimuth_deg=31"


def test_a_refusal_ends_with_its_set(chromium, form):
    with open_offline(chromium, form, query="set=beam-distance") as opened:
        opened.page.get_by_label("distances_mm").fill("10")
        assert "distances_mm: given 10" in said(opened, STATUS)
        opened.page.get_by_label("azimuth_deg").fill("abc")
        assert "azimuth_deg" in said(opened, STATUS)
        opened.page.locator(".tl-rerun-head select").select_option("lab-modes")
        assert said(opened, STATUS) == "As published, no parameter changed:"
        assert said(opened, CODE) == "thesis run lab-modes"
        assert not opened.page.locator(".tl-rerun-figure").is_visible()


LEFT = [
    ("beam-distance", {"estimator": "interval"}, "the estimator interval"),
    ("plate-aperture", {"noise_px": 0.1}, "noise in the images"),
    ("beam-arrays", {"layouts": {"mine": [[[i, 20 + i % 3] for i in range(0, 300, 12)]]}},
     "25 cameras (a page takes 24)"),
    ("plate-arrays", {"grid": [60, 60], "modes": list(range(1, 6))},
     "4492800 images of markers (a page takes 1000000)"),
]  # fmt: skip


def test_what_a_page_cannot_do_is_left_to_the_command(chromium, form):
    with open_offline(chromium, form) as opened:
        stale = opened.page.locator(".tl-rerun-figure[data-stale]")
        for name, values, words in LEFT:
            type_in(opened, name, values)
            assert said(opened, SENTENCE) == f"Not in the page: {words}. The command runs it."
            given = validate_request(*read_command(said(opened, CODE)))
            assert given == validate_request(name, values)
            assert stale.count() == 1
            opened.page.get_by_role("button", name="Reset").click()
            until(opened, "literal")
            assert stale.count() == 0


# --- on the page of a figure set


def test_a_parameter_is_changed_on_the_page_of_its_set(chromium, distance):
    with open_offline(chromium, distance) as opened:
        page, first = opened.page, shown(opened)
        page.get_by_text("Change a parameter").click()
        assert said(opened, STATUS) == "As published, no parameter changed:"
        assert "published" not in first["cases"][0]["settings"][0]["modes"][0]
        page.get_by_test_id("mode-2").click()
        page.get_by_label("focal_length_mm").fill("12")
        until(opened, "drawn")
        mode = shown(opened)["cases"][0]["settings"][1]["modes"][1]
        assert mode["low"] < mode["median"] < mode["high"]
        table = read_published("beam-distance")
        row = table.query("value == 750 and mode == 2 and error == 'mean_error'").iloc[0]
        assert mode["published"]["median"] == row["median"]
        page.wait_for_function("() => document.querySelectorAll('.tl-published').length === 5")
        assert "Mode 2" in said(opened, ".tl-summary")
        words = re.compile(r"median error over 200 pixel grids is 1\.\d times")
        page.locator(SENTENCE, has_text=words).wait_for()
        assert said(opened, SENTENCE).startswith("With these parameters the")
        page.get_by_label("focal_length_mm").fill("0")
        problem = page.locator("[data-parameter=focal_length_mm] .tl-rerun-problem")
        assert problem.inner_text().startswith("focal_length_mm: given 0, allowed: ")
        assert page.locator(".tl-rerun-figure[data-stale]").count() == 1
        page.get_by_role("button", name="Reset").click()
        assert shown(opened) == first
        assert page.locator(".tl-rerun-figure[data-stale]").count() == 0


def test_a_page_of_other_parameters_begins_with_them(chromium, tmp_path):
    own = atlas("beam-resolution", widths_px=[640], rest="known", trials=20)
    with open_offline(chromium, write_page(tmp_path / "run.html", own)) as opened:
        given = {"widths_px": [640], "rest": "known", "trials": 20}
        assert read_command(said(opened, CODE)) == ("beam-resolution", given)
        opened.page.get_by_label("widths_px").fill("640, 1280")
        until(opened, "literal")
        assert [one["label"] for one in shown(opened)["cases"][0]["settings"]] == [
            "640×360", "1280×720",
        ]  # fmt: skip
        opened.page.get_by_label("widths_px").fill("640")
        assert len(shown(opened)["cases"][0]["settings"]) == 1


def test_a_link_shows_what_it_says(chromium, distance):
    with open_offline(chromium, distance, query="other=1#top") as opened:
        page = opened.page
        page.get_by_text("Change a parameter").click()
        page.get_by_label("distances_mm").fill("600, 900")
        page.get_by_label("elevation_deg").fill("40")
        page.keyboard.press("Tab")
        until(opened, "drawn")
        page.get_by_test_id("mode-3").click()
        page.locator(".tl-bar").nth(1).press("Enter")
        link = page.url
        for part in ("distances_mm=600", "elevation_deg=40", "mode=3", "setting=2", "other=1"):
            assert part in link
        before = shown(opened)
        page.goto(link)
        until(opened, "drawn")
        page.wait_for_timeout(50)
        assert shown(opened) == before
        assert page.locator(".tl-bar[aria-pressed=true]").get_attribute("data-setting") == "1"
        assert "Mode 3" in said(opened, ".tl-summary")


def test_it_is_used_by_keyboard(chromium, distance):
    with open_offline(chromium, distance) as opened:
        opened.page.get_by_text("Change a parameter").press("Enter")
        seen = tab_through(opened, 22)
        assert {"azimuth_deg", "Copy the command", "Reset"} < {*seen}
        assert "no outline" not in seen
        opened.page.get_by_label("azimuth_deg").focus()
        opened.page.keyboard.press("Control+A")
        opened.page.keyboard.type("50")
        until(opened, "drawn")
        assert focused(opened) == "azimuth_deg"  # not moved by what is drawn
        assert "azimuth_deg=50" in said(opened, CODE)
