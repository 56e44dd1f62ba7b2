"""Pinhole cameras on a hemisphere: geometry, projection and pixels."""

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given, strategies as st

from thesis_lib.facts import setups
from thesis_lib.vision import pinhole

SIZE = (320, 180)
azimuths = st.floats(-2 * pi, 2 * pi)
elevations = st.floats(0.01, pi / 2) | st.just(pi / 2)
cameras = st.builds(
    lambda theta, phi, d: pinhole.hemisphere_cameras(d, [theta], [phi], 213.3, SIZE),
    azimuths, elevations, st.floats(0.3, 5),
)  # fmt: skip


@given(azimuths, elevations)
def test_rotations_are_right_handed_and_orthonormal(conforms, theta, phi):
    R = pinhole.hemisphere_rotations(theta, phi)
    conforms.invariance(R @ R.T, np.eye(3), atol=1e-15)
    conforms.invariance(np.linalg.det(R), 1, atol=1e-14)
    # The base edge is level, and known overhead, too; the optical axis points at the origin.
    conforms.closed_form(R[0], [-cos(theta), sin(theta), 0], atol=0)
    conforms.closed_form(R[2], -pinhole.hemisphere_directions(theta, phi), atol=1e-15)


@given(cameras)
def test_origin_projects_to_the_middle_of_the_sensor(conforms, camera):
    conforms.closed_form(pinhole.project(camera.P, np.zeros(3))[0], [160, 90], atol=1e-10)


def test_azimuth_counts_from_y_towards_x_and_elevation_from_the_plane(conforms):
    directions = pinhole.hemisphere_directions([0, pi / 2, 0.3], [0, 0, pi / 2])
    conforms.closed_form(directions, [[0, 1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


@given(cameras, st.floats(1e-3, 0.05))
def test_right_of_the_camera_is_right_in_the_image_and_up_is_up(conforms, camera, step):
    u, v = pinhole.project(camera.P, step * camera.R_camera_world[0, 0])[0]
    assert u > 160
    conforms.closed_form(v, 90, atol=1e-9)
    if np.hypot(*camera.centres[0, :2]) > 1e-3:  # not overhead, where Z is towards the camera
        assert pinhole.project(camera.P, [0, 0, step])[0, 1] < 90


def test_projection_is_focal_length_times_offset_over_depth(conforms):
    K = pinhole.intrinsics(200, SIZE, skew=0.1, aspect=1.5)
    camera = pinhole.CameraArray(K[None], np.eye(3)[None], np.array([[0.1, 0.2, -2.0]]), SIZE)
    x, y = (0.5 - 0.1) / 3, (0.3 - 0.2) / 3  # offsets over depth
    expected = [200 * (x + 0.1 * y) + 160, 200 * 1.5 * y + 90]
    conforms.closed_form(pinhole.project(camera.P, [0.5, 0.3, 1.0])[0], expected, rtol=1e-14)


@given(cameras, st.floats(0.01, 100))
def test_projection_does_not_see_the_scale_of_P(conforms, camera, factor):
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (3, 2, 4))
    uv = pinhole.project(camera.P, points)
    assert uv.shape == (1, 2, 2, 4)
    conforms.invariance(pinhole.project(-factor * camera.P, points), uv, rtol=1e-10)


def test_projection_of_many_is_that_of_each(conforms):
    array = pinhole.hemisphere_cameras(0.5, [0.1, 2.0, -1], [0.4, 0.2, 1.5], 213.3, SIZE)
    points = np.random.default_rng(1).uniform(-0.2, 0.2, (3, 5))
    many = pinhole.project(array.P, points)
    for c, p in np.ndindex(3, 5):
        image = array.P[c] @ [*points[:, p], 1]
        conforms.independent(many[c, :, p], image[:2] / image[2], rtol=1e-13)


@pytest.mark.parametrize("noise", [-1e-10, 0, 1e-10])
def test_halves_go_to_even_whatever_the_noise(conforms, noise):
    halves = np.array([-1.5, -0.5, 0.5, 1.5, 2.5, 159.5, 160.5])
    conforms.invariance(pinhole.pixelate(halves + noise), [-2, 0, 0, 2, 2, 160, 160], atol=0)
    beside = [0.5 - 1e-8, 0.5 + 1e-8, 2.5 + 1e-8, 3.5 - 1e-8]
    conforms.closed_form(pinhole.pixelate(beside), [0, 1, 3, 3], atol=0)


@given(st.floats(-3000, 3000))
def test_pixelate_is_nearest_and_idempotent(conforms, x):
    whole = float(pinhole.pixelate(x))
    assert whole == round(whole)
    conforms.closed_form(abs(x - whole), below=0.5 + 1e-9)
    assert pinhole.pixelate(whole) == whole


def test_sensor_includes_its_edge_and_nothing_beyond():
    inside = np.array([[0, 0], [320, 0], [0, 180], [320, 180], [160, 90]], float).T
    assert pinhole.on_sensor(inside[None], SIZE).all()
    outside = np.array([[-1e-6, 90], [320.001, 90], [160, -1e-6], [160, 180.001]]).T
    assert not pinhole.on_sensor(outside[None], SIZE).any()
    assert pinhole.on_sensor(np.zeros((3, 2, 4, 5)), SIZE).shape == (3, 4, 5)


@given(cameras)
def test_ground_sample_distance_moves_the_image_by_one_pixel(conforms, camera):
    step = pinhole.ground_sample_distance(camera)
    for axis in camera.R_camera_world[0, :2]:
        there, here = (pinhole.project(camera.P, k * step * axis)[0] for k in (1, 0))
        conforms.closed_form(np.linalg.norm(there - here), 1, rtol=1e-9)


def test_aperture_overhead_is_the_angle_between_the_axes(conforms):
    for setting in setups.aperture_settings(["2b", "2d"], [], [5, 20, 40, 60], 10, 500, SIZE):
        one, other = setting.cameras(24, 36).R_camera_world[:, 2]
        conforms.closed_form(np.degrees(np.arccos(one @ other)), setting.value, rtol=1e-10)


@pytest.mark.parametrize(("case", "middle"), [("2a", [0, 1]), ("2c", [-1, 0])])
def test_aperture_at_constant_elevation_is_the_difference_of_azimuths(conforms, case, middle):
    for setting in setups.aperture_settings([case], [8, 30, 55, 80], [], 10, 500, SIZE):
        ground = setting.cameras(24, 36).centres[:, :2]
        one, other = ground / np.linalg.norm(ground, axis=1)[:, None]
        conforms.closed_form(np.degrees(np.arccos(one @ other)), setting.value, rtol=1e-10)
        bisector = (one + other) / np.linalg.norm(one + other)
        conforms.closed_form(bisector, middle, atol=1e-12)


def test_focal_length_in_pixels_follows_the_sensor(conforms):
    (setting,) = setups.resolution_settings([640], 500, 30, 25)
    f, K = 640 * 24 / 36, setting.cameras(24, 36).K[0]
    conforms.closed_form(K, [[f, 0, 320], [0, f, 180], [0, 0, 1]], rtol=1e-7)
