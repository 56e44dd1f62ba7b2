"""Figure sets of plates without symmetry: cubes, pictures, and what a mirror does."""

import numpy as np
import pytest
import xarray as xr

from thesis_lib.facts import setups
from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.display import as_svg
from thesis_lib.figure_sets.parametric import figures as shape_figures
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.planning.positions import build_body
from thesis_lib.planning.structure_file import export_modes, read_body, write_modes
from thesis_lib.plotting.selection import viewer_data
from thesis_lib.studies import schema
from thesis_lib.vibration.polygons import polygon_area
from thesis_lib.vibration.structure import deflection_shape
from thesis_lib.web.html import copy_plain

NAMES = ("shape-l", "shape-holes")
QUICK = {"trials": 20, "element_mm": 20.0}
ROWS, COLUMNS = 10, 15


def made(name, **values):
    quick = {} if name == shape_figures.PLATE_SET else QUICK
    return cube_of(validate_request(name, {**quick, **values}))


@pytest.fixture(scope="module")
def opened():
    return {name: made(name, trials=40) for name in (shape_figures.PLATE_SET, *NAMES)}


# Cubes and what is drawn of them.


@pytest.mark.parametrize("name", NAMES)
def test_cube_is_that_of_a_camera_study_with_the_markers_on_the_panel(opened, name):
    cube, panel = opened[name], validate_request(name, QUICK).structure
    assert set(cube.dims) == {"setting", "mode", "trial", "point", "camera", "corner", "xy"}
    assert cube.sizes["setting"] == opened[shape_figures.PLATE_SET].sizes["setting"]
    np.testing.assert_allclose([cube["x"], cube["y"]], panel.markers)
    hertz = panel.angular_frequencies(3) / (2 * np.pi)
    np.testing.assert_allclose(cube["frequency"], hertz)
    for m, mode in enumerate(cube["mode"].values):
        wanted = deflection_shape(panel, int(mode), panel.markers, peak=0.01)
        np.testing.assert_allclose(cube["reference_deflection"][m], wanted)
    assert not any(np.isnan(cube[v]).any() for v in ("measured_deflection", "predicted_error"))


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("name", NAMES)
def test_the_law_of_rounding_needs_no_symmetry(conforms, name):
    cube = made(name, cases=["4a", "4c"], trials=400)
    rms = np.sqrt((cube["mean_error"].isel(trial=slice(1, None)) ** 2).mean("trial"))
    conforms.sampled(rms / cube["predicted_error"], 1, atol=0.03)


def test_a_rectangle_by_finite_elements_is_measured_as_the_plate_is(conforms):
    outline = [[0, 0], [668, 0], [668, 443], [0, 443]]
    values = {"cases": ["4c"], "trials": 100}
    by_elements = made("shape-l", outline_mm=outline, **(values | {"element_mm": 10.0}))
    closed = made(shape_figures.PLATE_SET, **values)
    ratio = by_elements["predicted_error"].values / closed["predicted_error"].values
    conforms.closed_form(ratio, 1, atol=0.005)


@pytest.mark.parametrize("name", NAMES)
def test_viewer_leaves_cells_without_marker_empty(opened, name):
    data = copy_plain(viewer_data(opened[name]))
    assert data["structure"]["kind"] == "plate"
    assert data["grid"] == [COLUMNS, ROWS]
    markers = opened[name].sizes["point"]
    for shape in (
        data["modes"][0]["reference_mm"],
        data["cases"][2]["settings"][1]["modes"][0]["measured_mm"],
        data["cases"][2]["settings"][1]["modes"][0]["point_error"],
    ):
        assert len(shape) == ROWS * COLUMNS
        assert sum(value is not None for value in shape) == markers
    cube, point = opened[name], markers - 1
    column = np.argmin(np.abs(np.array(data["x_mm"]) - 1000 * float(cube["x"][point])))
    row = np.argmin(np.abs(np.array(data["y_mm"]) - 1000 * float(cube["y"][point])))
    given = data["modes"][1]["reference_mm"][row * COLUMNS + column]
    assert given == pytest.approx(1000 * float(cube["reference_deflection"][1, point]), rel=1e-5)


def test_contours_are_those_of_the_request_and_turn_opposite_ways_around_holes(conforms):
    outline = [[0, 0], [500, 0], [300, 400], [0, 400]]
    values = {"outline_mm": outline, "circles_mm": [[150, 200, 60]], "cases": ["4c"], "trials": 1}
    cube = made("shape-holes", cutouts_mm=[], **values)
    curves = schema.structure_contours(cube)
    np.testing.assert_allclose(curves[0] + [0.25, 0.2], np.array(outline) / 1000)
    assert polygon_area(curves[0]) > 0 > polygon_area(curves[1])
    conforms.closed_form(abs(polygon_area(curves[1])), np.pi * 0.06**2, rtol=0.02)
    drawn = viewer_data(cube)["structure"]
    assert (drawn["length_mm"], drawn["width_mm"]) == (500, 400)
    assert [len(curve) for curve in drawn["contours_mm"]] == [4, 24]
    assert "<svg" in as_svg(cube, "4c", 1)


# What a mirror does.


def test_mirrored_markers_err_alike_where_plate_cameras_and_mode_are_mirror_images(opened):
    plate = opened[shape_figures.PLATE_SET]
    rows = np.isin(plate["case"].values, shape_figures.MIRRORED_CASES)
    deflection = plate["measured_deflection"].values[rows].reshape(rows.sum(), 3, -1, ROWS, COLUMNS)
    alike = np.abs(deflection - deflection[..., ::-1]) < shape_figures.MAX_ROUNDING_M
    nominal, trials = alike[:, :, 0], alike[:, :, 1:]
    assert nominal[:, [0, 2]].all()  # modes (1, 1) and (1, 2)
    assert nominal[:, 1].mean() < 0.2  # mode (2, 1) is not symmetric in X = 0
    assert trials.mean() < 0.2


def test_mirrored_markers_err_alike_in_mirrored_cases_of_the_rectangle_alone(opened):
    plate, ell = opened[shape_figures.PLATE_SET], opened["shape-l"]
    assert shape_figures.compare_with_law(plate, "4a")["same"] > 2 / 3
    for cube, case in ((plate, "4c"), (ell, "4a")):
        assert shape_figures.compare_with_law(cube, case)["same"] < 0.2


def test_convergence_of_the_page_has_order_2(conforms):
    text = shape_figures.compare_convergence({})
    orders = [float(cell) for cell in text.splitlines()[-1].strip("| ").split(" | ")[1:]]
    conforms.order(orders, 2, atol=0.1)


# Files for others.


@pytest.mark.parametrize(
    "structure",
    [setups.thesis_beam(), setups.thesis_plate(), validate_request(NAMES[1], QUICK).structure],
)
def test_modes_are_written_with_places_from_the_middle(structure, tmp_path):
    path = write_modes(structure, [2, 1], tmp_path / "modes.nc")
    with xr.open_dataset(path) as read:
        assert {v: read[v].dims for v in ("x", "y", "z", "shape", "frequency")} == {
            "x": ("point",), "y": ("point",), "z": ("point",), "shape": ("mode", "point"),
            "frequency": ("mode",),
        }  # fmt: skip
        half = np.array(structure.extent)[:, None] / 2
        np.testing.assert_allclose(np.stack([read["x"], read["y"]]) + half, structure.markers)
        wanted = [deflection_shape(structure, m, structure.markers, peak=1.0) for m in (2, 1)]
        np.testing.assert_allclose(read["shape"], wanted)
        hertz = structure.angular_frequencies(2) / (2 * np.pi)
        np.testing.assert_allclose(read["frequency"], hertz[::-1])
        assert all(read[v].attrs["units"] and read[v].attrs["long_name"] for v in read.variables)
    assert export_modes(structure, [1]).sizes["mode"] == 1
    body, direct = read_body(path, [1, 2]), build_body(structure, "direct", [1, 2])
    for name in ("points", "normals", "frequencies"):
        np.testing.assert_allclose(getattr(body, name), getattr(direct, name), atol=1e-15)
    largest = np.max(np.abs(direct.shapes), axis=1, keepdims=True)  # a file knows markers alone
    np.testing.assert_allclose(body.shapes, direct.shapes / largest)
