"""Plates by finite elements, against closed forms, orders of convergence and invariances."""

from dataclasses import replace

import numpy as np
import pytest
from refused import line_of
from scenes.convergence import orders
from skfem import MeshTri

from thesis_lib.facts import setups
from thesis_lib.vibration import polygons
from thesis_lib.vibration.finite_elements import facets_along, plate_modes
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.structure import cantilever_roots, peak_deflection

PLATE = setups.thesis_plate()
L, W = PLATE.extent
RECTANGLE = ((0.0, 0.0), (L, 0.0), (L, W), (0.0, W))
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
ELL = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.5, 0.5), (0.5, 1.0), (0.0, 1.0))
HOLES = (polygons.Circle(0.2, 0.28, 0.06), ((0.4, 0.27), (0.56, 0.30), (0.50, 0.37)))


def panel(outline=RECTANGLE, holes=(), support="simply supported", **changes):
    supports = (support,) * len(outline) if isinstance(support, str) else support
    given = Panel(
        outline, supports, holes, PLATE.thickness, PLATE.density, PLATE.youngs_modulus,
        PLATE.poisson, PLATE.damping, (0.06, 0.05), PLATE.grid, 0.02,
    )  # fmt: skip
    return replace(given, **changes)


def eigenvalues(mesh, support, n=4, poisson=0.3):
    edge = mesh.boundary_facets()
    held = {"clamped": (edge, edge[:0]), "simply supported": (edge[:0], edge)}[support]
    return plate_modes(mesh, *held, poisson, n).eigenvalues


def twice_areas(mesh):
    a, b, c = mesh.p[:, mesh.t].transpose(1, 0, 2)
    return np.abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


# Closed forms.


def test_simply_supported_rectangle_converges_with_order_2(conforms):
    waves = [(m / L) ** 2 + (n / W) ** 2 for m in range(1, 6) for n in range(1, 6)]
    exact = np.sort((np.pi**2 * np.array(waves)) ** 2)[:4]
    mesh, errors = polygons.mesh_outline(RECTANGLE, (), 0.03), []
    for _ in range(3):
        errors.append(eigenvalues(mesh, "simply supported") / exact - 1)
        mesh = mesh.refined()
    conforms.order(orders(errors), 2, atol=0.1)
    conforms.closed_form(errors[-1], 0, atol=0.006)


@pytest.mark.slow
def test_panel_that_is_the_plate_has_its_frequencies_shapes_and_signs(conforms):
    one = panel(element_size=0.01)
    modes = [1, 2, 3, 4, 5, 6]
    ratio = one.angular_frequencies(6) / PLATE.angular_frequencies(6)
    conforms.closed_form(ratio, 1, atol=0.005)
    shapes = one.mode_shapes(modes, PLATE.markers)
    conforms.closed_form(shapes, PLATE.mode_shapes(modes, PLATE.markers), atol=0.005)
    conforms.closed_form(one.mass, PLATE.mass, rtol=1e-12)
    conforms.closed_form(one.shape_peak(1), 2, atol=0.004)
    same = replace(one, force_position=PLATE.force_position)
    conforms.closed_form(peak_deflection(same, 1), peak_deflection(PLATE, 1), rtol=0.005)
    conforms.closed_form(one.modal_density([1, 9]), PLATE.modal_density([1, 9]), rtol=1e-12)


@pytest.mark.slow
def test_clamped_square_has_the_eigenvalues_of_the_literature(conforms):
    # A. W. Leissa, Vibration of Plates (NASA SP-160, 1969): ω a² √(m/D) = 35.99, 73.41, 108.27
    mesh = polygons.mesh_outline(SQUARE, (), 0.1)
    found = []
    for _ in range(3):
        mesh = mesh.refined()
        found.append(np.sqrt(eigenvalues(mesh, "clamped")))
    limit = found[-1] + (found[-1] - found[-2]) / 3  # of order 2
    conforms.closed_form(limit, [35.985, 73.394, 73.394, 108.22], rtol=3e-4)
    conforms.order(orders(np.array(found)[:, 0] - 35.985), 2, atol=0.1)


def test_cantilever_strip_is_a_beam_if_it_does_not_contract_across(conforms):
    length, width = 1.0, 0.05
    strip = ((0.0, 0.0), (length, 0.0), (length, width), (0.0, width))
    one = panel(strip, support=("free", "free", "free", "clamped"), poisson=0.0,
                element_size=0.0125, force_position=(0.9, 0.02), grid=(30, 3))  # fmt: skip
    stiffness = one.youngs_modulus * one.thickness**2 / 12 / one.density
    beam = (cantilever_roots(3) / length) ** 2 * np.sqrt(stiffness)
    found = one.angular_frequencies(10)
    bending = [found[np.argmin(np.abs(found - wanted))] for wanted in beam]
    conforms.closed_form(np.array(bending) / beam, 1, atol=[1e-3, 2e-3, 6e-3])
    conforms.closed_form(one.shape_peak(1), 2, rtol=0.01)


def test_free_edges_of_a_clamped_square_have_the_eigenvalues_of_the_literature(conforms):
    # A. W. Leissa, J. Sound Vib. 31, 1973: one side clamped, three free, ν = 0.3
    found = []
    for n in (8, 16, 32):
        steps = np.linspace(0, 1, n + 1)
        mesh = MeshTri.init_tensor(steps, steps)
        clamped = facets_along(mesh, (0, 0), (0, 1))
        modes = plate_modes(mesh, clamped, clamped[:0], 0.3, 3)
        found.append(np.sqrt(modes.eigenvalues))
    limit = found[-1] + (found[-1] - found[-2]) / 3  # of order 2
    conforms.closed_form(limit, [3.471, 8.507, 21.285], rtol=6e-4)
    other = plate_modes(mesh, clamped, clamped[:0], 0.0, 3)  # which shows that ν matters there
    assert np.all(np.abs(np.sqrt(other.eigenvalues) / found[-1] - 1) > 0.003)


# Invariances.


def test_frequencies_of_an_l_fall_with_the_square_of_its_size(conforms):
    small = panel(ELL, support="clamped", element_size=0.05)
    large = panel(tuple((2 * x, 2 * y) for x, y in ELL), support="clamped", element_size=0.1)
    ratio = small.angular_frequencies(5) / large.angular_frequencies(5)
    conforms.invariance(ratio, 4, rtol=1e-6)


@pytest.mark.parametrize("support", ["clamped", "simply supported"])
def test_a_turned_and_mirrored_mesh_has_the_same_eigenvalues(conforms, support):
    mesh = polygons.mesh_outline(ELL, (polygons.Circle(0.2, 0.3, 0.1),), 0.06)
    turned = MeshTri(np.array([[-0.6, 0.8], [0.8, 0.6]]) @ mesh.p, mesh.t)
    conforms.invariance(eigenvalues(turned, support), eigenvalues(mesh, support), rtol=1e-7)


def test_shapes_are_orthogonal_with_mean_square_1(conforms):
    one = panel(holes=HOLES[1:], element_size=0.0125)
    mesh = polygons.mesh_outline(one.outline, one.holes, one.element_size)
    corners = mesh.p[:, mesh.t]  # (2, 3, triangles)
    weights = np.tile(twice_areas(mesh) / 6, 3)  # exact for quadratics: three points inside
    points = np.concatenate([(corners.sum(axis=1) + 3 * corners[:, i]) / 6 for i in range(3)], 1)
    shapes = one.mode_shapes(range(1, 7), points)
    gram = (shapes * weights) @ shapes.T / weights.sum()
    conforms.independent(gram, np.eye(6), atol=1e-3)


@pytest.mark.slow
def test_a_small_hole_changes_nothing(conforms):
    plain = panel(element_size=0.02).angular_frequencies(4)
    large, small = (
        panel(element_size=0.02, holes=(polygons.Circle(0.25, 0.2, radius),)).angular_frequencies(4)
        for radius in (0.05, 0.001)
    )
    conforms.invariance(np.max(np.abs(small / plain - 1)), below=5e-4)
    assert np.max(np.abs(large / plain - 1)) > 0.01


# Meshes.


def test_triangles_fill_the_region_and_no_more(conforms):
    for size in (0.05, 0.02):
        mesh = polygons.mesh_outline(RECTANGLE, HOLES, size, halvings=0)
        corners = mesh.p[:, mesh.t]
        twice = twice_areas(mesh)
        holes = [polygons.polygon_area(polygons.divide_hole(hole, size)) for hole in HOLES]
        wanted = polygons.polygon_area(RECTANGLE) - np.abs(holes).sum()
        graded = polygons.mesh_outline(RECTANGLE, HOLES, size)
        for areas in (twice, twice_areas(graded)):
            conforms.independent(np.abs(areas).sum() / 2, wanted, rtol=1e-9)
        assert graded.t.shape[1] > mesh.t.shape[1]
        sides = np.array([np.hypot(*(corners[:, i] - corners[:, i - 1])) for i in range(3)])
        quality = 4 * np.sqrt(3) * np.abs(twice) / 2 / np.sum(sides**2, axis=0)  # 1 if equilateral
        assert quality.min() > 0.2
        assert np.median(quality) > 0.9


# A structure as the others.


def test_markers_in_holes_and_off_the_outline_are_left_out():
    one = panel(holes=HOLES)
    x, y = one.markers
    assert np.all(np.hypot(x - 0.2, y - 0.28) >= 0.06)
    assert (polygons.polygon_depths(HOLES[1], one.markers) <= 0).all()
    everywhere = PLATE.markers
    assert one.markers.shape[1] == one.covers(everywhere).sum() < everywhere.shape[1]
    ell = panel(ELL, grid=(10, 10))
    assert ell.markers.shape[1] == 75
    shapes = one.mode_shapes([1, 2], np.array([[0.2, 0.05, -0.1, L], [0.28, 0.05, 0.1, W / 2]]))
    np.testing.assert_array_equal(np.isnan(shapes[0]), [True, False, True, False])
    assert shapes[0, 3] == pytest.approx(0, abs=0.01)  # on a supported edge


def test_points_on_slanting_edges_are_on_the_panel():
    corners = np.array([[0.0, 0.0], [0.5, 0.0], [0.3, 0.4], [0.0, 0.37]])
    hole = np.array([[0.1, 0.1], [0.2, 0.13], [0.12, 0.2]])
    one = panel(
        tuple(map(tuple, corners)), (tuple(map(tuple, hole)),), support="clamped",
        force_position=(0.05, 0.05),
    )  # fmt: skip
    share = np.linspace(0, 1, 41)[:, None, None]
    for polygon, most in ((corners, 0.03), (hole, 3.0)):
        points = (polygon + share * (np.roll(polygon, -1, axis=0) - polygon)).reshape(-1, 2).T
        assert one.covers(points).all()
        shapes = np.abs(one.mode_shapes([1, 2], points))
        assert np.max(shapes) < most  # clamped outside, free inside
    assert np.min(shapes[0]) > 0.1


# What is refused.


BOW = ((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0))
TANGENT_CIRCLES = (polygons.Circle(0.35, 0.1, 0.03), polygons.Circle(0.395, 0.16, 0.045))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"outline": BOW}, ["outline", "meet at their common corners"]),
        ({"outline": (*RECTANGLE[:3], (0.3, 0.0), RECTANGLE[3])}, ["outline", "meet at"]),
        ({"outline": ((0, 0), (1, np.nan), (1, 1), (0, 1))}, ["outline", "finite"]),
        ({"outline": tuple((x + 1, y) for x, y in RECTANGLE)}, ["outline", "(0, 0)"]),
        ({"holes": (polygons.Circle(0.03, 0.2, 0.05),)}, ["holes", "inside the outline"]),
        ({"holes": (((0.1, 0.1), (0.3, 0.0), (0.3, 0.1)),)}, ["holes", "inside the outline"]),
        ({"holes": (HOLES[1], ((0.45, 0.29), (0.5, 0.3), (0.48, 0.32)))}, ["holes", "not touch"]),
        ({"holes": TANGENT_CIRCLES}, ["holes", "not touch"]),
        ({"holes": (polygons.Circle(0.2, 0.2, 0.0),)}, ["holes", "radius above 0"]),
        ({"supports": ("simply supported", *["free"] * 3)}, ["supports", "one line"]),
        ({"supports": ("clamped",) * 3}, ["supports", "4 edges"]),
        ({"force_position": (0.2, 0.28), "holes": HOLES}, ["force_position", "on the panel"]),
        ({"grid": (1, 2)}, ["grid", "fewer than 3"]),
        ({"poisson": 0.5}, ["poisson", "below 0.5"]),
        ({"element_size": 0.001}, ["element_size", "200 to 60000"]),
    ],
)
def test_what_is_no_panel_is_refused_in_one_line(changes, words):
    line = line_of(ValueError, lambda: panel(**changes))
    assert all(word in line for word in [*words, "given", "allowed"]), line
