"""Optics of one camera and of a parallel pair: closed forms against rays, projections, pixels."""

from math import hypot, pi, radians

import cv2
import numpy as np
import pytest
from hypothesis import given, strategies as st
from scenes.small import small_cube

from thesis_lib.facts import setups
from thesis_lib.figure_sets.optics import compute as optics_study
from thesis_lib.vibration.structure import world_points
from thesis_lib.vision import optics
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras, intrinsics, project
from thesis_lib.vision.triangulation import triangulate

SIZE = (320, 180)
PATTERNS = ["RGGB", "BGGR", "GRBG", "GBRG"]
lengths = st.floats(0.1, 100)
far = st.floats(1.01, 1000)  # in focal lengths


def beside(baseline, focal_px=213.3):
    """Two parallel cameras that look along Z, the second to the right of the first."""
    K = np.broadcast_to(intrinsics(focal_px, SIZE), (2, 3, 3))
    centres = np.array([[0.0, 0, 0], [baseline, 0, 0]])
    return CameraArray(K, np.broadcast_to(np.eye(3), (2, 3, 3)), centres, SIZE)


# Angles and formats.


@given(lengths, lengths, st.floats(0.3, 5))
def test_points_at_the_edges_of_the_view_are_at_the_edges_of_the_picture(
    conforms, size, focal, distance
):
    half = float(optics.angle_of_view(size, focal)) / 2
    camera = hemisphere_cameras(distance, [0.4], [0.3], focal / size * SIZE[0], SIZE)
    side, _, ahead = camera.R_camera_world[0]
    for sign, edge in ((1, SIZE[0]), (-1, 0)):
        point = camera.centres[0] + np.cos(half) * ahead + sign * np.sin(half) * side
        conforms.independent(project(camera.P, point)[0, 0], edge, atol=1e-6 * SIZE[0])


@given(lengths, lengths, lengths)
def test_crop_factor_keeps_the_diagonal_angle(conforms, width, height, focal):
    crop = float(optics.crop_factor([width, height]))
    own = optics.angle_of_view(hypot(width, height), focal)
    conforms.invariance(optics.angle_of_view(hypot(36, 24), crop * focal), own, rtol=1e-6)


# A thin lens.


@given(lengths, far, st.floats(0.01, 10))
def test_two_rays_through_a_lens_meet_in_the_image(conforms, focal, times, height):
    z = times * focal
    # From (−z, height): straight through the centre, and parallel to the axis, then by the focus.
    slopes = np.array([-height / z, -height / focal])
    behind = height / (slopes[0] - slopes[1])
    conforms.independent(optics.image_distance(focal, z), behind, rtol=1e-9)
    conforms.independent(
        optics.image_magnification(focal, z), -slopes[0] * behind / height, rtol=1e-9
    )


def spread(focal, f_number, focused, z):
    """Diameter on the sensor of the rays from a point on the axis through the lens's rim."""
    rim = focal / f_number / 2
    sensor = focal * focused / (focused - focal)
    return abs(2 * (rim + sensor * (rim / z - rim / focal)))  # the lens bends by height over f


@given(lengths, st.floats(1, 32), st.floats(1.1, 1000), st.floats(1e-4, 1e-2))
def test_rays_from_the_ends_of_the_depth_of_field_fill_the_circle(
    conforms, focal, f_number, times, share
):
    d, circle = times * focal, share * focal
    near, far_ = map(float, optics.depth_of_field(focal, f_number, d, circle))
    assert near <= d <= far_
    blur = float(optics.blur_circle(focal, f_number, d, near))
    conforms.independent(blur, circle, rtol=1e-6)
    conforms.independent(spread(focal, f_number, d, near), circle, rtol=1e-6)
    if np.isfinite(far_):
        conforms.independent(spread(focal, f_number, d, far_), circle, rtol=1e-6, atol=1e-12)
    else:  # even what is infinitely far fills less
        conforms.independent(spread(focal, f_number, d, 1e12 * focal), below=circle * (1 + 1e-6))


# Two parallel cameras.


@given(st.floats(0.01, 1), st.floats(0.3, 10), st.floats(-0.5, 0.5))
def test_disparity_is_that_of_projected_points(conforms, baseline, depth, x):
    images = project(beside(baseline).P, [x, 0.1, depth])
    disparity = images[0, 0] - images[1, 0]
    conforms.independent(
        optics.stereo_disparity(depth, baseline, 213.3), disparity, rtol=1e-9, atol=1e-9
    )
    conforms.independent(optics.stereo_depth(disparity, baseline, 213.3), depth, rtol=1e-6)


@pytest.mark.parametrize(("baseline", "depth"), [(0.05, 0.5), (0.45, 0.75)])
def test_depth_error_is_that_of_triangulation(conforms, baseline, depth):
    P = beside(baseline).P
    exact = project(P, [0.07, 0.02, depth])
    step = 1e-4
    moved = [exact + sign * step / 2 * np.array([[1, 0], [-1, 0]]) for sign in (1, -1)]
    slope = (triangulate(P, moved[0])[2] - triangulate(P, moved[1])[2]) / (2 * step)
    conforms.independent(optics.depth_error(depth, baseline, 213.3, 1.0), -slope, rtol=1e-6)


# Projections and homogeneous coordinates.


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 5), st.floats(1, 1000))
def test_the_image_behind_the_hole_is_turned_round(conforms, x, y, z, f):
    camera = beside(1.0, f)
    before = project(camera.P, [x, y, z])[0] - np.array(SIZE) / 2
    ray = np.array([x, y, z])  # through the hole at 0, to the wall at Z = −f
    behind = ray * (-f / z)
    conforms.invariance(behind[2], -f, rtol=1e-6)
    conforms.invariance(behind[:2], -before, rtol=1e-9, atol=1e-9 * f)


@given(st.floats(0, 6), st.floats(0.1, 1.5), st.floats(0.5, 3))
def test_one_depth_for_all_is_wrong_by_the_ratio_of_depths(conforms, azimuth, elevation, distance):
    beam = setups.thesis_beam()
    points = world_points(beam, np.zeros(beam.n_markers))
    camera = hemisphere_cameras(distance, [azimuth], [elevation], 213.3, SIZE)
    depth = camera.R_camera_world[0, 2] @ (points - camera.centres[0][:, None])
    middle = np.array(SIZE)[:, None] / 2
    exact, flat = (
        one[0] - middle
        for one in (project(camera.P, points), optics.weak_perspective(camera, points))
    )
    conforms.closed_form(flat, exact * depth / depth.mean(), atol=1e-9)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=4), st.floats(0.1, 10))
def test_homogeneous_coordinates_go_there_and_back(conforms, point, factor):
    triple = optics.to_homogeneous(point)
    assert triple.shape == (len(point) + 1,)
    conforms.invariance(optics.from_homogeneous(factor * triple), point, atol=1e-12)


def test_lines_join_points_and_points_join_lines(conforms):
    a, b, c = optics.to_homogeneous([[0, 1], [2, 5], [3, 1]])
    line, other = optics.join_homogeneous(a, b), optics.join_homogeneous(a, c)
    assert [float(line @ a), float(line @ b)] == [0, 0]
    conforms.closed_form(
        optics.from_homogeneous(optics.join_homogeneous(line, other)), [0, 1], rtol=1e-7
    )
    parallel = optics.join_homogeneous(*optics.to_homogeneous([[0, 3], [2, 7]]))
    meeting = optics.join_homogeneous(line, parallel)
    assert meeting[2] == 0
    assert meeting[1] / meeting[0] == 2  # the direction of both


# Pixels.


def test_coarse_pixels_keep_the_mean_and_split_the_variance(conforms):
    picture = np.random.default_rng(1).random((60, 120, 3))
    for block in (1, 2, 3, 4, 20):
        coarse = optics.block_means(picture, block)
        assert coarse.shape == (60 // block, 120 // block, 3)
        conforms.invariance(coarse.mean(axis=(0, 1)), picture.mean(axis=(0, 1)), rtol=1e-7)
        repeated = coarse.repeat(block, axis=0).repeat(block, axis=1)
        within = np.mean((picture - repeated) ** 2, axis=(0, 1))
        conforms.invariance(coarse.var(axis=(0, 1)) + within, picture.var(axis=(0, 1)), rtol=1e-7)


# Colours.


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_mosaic_records_one_colour_per_pixel(pattern):
    masks = optics.bayer_masks((6, 8), pattern)
    assert (masks.sum(axis=-1) == 1).all()
    assert masks.sum(axis=(0, 1)).tolist() == [12, 24, 12]
    assert "".join("RGB"[c] for c in masks[:2, :2].argmax(axis=-1).ravel()) == pattern
    picture = np.random.default_rng(3).random((6, 8, 3))
    mosaic = optics.bayer_mosaic(picture, pattern)
    np.testing.assert_array_equal(mosaic, picture[masks].reshape(6, 8))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_demosaicing_is_exact_where_colours_change_linearly(conforms, pattern):
    row, column = np.indices((9, 12))[..., None]
    picture = np.array([0.1, 0.2, 0.3]) + np.array([0.02, 0.01, -0.01]) * row + column * 0.03
    found = optics.demosaic_image(optics.bayer_mosaic(picture, pattern), pattern)
    conforms.closed_form(found[1:-1, 1:-1], picture[1:-1, 1:-1], rtol=1e-7)
    assert np.abs(found - picture).max() > 0.005  # at the border it is not


@pytest.mark.parametrize("pattern", PATTERNS)
def test_demosaicing_is_that_of_opencv(pattern):
    mosaic = np.random.default_rng(5).integers(0, 60_000, (20, 30)).astype(np.uint16)
    theirs = cv2.demosaicing(mosaic, getattr(cv2, f"COLOR_Bayer{pattern}2RGB"))
    found = optics.demosaic_image(mosaic, pattern)
    assert np.abs(found - theirs)[1:-1, 1:-1].max() <= 1  # theirs are whole numbers


# The drawn picture.


def test_markers_are_drawn_where_they_are_and_as_large_as_they_are(conforms):
    beam = setups.thesis_beam()
    picture = optics_study.draw_beam(beam, 0.5, radians(30), radians(25), 24 / 36, 0.005)
    points = world_points(beam, np.zeros(beam.n_markers))
    images = project(picture.camera.P, points)[0]
    steps = [project(picture.camera.P, points + step)[0] - images
             for step in ([[1e-6], [0], [0]], [[0], [1e-6], [0]])]  # fmt: skip
    areas = np.abs(np.linalg.det(np.moveaxis(steps, -1, 0))) * 1e12 * pi * 0.0025**2
    assert ((images[0] > 5) & (images[0] < 1275)).all()
    conforms.independent(picture.markers.sum(), areas.sum(), rtol=0.01)
    centres = picture.centroids(picture.colours(1), 1)
    conforms.independent(centres.T, images - [[0], [picture.top]], atol=0.1)
    conforms.independent(
        picture.images(beam.markers[0], 1), images - [[0], [picture.top]], rtol=1e-7
    )


# The study.


def test_pairs_with_whole_pixels_meet_the_first_order_where_disparities_are_large(conforms):
    cube = small_cube("cameras")
    ratio = (cube["rounded_depth_error"] / cube["rounding_depth_error"]).values
    ratio = ratio[cube["disparity"].values > 20]
    error = np.sqrt((2.4 - 1) / 200) / 2  # of an rms over 200; a triangle's kurtosis is 2.4
    assert len(ratio) > 50
    conforms.sampled(np.abs(ratio - 1).max(), below=4 * error)


def test_parallel_edges_meet_in_the_image_of_their_direction(conforms):
    cube = small_cube("cameras")
    camera = hemisphere_cameras(1.0, [radians(30)], [radians(25)], 24 / 36 * 320, SIZE)
    direction = camera.K[0] @ camera.R_camera_world[0] @ [1, 0, 0]
    for point in cube["vanishing_point"].values:
        conforms.closed_form(point, direction[:2] / direction[2], rtol=1e-8)
    angle = cube["edge_angle"].values
    assert (np.diff(angle) < 0).all()
