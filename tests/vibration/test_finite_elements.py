"""Plates by finite elements, against closed forms, orders of convergence and invariances."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from skfem import Basis, MeshTri

from thesis_lib.facts import setups
from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.vibration.finite_elements import facets_along, locate_points, plate_modes
from thesis_lib.vibration.morley import Morley
from thesis_lib.vibration.panel import Panel
from thesis_lib.vibration.polygons import (
    Circle,
    divide_hole,
    is_simple,
    mesh_outline,
    polygon_area,
    polygon_contains,
)
from thesis_lib.vibration.structure import (
    cantilever_roots,
    deflection_shape,
    modal_coordinates,
    peak_deflection,
)

PLATE = setups.thesis_plate()
L, W = PLATE.extent
RECTANGLE = ((0.0, 0.0), (L, 0.0), (L, W), (0.0, W))
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
ELL = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.5, 0.5), (0.5, 1.0), (0.0, 1.0))
HOLES = (Circle(0.2, 0.28, 0.06), ((0.4, 0.27), (0.56, 0.30), (0.50, 0.37)))


def panel(outline=RECTANGLE, holes=(), support="simply supported", **changes):
    """A panel of the plate's thickness and material."""
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


def orders(errors):
    """Of errors on meshes, each with sides half as long as the one before."""
    return [math.log2(abs(one) / abs(other)) for one, other in pairwise(errors)]


def twice_areas(mesh):
    a, b, c = mesh.p[:, mesh.t].transpose(1, 0, 2)
    return np.abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


# Closed forms.


def test_simply_supported_rectangle_converges_with_order_2(conforms):
    waves = [(m / L) ** 2 + (n / W) ** 2 for m in range(1, 6) for n in range(1, 6)]
    exact = np.sort((np.pi**2 * np.array(waves)) ** 2)[:4]
    mesh, errors = mesh_outline(RECTANGLE, (), 0.03), []
    for _ in range(3):
        errors.append(eigenvalues(mesh, "simply supported") / exact - 1)
        mesh = mesh.refined()
    for errors_of_mode in np.array(errors).T:
        conforms.order(orders(errors_of_mode), 2, atol=0.1)
    conforms.closed_form(errors[-1], 0, atol=0.006)


@pytest.mark.parametrize("far", [0.0, 1e3])
def test_element_has_the_values_and_slopes_that_its_coefficients_say(conforms, far):
    corners = np.array([[0.0, 0.9, 1.1, 0.3], [0.0, -0.2, 0.7, 0.8]])
    mesh = MeshTri(corners + far, np.array([[0, 1, 2], [0, 2, 3]]).T)
    mapping, element = mesh.mapping(), Morley()
    for i in range(6):
        value = element.gbasis(mapping, np.array([[0.0, 1, 0], [0, 0, 1]]), i)[0]
        conforms.closed_form(value, np.eye(6)[i][None, :3].repeat(2, axis=0), atol=1e-12)
    # slopes: the quadratic that has those of x² + 3xy - y² has its curvature
    basis = Basis(mesh, element, intorder=4)
    x, y = mesh.p - far
    a, b = (mesh.p[:, mesh.facets] - far).transpose(1, 0, 2)
    (mx, my), (tx, ty) = (a + b) / 2, (b - a) / np.hypot(*(b - a))
    w = np.zeros(basis.N)
    w[basis.nodal_dofs[0]] = x**2 + 3 * x * y - y**2
    w[basis.facet_dofs[0]] = (2 * mx + 3 * my) * ty - (3 * mx - 2 * my) * tx
    hess = basis.interpolate(w).hess
    conforms.closed_form(hess[..., 0].T, np.array([[[2.0, 3], [3, -2]]] * 2), atol=1e-9)


@pytest.mark.slow
def test_small_triangles_cost_no_digits(conforms):
    """Frequencies stay when corners are renumbered and moved, though one side is 15 µm long."""
    given = FIGURE_SETS["shape-holes"].request().structure
    mesh = mesh_outline(given.outline, given.holes, given.element_size)
    order = np.random.default_rng(1).permutation(mesh.p.shape[1])
    new = np.ascontiguousarray(np.argsort(order)[mesh.t])
    other = MeshTri(np.ascontiguousarray(mesh.p[:, order]) + 0.3, new)
    one, two = (eigenvalues(each, "simply supported") for each in (mesh, other))
    conforms.invariance(two / one, 1, atol=1e-13)


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


def test_clamped_square_has_the_eigenvalues_of_the_literature(conforms):
    # A. W. Leissa, Vibration of Plates (NASA SP-160, 1969): ω a² √(m/D) = 35.99, 73.41, 108.27
    mesh = mesh_outline(SQUARE, (), 0.1)
    found = []
    for _ in range(3):
        mesh = mesh.refined()
        found.append(np.sqrt(eigenvalues(mesh, "clamped")))
    limit = found[-1] + (found[-1] - found[-2]) / 3  # of order 2
    conforms.closed_form(limit, [35.985, 73.394, 73.394, 108.22], rtol=3e-4)
    conforms.order(orders([one[0] - 35.985 for one in found]), 2, atol=0.1)


@pytest.mark.parametrize("poisson", [0.0, 1e-3])
def test_cantilever_strip_is_a_beam_if_it_does_not_contract_across(conforms, poisson):
    length, width = 1.0, 0.05
    strip = ((0.0, 0.0), (length, 0.0), (length, width), (0.0, width))
    one = panel(strip, support=("free", "free", "free", "clamped"), poisson=poisson,
                element_size=0.0125, force_position=(0.9, 0.02), grid=(30, 3))  # fmt: skip
    beam = (cantilever_roots(3) / length) ** 2 * np.sqrt(
        one.youngs_modulus * one.thickness**2 / 12 / one.density
    )
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


@pytest.mark.parametrize("support", ["clamped", "simply supported"])
def test_frequencies_of_an_l_fall_with_the_square_of_its_size(conforms, support):
    small = panel(ELL, support=support, element_size=0.05)
    large = panel(tuple((2 * x, 2 * y) for x, y in ELL), support=support, element_size=0.1)
    ratio = small.angular_frequencies(5) / large.angular_frequencies(5)
    conforms.invariance(ratio, 4, rtol=1e-6)


@pytest.mark.parametrize("support", ["clamped", "simply supported"])
@pytest.mark.parametrize("matrix", [[[0.6, -0.8], [0.8, 0.6]], [[-1, 0], [0, 1]]])
def test_a_turned_or_mirrored_mesh_has_the_same_eigenvalues(conforms, support, matrix):
    mesh = mesh_outline(ELL, (Circle(0.2, 0.3, 0.1),), 0.06)
    turned = MeshTri(np.array(matrix, float) @ mesh.p, mesh.t)
    conforms.invariance(eigenvalues(turned, support), eigenvalues(mesh, support), rtol=1e-7)


def test_a_mirrored_or_turned_l_that_is_meshed_anew_has_nearly_the_same_frequencies(conforms):
    mirrored = tuple((1 - x, y) for x, y in ELL)
    turned = tuple((1 - y, x) for x, y in ELL)
    plain, *others = (
        panel(outline, support="clamped", element_size=0.025, force_position=(0.6, 0.2))
        for outline in (ELL, mirrored, turned)
    )
    for other in others:
        ratio = other.angular_frequencies(4) / plain.angular_frequencies(4)
        conforms.invariance(ratio, 1, atol=0.002)
    conforms.invariance(plain.mass, others[0].mass, rtol=1e-12)


def test_sense_and_first_corner_of_an_outline_do_not_matter(conforms):
    one = panel(ELL)
    for other in (ELL[::-1], ELL[2:] + ELL[:2]):
        ratio = panel(other).angular_frequencies(4) / one.angular_frequencies(4)
        conforms.invariance(ratio, 1, atol=0.004)


def test_clamping_raises_and_freeing_an_edge_lowers_every_frequency():
    free = panel(ELL, support=("free", *["simply supported"] * 5)).angular_frequencies(6)
    held = panel(ELL).angular_frequencies(6)
    clamped = panel(ELL, support="clamped").angular_frequencies(6)
    assert np.all(free < held)
    assert np.all(held < clamped)


def test_shapes_are_orthogonal_with_mean_square_1(conforms):
    one = panel(holes=HOLES[1:], element_size=0.01)
    mesh = mesh_outline(one.outline, one.holes, one.element_size)
    corners = mesh.p[:, mesh.t]  # (2, 3, triangles)
    weights = np.tile(twice_areas(mesh) / 6, 3)  # exact for quadratics: three points inside
    points = np.concatenate([(corners.sum(axis=1) + 3 * corners[:, i]) / 6 for i in range(3)], 1)
    shapes = one.mode_shapes(range(1, 7), points)
    gram = (shapes * weights) @ shapes.T / weights.sum()
    conforms.independent(gram, np.eye(6), atol=1e-3)


def test_points_are_found_in_the_triangles_they_are_in(conforms):
    """Where corners' coordinates are averaged by the weights, the points come out again."""
    one = panel(ELL, element_size=0.03)
    mesh = mesh_outline(one.outline, one.holes, one.element_size)
    rng = np.random.default_rng(0)
    inside = rng.uniform((0, 0), one.extent, (3000, 2)).T
    corners, middles = mesh.p, mesh.p[:, mesh.facets].mean(axis=1)
    points = np.concatenate([inside[:, one.covers(inside)], corners, middles], axis=1)
    cells, weights = locate_points(mesh, points)
    assert weights.min() >= 0
    back = np.einsum("ikn,kn->in", mesh.p[:, mesh.t[:, cells]], weights)
    conforms.independent(back, points, atol=1e-12)


@pytest.mark.slow
def test_a_small_hole_changes_nothing(conforms):
    plain = panel(element_size=0.015).angular_frequencies(4)
    off = [
        np.max(np.abs(panel(element_size=0.015, holes=(Circle(0.25, 0.2, radius),))
                      .angular_frequencies(4) / plain - 1))
        for radius in (0.05, 0.02, 0.005, 0.001)
    ]  # fmt: skip
    assert all(one > other for one, other in pairwise(off))
    conforms.invariance(off[-1], below=5e-4)
    assert off[0] > 0.01


def test_grading_at_the_corner_pays_where_the_solution_is_singular():
    finest = np.sqrt(eigenvalues(mesh_outline(ELL, (), 0.02, 12), "simply supported", 1))[0]
    off = [
        1 - np.sqrt(eigenvalues(mesh_outline(ELL, (), 0.05, halvings), "simply supported", 1))[0]
        / finest
        for halvings in (0, 3, 9)
    ]  # fmt: skip
    assert off[0] > 1.5 * off[1] > 2 * off[2] > 0


# Meshes.


def test_triangles_fill_the_region_and_no_more(conforms):
    for size in (0.05, 0.02, 0.01):
        mesh = mesh_outline(RECTANGLE, HOLES, size, halvings=0)
        corners = mesh.p[:, mesh.t]
        twice = twice_areas(mesh)
        wanted = polygon_area(RECTANGLE) - sum(
            abs(polygon_area(divide_hole(hole, size))) for hole in HOLES
        )
        graded = mesh_outline(RECTANGLE, HOLES, size)
        for areas in (twice, twice_areas(graded)):
            conforms.independent(np.abs(areas).sum() / 2, wanted, rtol=1e-9)
        assert graded.t.shape[1] > mesh.t.shape[1]
        sides = np.array([np.hypot(*(corners[:, i] - corners[:, i - 1])) for i in range(3)])
        quality = 4 * np.sqrt(3) * np.abs(twice) / 2 / np.sum(sides**2, axis=0)  # 1 if equilateral
        assert quality.min() > 0.2
        assert np.median(quality) > 0.9


def test_pieces_of_a_circle_approach_its_area_with_order_2(conforms):
    circle = Circle(0.0, 0.0, 1.0)
    off = [math.pi - polygon_area(divide_hole(circle, size)) for size in (0.1, 0.05, 0.025)]
    conforms.order(orders(off), 2, atol=0.05)


@pytest.mark.parametrize(
    ("polygon", "simple"),
    [
        (ELL, True),
        (((0, 0), (1, 1), (1, 0), (0, 1)), False),  # a bow
        (((0, 0), (2, 0), (1, 0), (1, 1)), False),  # folded back
        (((0, 0), (1, 0), (1, 1), (0.5, 0), (0, 1)), False),  # a corner on an edge
    ],
)
def test_crossing_edges_are_found(polygon, simple):
    assert is_simple(polygon) is simple


def test_points_are_in_a_polygon_by_its_winding():
    points = np.random.default_rng(0).uniform(-0.2, 1.2, (2, 400))
    x, y = points
    box = (x > 0) & (x < 1) & (y > 0) & (y < 1)
    np.testing.assert_array_equal(polygon_contains(ELL, points), box & ~((x > 0.5) & (y > 0.5)))


# A structure as the others.


def test_markers_in_holes_and_off_the_outline_are_left_out():
    one = panel(holes=HOLES)
    x, y = one.markers
    assert np.all(np.hypot(x - 0.2, y - 0.28) >= 0.06)
    assert not polygon_contains(HOLES[1], one.markers).any()
    everywhere = PLATE.markers
    assert one.markers.shape[1] == one.covers(everywhere).sum() < everywhere.shape[1]
    ell = panel(ELL, grid=(10, 10))
    assert ell.markers.shape[1] == 75


def test_shapes_are_nan_off_the_panel_and_have_the_shape_of_the_points():
    one = panel(holes=HOLES)
    points = np.array([[[0.2, 0.05], [-0.1, L]], [[0.28, 0.05], [0.1, W / 2]]])
    shapes = one.mode_shapes([1, 2], points)
    assert shapes.shape == (2, 2, 2)
    np.testing.assert_array_equal(np.isnan(shapes[0]), [[True, False], [True, False]])
    assert shapes[0, 1, 1] == pytest.approx(0, abs=0.01)  # on a supported edge


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


def test_peak_of_the_deflection_is_the_given_one():
    one = panel(holes=HOLES, grid=(60, 60))
    for mode in (1, 2, 3):
        deflection = deflection_shape(one, mode, one.markers, peak=0.01)
        assert np.max(np.abs(deflection)) == pytest.approx(0.01, rel=0.03)


@pytest.mark.slow
def test_static_response_obeys_reciprocity(conforms):
    here, there = (0.1, 0.1), (0.5, 0.1)
    one, other = panel(ELL, force_position=here), panel(ELL, force_position=there)
    q, q_ = (modal_coordinates(p, 0.0, 20) for p in (one, other))
    w = q @ one.mode_shapes(range(1, 21), other.force_point)
    w_ = q_ @ one.mode_shapes(range(1, 21), one.force_point)
    conforms.invariance(w, w_, rtol=1e-12)


def test_the_same_panel_gives_the_same_modes():
    one, other = (panel(ELL, damping=xi) for xi in (0.02, 0.03))  # not from the cache
    points = one.markers
    np.testing.assert_array_equal(one.mode_shapes([3], points), other.mode_shapes([3], points))


# What is refused.

BOW = ((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0))
NAN = ((0.0, 0.0), (1.0, float("nan")), (1.0, 1.0))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"outline": BOW}, ["outline", "meet at their common corners"]),
        ({"outline": NAN, "supports": ("clamped",) * 3}, ["outline", "finite"]),
        ({"outline": RECTANGLE[:2], "supports": ("clamped",) * 2}, ["outline", "3 corners"]),
        ({"outline": tuple((x + 1, y) for x, y in RECTANGLE)}, ["outline", "(0, 0)"]),
        ({"holes": (Circle(0.9, 0.2, 0.05),)}, ["holes", "inside the outline"]),
        ({"holes": (Circle(0.03, 0.2, 0.05),)}, ["holes", "inside the outline"]),
        ({"holes": (((0.5, 0.2), (0.8, 0.2), (0.5, 0.3)),)}, ["holes", "inside the outline"]),
        ({"holes": (Circle(0.2, 0.2, 0.05), Circle(0.28, 0.2, 0.05))}, ["holes", "not touch"]),
        ({"holes": (HOLES[1], Circle(0.5, 0.31, 0.001))}, ["holes", "not touch"]),
        ({"holes": (HOLES[1], HOLES[1])}, ["holes", "not touch"]),
        ({"holes": (Circle(0.2, 0.2, 0.0),)}, ["holes", "radius above 0"]),
        ({"holes": (Circle(0.2, float("inf"), 0.1),)}, ["holes", "finite"]),
        ({"supports": ("free",) * 4}, ["supports", "clamped edge"]),
        ({"supports": ("simply supported", *["free"] * 3)}, ["supports", "one line"]),
        ({"supports": ("clamped",) * 3}, ["supports", "4 edges"]),
        ({"supports": ("glued",) * 4}, ["supports", "clamped"]),
        ({"force_position": (0.2, 0.28), "holes": HOLES}, ["force_position", "on the panel"]),
        ({"force_position": (float("nan"), 0.1)}, ["force_position", "finite"]),
        ({"grid": (1, 2)}, ["grid", "fewer than 3"]),
        ({"grid": (0, 2)}, ["grid", "from 1"]),
        ({"thickness": 0.0}, ["thickness", "above 0"]),
        ({"density": float("nan")}, ["density", "above 0"]),
        ({"poisson": 0.5}, ["poisson", "below 0.5"]),
        ({"damping": -0.1}, ["damping", "from 0"]),
        ({"element_size": 0.0}, ["element_size", "above 0"]),
        ({"element_size": 0.001}, ["element_size", "200 to 60000"]),
        ({"element_size": 0.2}, ["element_size", "200 to 60000"]),
    ],
)
def test_what_is_no_panel_is_refused_in_one_line(changes, words):
    with pytest.raises(ValueError, match=words[0]) as error:
        panel(**changes)
    message = str(error.value)
    assert "\n" not in message
    assert all(word in message for word in [*words, "given", "allowed"])


def test_modes_that_there_are_not_are_refused():
    one = panel()
    for given in ([0, 1], [-1]):
        with pytest.raises(ValueError, match="modes: given"):
            one.mode_shapes(given, one.markers)
    with pytest.raises(ValueError, match="n_modes: given 0"):
        one.angular_frequencies(0)
