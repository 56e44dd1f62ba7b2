"""The ledger: its own runs, what it makes of the cubes, and the cube that holds it."""

import json
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from command import read_command
from scenes.ledger import TRIALS, cube_of, entries, own, own_cube, sets

from thesis_lib.facts import claims, setups
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.claims import compute
from thesis_lib.figure_sets.claims.figure_set import Claims
from thesis_lib.figure_sets.claims.figures import LedgerTable
from thesis_lib.figure_sets.display import list_captions
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.figure_sets.registry import STUDIES, validate_request
from thesis_lib.files import project_root
from thesis_lib.ledger import entries as ledger, verdicts
from thesis_lib.studies import cubes, storage
from thesis_lib.studies.schema import with_provenance
from thesis_lib.vision.pinhole import hemisphere_directions

pytestmark = pytest.mark.slow  # by cubes of all figure sets


@pytest.fixture(scope="module")
def found():
    return entries()


# -- What the thesis says can be judged --


def test_the_step_back_is_said_beside_the_verdict_in_the_ledger():
    cube = cube_of("experiment-resolution")
    made = cube.assign(mean_error=cube["mean_error"] * 0 + cube["value"] ** -0.2)
    turned = made["mean_error"] * xr.where(cube["value"] == 1280, 0.8, 1)
    (entry,) = [
        one
        for one in entries(experiment_resolution=made.assign(mean_error=turned))
        if one.id == "ch5-concluding-t1"
    ]
    assert " at 1280 but " in entry.step_back
    assert f"not monotonic ({entry.step_back})" in entry.got


# -- Own runs: tilted arcs --

DIRECTIONS = [(90.0, 8.0), (-90.0, 58.0), (30.0, 25.0), (179.0, 40.0), (-120.0, 3.0), (0.0, 90.0)]


def axes(directions):
    return hemisphere_directions(*np.radians(directions).T)


def test_tilting_is_a_turn_about_x(conforms):
    """From +Z towards +Y; the third column is where the zenith goes."""
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    turn = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    found = axes(compute.tilt_directions(DIRECTIONS, 30))
    conforms.closed_form(found, axes(DIRECTIONS) @ turn.T, atol=3e-8)


# -- Own runs: requests --


@pytest.mark.parametrize("name", compute.own_sources())
def test_commands_run_what_the_ledger_runs(name):
    source = compute.own_sources()[name]
    for command, request in zip(source.commands, source.requests, strict=True):
        assert "\n" not in command
        assert validate_request(*read_command(command)).digest == request.digest


def request_of(name, **values):
    return validate_request(name, {"trials": TRIALS, **values})


def test_apart_has_for_each_distance_a_series_over_the_apertures(conforms):
    structure = "plate"
    distances = setups.setup_table(structure, "distance")["distances_mm"]
    name = f"{structure}-aperture"
    made = own()[f"{structure}-apart"]
    here = {(s.case, s.quantity, s.mode): s for s in made}
    cases = {f"{s.case} at {d:g}" for s in STUDIES[name]().settings() for d in distances}
    assert {case for case, _, _ in here} == cases
    for distance in distances:
        cube = studies.run(request_of(name, distance_mm=distance))
        for series in verdicts.series_of(cube.assign_attrs(figure_set=name)):
            made_here = here[f"{series.case} at {distance:g}", series.quantity, series.mode]
            assert made_here.values.tolist() == series.values.tolist()
            conforms.independent(made_here.errors, series.errors, rtol=1e-6)


def test_elevation_and_tilts_are_what_is_varied():
    elevations = setups.setup_table("beam", "aperture")["elevations_deg"]
    for series in own()["beam-elevation"]:
        assert series.values.tolist() == elevations == sorted(elevations)
        assert series.case[:2] in ("2a", "2c")
    for series in own()["plate-tilted"]:
        assert series.values.tolist() == list(compute.TILTS_DEG)


def test_the_other_order_is_the_other_one():
    assert {s.case for s in own()["beam-other-order"]} == {"4b-reversed", "4d-printed"}
    request = compute.own_sources()["beam-other-order"].requests[0]
    first = {s.case: s.directions_deg for s in request.settings() if s.value == 2}
    assert {case: {e for _, e in cameras} for case, cameras in first.items()} == {
        "4b": {58.0}, "4d": {8.0}
    }  # fmt: skip


def test_the_plain_plate_of_the_askew_run_is_case_4a(conforms):
    cube = cube_of("plate-arrays")
    here = cube.isel(setting=cube["case"].values == "4a").sel(mode=1)
    for series in own()[compute.ASKEW_PLATE]:
        if series.case == "plain":
            expected = here[series.quantity].isel(trial=slice(1, None))
            conforms.invariance(series.errors, expected, rtol=1e-6)
        else:
            assert not np.allclose(series.errors, here[series.quantity][:, 1:], rtol=0.01)


# -- Own runs: series and their file --


def test_series_grow_with_what_is_varied_and_leave_out_the_nominal_run():
    cube = cube_of("beam-aperture").isel(setting=[3, 0, 2, 1])
    series = {(s.quantity, s.mode): s for s in verdicts.series_of(cube)}
    assert series["mean_error", 2].values.tolist() == [16, 60, 110, 160]
    np.testing.assert_array_equal(
        series["mean_error", 2].errors, cube_of("beam-aperture")["mean_error"][:4, 1, 1:]
    )


def test_own_runs_come_back_from_their_file(tmp_path):
    storage.write_netcdf(own_cube(), tmp_path / "own.nc")
    back = compute.read_own(storage.open_netcdf(tmp_path / "own.nc"))
    assert list(back) == list(own())
    for name, made in own().items():
        assert len(made) == len({(s.quantity, s.case, s.mode) for s in made})
        for one, other in zip(made, back[name], strict=True):
            assert (one.quantity, one.case, one.mode) == (other.quantity, other.case, other.mode)
            np.testing.assert_array_equal(one.values, other.values)
            np.testing.assert_array_equal(one.errors, other.errors)
            assert one.errors.shape == (len(one.values), TRIALS)
            assert np.isfinite(one.errors).all()


# -- Entries --


def stated_ids():
    return [
        one.id for one in (*claims.read_claims(), *claims.read_trends(), *claims.read_numbers())
    ]


def test_every_statement_has_one_entry_that_can_be_shown(found):
    assert sorted(entry.id for entry in found) == sorted(stated_ids())
    assert [entry.chapter for entry in found] == sorted(entry.chapter for entry in found)
    assert {entry.verdict for entry in found} <= set(verdicts.VERDICTS) - {"undefined"}
    LedgerTable(data={"rows": [entry.row for entry in found]})
    json.dumps([entry.json_values for entry in found], allow_nan=False)
    for entry in found:
        texts = [text for text in entry.row.values() if isinstance(text, str)]
        assert not any("nan" in text.split() for text in texts), entry.id
        assert all((entry.place.strip(), entry.what, entry.stated, entry.got)), entry.id


def test_commands_of_the_entries_are_accepted(found):
    commands = {line for entry in found for line in entry.command.splitlines()}
    assert len(commands) > len(sets())
    for command in commands:
        validate_request(*read_command(command))


def test_links_lead_to_figures_of_the_notebooks(found):
    labels = {}
    for path in (project_root() / "notebooks").glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        asked, sources = STUDIES[path.stem](), ("".join(cell["source"]) for cell in cells)
        captions = [one for source in sources for one in list_captions(asked, source)]
        labels[path.stem] = {one.name for one in captions}
    for entry in found:
        page, _, label = entry.href.partition("#")
        if entry.kind == "figure":
            assert label == f"fig-{entry.place.split()[1].replace('.', '-')}", entry.id
        if page:
            assert label in {"", *labels[page.removesuffix(".html")]}, entry.id


def test_rendered_recordings_and_bookkeeping_alone_are_not_counted(found):
    rendered = {
        claim.id for claim in claims.read_claims() if claim.figure_set.startswith("experiment")
    } | {
        trend.id for trend in claims.read_trends()
        if any(name.startswith(("experiment", "lab")) for name in trend.source)
    }  # fmt: skip
    bookkeeping = {number.id for number in claims.read_numbers() if number.is_bookkeeping}
    assert {entry.id for entry in found if not entry.counted} == rendered | bookkeeping
    assert 20 < len(bookkeeping) < 50
    of_five = {entry.id for entry in found if entry.chapter == 5 and entry.kind != "number"}
    assert of_five <= rendered
    assert len(rendered - of_five) == 1  # a sentence of chapter 3 on real measurements


# -- Other cubes --


def tenfold(cube):
    """The cube as if every error were ten times as large."""
    errors = {"mean_error", "max_point_error", "plane_error", "deflection_error"}
    made = {name: 10 * cube[name] for name in errors & set(cube)}
    if "measured_deflection" in cube:
        measured, true = cube["measured_deflection"].astype(float), cube["reference_deflection"]
        made["measured_deflection"] = (10 * measured - 9 * true).transpose(*measured.dims)
    return cube.assign(made)


def users(name):
    """Entries that are judged by a figure set: figures, and trends."""
    figures = {claim.id for claim in claims.read_claims() if claim.figure_set == name}
    return figures, {trend.id for trend in claims.read_trends() if name in trend.source}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["beam-arrays", "sound-aperture", "experiment-resolution"])
def test_a_doctored_cube_changes_its_own_entries_and_no_others(found, name):
    figures, of_trends = users(name)
    doctored = entries(**{name.replace("-", "_"): tenfold(cube_of(name))})
    changed = set()
    for before, after in zip(found, doctored, strict=True):
        if before.id in figures:
            assert after.median == pytest.approx(10 * before.median, rel=1e-4) or (
                "all settings" in before.what
            )
            assert after.got != before.got
        if before.json_values != after.json_values:
            changed.add(before.id)
        if before.verdict != after.verdict:
            assert before.id in figures | of_trends
    assert figures <= changed <= figures | of_trends
    before, after = (Counter(e.verdict for e in made if e.id in figures)
                     for made in (found, doctored))  # fmt: skip
    assert after["differs"] > before["differs"]


def test_without_a_cube_its_entries_are_undefined_for_that_reason(found):
    figures, of_trends = users("sound-arrays")
    made = entries(sound_arrays="cube sound-arrays.nc is missing: run `thesis book`")
    for before, after in zip(found, made, strict=True):
        if before.id in figures | of_trends:
            assert after.verdict == "undefined"
            assert after.note.startswith("cube sound-arrays.nc is missing: run `thesis book`")
            assert (after.got, np.isnan(after.ratio)) == ("", True)
            assert np.isnan([after.literal, after.median, after.confidence]).all()
            assert (after.stated, after.href, after.counted) == (
                before.stated, before.href, before.counted)  # fmt: skip
        else:
            assert after.json_values == before.json_values
    table = LedgerTable(data={"rows": [entry.row for entry in made]})
    assert any(row["ratio"] is None for row in table.data["rows"])  # in place of what is no number
    told = ledger.format_report(made).split("undefined:")[1]
    assert "cube sound-arrays.nc is missing: run `thesis book`" in told


# -- Which files are judged by --


def write(cube, path):
    storage.write_netcdf(cube, path)


OUTDATED = "is outdated: the library or its parameters were others"


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda path: path.unlink(), "is missing"),
        (lambda path: path.write_bytes(b""), "is not readable"),
        (lambda path: write(cube_of("beam-aperture"), path), OUTDATED),
        (lambda path: write(cube_of("beam-distance").assign_attrs(library_sha256=""), path),
         OUTDATED),
        (lambda path: write(with_provenance(
            cube_of("beam-distance"), request_of("beam-distance", seed=1), 0.0), path), OUTDATED),
    ],
)  # fmt: skip
def test_any_other_file_is_refused_in_one_line(tmp_path, damage, words):
    request, path = request_of("beam-distance"), tmp_path / "beam-distance.nc"
    write(cube_of("beam-distance"), path)
    xr.testing.assert_identical(cube_file.read_usable(path, request), cube_of("beam-distance"))
    damage(path)
    reason = cube_file.read_usable(path, request)
    assert reason == f"cube beam-distance.nc {words}: run `thesis book`"


# -- The report --


def test_the_report_tells_every_entry_that_differs_and_counts_all_that_count(found):
    text = ledger.format_report(found)
    _, *told = text[text.index("\ndiffers: ") + 1 :].split("\n\n")[0].splitlines()
    differing = [entry for entry in found if entry.verdict == "differs"]
    assert len(told) == len(differing) > 0
    for line, entry in zip(told, differing, strict=True):
        for words in (entry.place, entry.case, entry.what.rstrip("."), entry.stated, entry.got):
            assert words in line
    (last,) = re.findall("in all, .*: (.*)", text)
    counted = [entry.verdict for entry in found if entry.counted]
    assert last == ", ".join(f"{counted.count(verdict)} {verdict}" for verdict in verdicts.VERDICTS)


# -- Why claims differ --


def interpretations(met, **meets):
    """Which stated values the adopted interpretation and two others meet, and how many in all."""
    names = ["adopted", "rest known", "rest known, 18 mm lens"]
    return xr.Dataset(
        {
            "reading_inside": (("reading", "chapter"), [[n] for n in met]),
            "reading_meets": (("value", "reading"), list(meets.values())),
        },
        {"reading": names, "value": [name.replace("_", "-") for name in meets]},
    )  # fmt: skip


def test_every_claim_that_differs_says_why_with_a_link(found, other_readings):
    made = ledger.explain_differences(found, other_readings)
    assert [(e.id, e.verdict) for e in made] == [(e.id, e.verdict) for e in found]
    for entry, before in zip(made, found, strict=True):
        if entry.verdict == "differs":
            assert entry.note.endswith((".", "rms")), entry.id
            assert entry.note_href, entry.id
        else:
            assert entry == before


def test_an_interpretation_is_named_if_it_meets_the_value():
    base = entries()[0]
    one = [replace(base, id="a-b", kind="figure", verdict="differs", note="")]

    def why(met, *meets):
        (entry,) = ledger.explain_differences(one, interpretations(met, a_b=meets))
        return entry.note

    none = "No explanation was found: none of 2 other interpretations meets this value."
    assert why((9, 4, 6), 0, 0, 0) == none
    one_known = "“rest known” meets this one, but only 4 in all; the adopted one meets 9."
    assert one_known in why((9, 4, 6), 0, 1, 0)
    better = "“rest known, 18 mm lens”, meets this value, and 12 values in all"
    assert better in why((9, 4, 12), 0, 0, 1)
    assert "“rest known” meets" in why((9, 4, 12), 0, 1, 1)  # the other changes more than needed


def test_reasons_are_of_claims_and_lead_to_places_of_the_book():
    known = claims.read_reasons()
    assert set(known) <= set(stated_ids())
    items = {item["id"] for item in setups.list_assumptions()}
    for one in known.values():
        document, _, anchor = one.page.partition("#")
        text = (project_root() / "book" / f"{document}.md").read_text(encoding="utf-8")
        if document == "assumptions":
            assert anchor.removeprefix("assumed-") in items
        elif anchor:
            headings = {h.lower().replace(" ", "-") for h in re.findall(r"^#+ (.*)$", text, re.M)}
            assert f"({anchor})=" in text or anchor in headings, one.page


# -- The ledger as a cube --


@pytest.fixture(scope="module")
def other_readings():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compute, "CAMERA_STUDIES", {"beam-distance": STUDIES["beam-distance"]})
        return compute.run_readings(Claims(trials=2, readings=["rest known"]))


@pytest.fixture(scope="module")
def cube(found, other_readings):
    made = ledger.as_cube(found, other_readings)
    return with_provenance(made, validate_request("claims", {}), 0.0)


def test_entries_come_back_from_their_cube(found, cube, other_readings, tmp_path):
    storage.write_netcdf(cube, tmp_path / "claims.nc")
    for made in (cube, cube_file.read_cube(tmp_path / "claims.nc")):
        back = ledger.from_cube(made)
        assert [entry.json_values for entry in back] == [entry.json_values for entry in found]
        for one, other in zip(back, found, strict=True):
            assert (one.modes, one.counted) == (other.modes, other.counted)
    undefined = compute.judge_claims(lambda study: "no cube", {})
    back = ledger.from_cube(ledger.as_cube(undefined, other_readings))
    assert [entry.json_values for entry in back] == [entry.json_values for entry in undefined]
    for name, variable in other_readings.variables.items():
        xr.testing.assert_identical(cube.variables[name], variable)
    table = cubes.summarise_errors(cube)
    assert table["claim"].tolist() == [entry.id for entry in found]
    assert table["verdict"].tolist() == [entry.verdict for entry in found]


def test_commands_of_the_readings_are_accepted():
    for reading in setups.READINGS.values():
        name, values = read_command(compute.format_command(reading))
        assert name == "ch3"
        expected = camera_study("beam-arrays", compute.reading_parameters(reading, "beam-arrays"))
        assert validate_request("beam-arrays", values).digest == expected.digest
