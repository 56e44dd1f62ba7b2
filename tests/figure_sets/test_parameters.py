"""Parameters: what is refused and how, what stands for a request, what the notebooks say."""

import math
import typing
from pathlib import Path

import nbformat
import pytest
from pydantic import create_model
from refused import line_of, refusal
from scenes.changes import OWN_CHANGES, PAIR

from thesis_lib.book.pieces.manifest import MANIFEST_PARTS
from thesis_lib.figure_sets.parametric.in_page import COMPUTED_SETS
from thesis_lib.figure_sets.registry import STUDIES, validate_request
from thesis_lib.notebook.new_set import parameter_cell
from thesis_lib.planning.request import PlanRequest, plan_request
from thesis_lib.studies.fields import Azimuth, Real, unit_of_field
from thesis_lib.studies.request import ParameterError, describe_parameters
from thesis_lib.web.html import read_asset

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"
# Parameters without a unit beyond name and meaning; whole numbers that count need not be here.
NO_UNIT = {
    "f_number", "f_numbers", "lens_k1", "in_view", "poissons_ratio", "damping",
    "pixels_per_second", "target_percent",
    "shot_noise", "read_noise",  # grey levels
    "prices",  # of any currency
    "layouts",  # names beside degrees
}  # fmt: skip
NAN = math.nan
DISTANCE, APERTURE = "beam-distance", "beam-aperture"
ARRAYS, PLATE, SOUND = "beam-arrays", "plate-distance", "sound-aperture"
LAW, SHAPE = "design-law", "shape-l"


def allowed(name, field):
    row = next(row for row in describe_parameters(STUDIES[name]) if row["name"] == field)
    return f"allowed: {row['allowed']}" + (f", in {row['unit']}" if row["unit"] else "")


def test_a_default_out_of_bounds_is_refused_where_parameters_are_listed():
    class Own(STUDIES["beam-distance"]):
        azimuth_deg: Azimuth = 400.0

    line = "beam-distance: azimuth_deg: given 400.0, allowed: a number from -360 to 360, in °"
    assert line_of(ParameterError, describe_parameters, Own) == line


# Set, field, value, where in the value the fault is, what the message repeats: one of each kind.
BAD = [
    (DISTANCE, "azimuth_deg", "30", "", '"30"'),
    (DISTANCE, "azimuth_deg", True, "", "true"),
    (DISTANCE, "azimuth_deg", NAN, "", "NaN"),
    (DISTANCE, "azimuth_deg", 360.5, "", "360.5"),
    (DISTANCE, "distances_mm", [], "", "[]"),
    (DISTANCE, "distances_mm", 500, "", "500"),
    (DISTANCE, "distances_mm", [500, "750"], "[1]", '"750"'),
    (DISTANCE, "distances_mm", [500, 750, 500.0], "", "[500, 750, 500.0]"),
    (DISTANCE, "resolution_px", [320], "", "[320]"),
    (DISTANCE, "trials", 2.0, "", "2.0"),
    (DISTANCE, "seed", 2**63, "", "9223372036854775808"),
    (DISTANCE, "amplitude_mm", [5.5, -1, 2], "", "[5.5, -1, 2]"),
    (DISTANCE, "rest", "rebuild", "", '"rebuild"'),
    (DISTANCE, "cube", "out.txt", "", '"out.txt"'),
    (ARRAYS, "cases", ["4a'", "4a′"], "", """["4a'", "4a′"]"""),
    (ARRAYS, "pair_order", {"4b": "forwards"}, '["4b"]', '"forwards"'),
    (ARRAYS, "layouts", {"mine": [[[80, 10], [361, 9]]]}, '["mine"][0][1][0]', "361"),
    (ARRAYS, "layouts", {" x": [PAIR]}, '[" x"]', '" x"'),
    (PLATE, "grid", [1, 10], "[0]", "1"),
    (SHAPE, "outline_mm", [[0, 0], [500, NAN], [500, 1]], "[1][1]", "NaN"),
    (SHAPE, "outline_mm", [[0, 0], [9, 0], [0, 0]], "", "[[0, 0], [9, 0], [0, 0]]"),
    (SHAPE, "cutouts_mm", [[[100, 100], [120, 100]]], "[0]", "[[100, 100], [120, 100]]"),
]


@pytest.mark.parametrize(("name", "field", "value", "place", "shown"), BAD)
def test_refusal_names_the_place_repeats_the_value_and_says_what_is_allowed(
    name, field, value, place, shown
):
    message = refusal(name, **{field: value})
    assert message == f"{name}: {field}{place}: given {shown}, {allowed(name, field)}"


@pytest.mark.parametrize("name", STUDIES)
def test_unknown_parameter_gets_the_nearest_name_and_all_names(name):
    for field in STUDIES[name].model_fields:
        message = refusal(name, **{field + "x": 1})
        assert f"no parameter {field}x (did you mean {field}?)" in message
        others = set(STUDIES[name].model_fields) - {"cube"}
        assert all(other in message for other in others) or f"`thesis list {name}`" in message
        assert len(message) <= 400
    assert "did you mean" not in refusal(name, wxyz=1)
    assert "(did you mean beam-distance?)" in refusal("beam-distanc")


@pytest.mark.parametrize(
    ("name", "values", "field", "given"),
    [
        (DISTANCE, {"distances_mm": [500], "amplitude_mm": 250}, "distances_mm", 500.0),
        (LAW, {"amplitude_mm": 700}, "cone_distance_mm", 1000.0),
    ],
)
def test_cameras_stay_out_of_the_structures_reach(name, values, field, given):
    message = refusal(name, **values)
    assert message.startswith(f"{name}: {field}: given {given}, allowed: more than ")
    reach = float(message.split("more than ")[1].split()[0])
    assert f"{reach:.4g} mm" in message
    further = 1.01 * reach
    validate_request(name, {**values, field: [further] if field == "distances_mm" else further})


@pytest.mark.parametrize(
    ("name", "values", "field", "case"),
    [
        (APERTURE, {"elevation_deg": 90, "cases": ["2c"]}, "elevation_deg", "2c"),
        (ARRAYS, {"layouts": {"mine": [[[-90, 20], [0, 5], [270, 20]]]}}, "layouts", "mine"),
    ],
)
def test_two_cameras_at_the_same_place_are_refused(name, values, field, case):
    message = refusal(name, **values)
    assert message.startswith(f"{name}: {field}: given [[")
    assert f'two cameras at the same place in case "{case}", ' in message
    assert message.endswith("([azimuth, elevation] in °), allowed: different places")


def test_pistons_too_large_for_the_wave_are_refused():
    message = refusal(SOUND, grid=[2, 2], modes=[1, 30])
    assert message.startswith(f"{SOUND}: modes: given 30, k times the size of a piston is ")
    assert message.endswith("needs at most π: take lower modes or a finer grid")
    validate_request(SOUND, {"grid": [60, 60], "modes": [1, 30]})
    validate_request(SOUND, {"grid": [2, 2], "modes": [1]})


def test_what_is_not_run_refuses_nothing():
    validate_request(SOUND, {"plane_bottom_mm": 500, "plane_top_mm": 500.1})
    validate_request(APERTURE, {"elevations_deg": [90], "cases": ["2a"]})
    validate_request(APERTURE, {"elevation_deg": 90, "cases": ["2b"]})
    validate_request(ARRAYS, {"cases": [], "layouts": {"mine": [PAIR]}})


def test_what_is_meant_is_accepted():
    ints = validate_request(DISTANCE, {"distances_mm": (500, 800), "resolution_px": (640, 360)})
    floats = {"distances_mm": [500.0, 800.0], "resolution_px": [640, 360]}
    assert ints == validate_request(DISTANCE, floats)
    assert [type(d) for d in ints.distances_mm] == [float, float]
    assert validate_request(DISTANCE, {"amplitude_mm": [5, 5.0, 5]}).peaks_m == [0.005] * 3
    assert plan_request({"prices": [100, 100, 200, 200]}).prices == [100, 100, 200, 200]
    own = create_model("Own", __base__=STUDIES[DISTANCE], matrix=(list[list[Real]], [[1.0]] * 2))
    assert own().matrix == [[1.0], [1.0]]
    primed, straight = (validate_request(ARRAYS, {"cases": [case]}) for case in ("4a′", "4a'"))
    assert primed == straight
    turned = validate_request(ARRAYS, {"pair_order": {"4a′": "reversed"}})
    assert turned.pair_order == {"4a'": "reversed"}
    assert validate_request(DISTANCE, {"trials": 0, "seed": 2**63 - 1, "cube": "a.nc"}).trials == 0


@pytest.mark.parametrize("name", STUDIES)
def test_digest_changes_with_every_parameter_but_not_with_the_cubes_place(name):
    model = STUDIES[name]
    assert {*OWN_CHANGES[name]} == {*model.model_fields} - {"cube"}
    digests = {
        field: validate_request(name, {field: value}).digest
        for field, value in OWN_CHANGES[name].items()
    }
    assert len({*digests.values(), model().digest}) == len(digests) + 1
    assert validate_request(name, {"cube": "somewhere.nc"}).digest == model().digest


def test_digest_is_the_same_for_the_same_request():
    assert validate_request(DISTANCE, {"focal_length_mm": 24}).digest == STUDIES[DISTANCE]().digest
    mine, yours = {"mine": [PAIR]}, {"yours": [PAIR]}  # in the order of the settings
    one = validate_request(ARRAYS, {"layouts": {**mine, **yours}})
    assert one.digest != validate_request(ARRAYS, {"layouts": {**yours, **mine}}).digest


@pytest.mark.parametrize("name", STUDIES)
def test_parameter_cells_are_written_from_the_declared_parameters(name):
    cells = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4).cells
    (cell,) = [one for one in cells if "parameters" in one.metadata.get("tags", [])]
    assert cell.source == parameter_cell(STUDIES[name]), f"run `thesis cells {name}`"


@pytest.mark.parametrize("name", COMPUTED_SETS)
def test_pages_compute_with_every_parameter_but_those_of_draws(name):
    script = read_asset("recompute.js")
    of_draws = "trials", "seed", "cube"
    assert all(field in script for field in STUDIES[name].model_fields if field not in of_draws)


def kinds(annotation):
    """The types of values that a field may hold, however deep."""
    inside = typing.get_args(annotation)
    if typing.get_origin(annotation) is typing.Literal:
        return set(map(type, inside))
    if typing.get_origin(annotation) is typing.Annotated:
        inside = inside[:1]
    if not inside:
        return {annotation}
    return set().union(*map(kinds, inside))


@pytest.mark.parametrize("model", [*STUDIES.values(), PlanRequest, *MANIFEST_PARTS.values()])
def test_every_number_has_a_unit_or_is_declared_to_have_none(model):
    for name, info in model.model_fields.items():
        if float in kinds(info.annotation):
            assert bool(unit_of_field(name)) != (name in NO_UNIT), name
        elif int in kinds(info.annotation):
            assert unit_of_field(name) in {"px", ""}, name
        else:
            assert unit_of_field(name) == "", name
