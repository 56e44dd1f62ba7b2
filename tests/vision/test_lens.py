"""Cameras with lens distortion against OpenCV, differences, and their own inverses."""

import cv2
import numpy as np
import pytest
from hypothesis import given, strategies as st

from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision import pinhole

SIZE = (1920, 1080)


def camera(distortion=(-0.1, 0.02, 1e-3, -8e-4, 0.0), size=SIZE, azimuth=0.4, elevation=0.5):
    K = pinhole.intrinsics(1280.0, SIZE, skew=0.01, aspect=1.02)
    K[:2, 2] += [7.3, -11.9]
    R = pinhole.hemisphere_rotations(azimuth, elevation)
    centre = 0.57 * pinhole.hemisphere_directions(azimuth, elevation)
    return pinhole.Camera("A", K, np.array(distortion, float), R, centre, size)


def box(n=50, seed=0):
    """Points near the origin, where the beam lies."""
    limits = np.array([0.31, 0.05, 0.05])[:, None]
    return np.random.default_rng(seed).uniform(-limits, limits, (3, n))


def field(n=200, seed=0):
    """Normalised coordinates over the view of a 24 mm lens on 36 mm, and some beyond."""
    return np.random.default_rng(seed).uniform([[-0.8], [-0.5]], [[0.8], [0.5]], (2, n))


@st.composite
def lenses(draw):
    k1, k2, k3 = (draw(st.floats(-most, most)) for most in (0.15, 0.05, 0.02))
    p1, p2 = (draw(st.floats(-2e-3, 2e-3)) for _ in range(2))
    return np.array([k1, k2, p1, p2, k3])


@given(lenses())
def test_undistortion_undoes_distortion(conforms, distortion):
    xy = field()
    there = pinhole.distort_coordinates(xy, distortion)
    conforms.invariance(pinhole.undistort_coordinates(there, distortion), xy, atol=1e-12)
    back = pinhole.distort_coordinates(pinhole.undistort_coordinates(xy, distortion), distortion)
    inside = np.isfinite(back[0])
    assert inside[np.hypot(*xy) < 0.5].all()
    conforms.invariance(back[:, inside], xy[:, inside], atol=1e-9)


def test_what_is_beyond_the_fold_has_no_undistorted_counterpart():
    # x (1 + k₁x²) is largest at x² = −1 / 3k₁, where it is 2x / 3.
    lens = [-0.3, 0, 0, 0, 0]
    fold = np.sqrt(1 / 0.9)
    most = np.array([[np.cos(0.7)], [np.sin(0.7)]]) * 2 * fold / 3
    found = pinhole.undistort_coordinates(most * np.linspace(0, 0.99, 50), lens)
    assert np.all(np.hypot(*found) < fold)
    beyond = pinhole.undistort_coordinates(most * np.linspace(1.001, 9, 3000), lens)
    assert np.isnan(beyond).all()


@given(lenses(), st.integers(0, 2**32 - 1))
def test_the_jacobian_is_the_derivative_of_distortion(conforms, distortion, seed):
    xy, h = field(20, seed), 1e-5
    for j in range(2):
        step = h * np.eye(2)[j][:, None]
        one, other = (pinhole.distort_coordinates(xy + s, distortion) for s in (step, -step))
        found = pinhole.distortion_jacobian(xy, distortion)[:, j]
        conforms.independent(found, (one - other) / (2 * h), atol=1e-8)


@given(lenses())
def test_opencv_projects_alike_half_a_pixel_off(conforms, distortion):
    # OpenCV knows no skew.
    K = pinhole.intrinsics(1280.0, SIZE, aspect=1.02)
    own = pinhole.Camera("A", K, distortion, camera().R_camera_world, camera().centre, SIZE)
    theirs_K = K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    turn, _ = cv2.Rodrigues(own.R_camera_world)
    theirs, _ = cv2.projectPoints(box().T.copy(), turn, own.t, theirs_K, distortion)
    conforms.independent(pinhole.project_points(own, box()), theirs[:, 0].T + 0.5, atol=1e-9)


def test_without_distortion_a_camera_is_that_of_the_other_chapters(conforms):
    own = camera(np.zeros(5))
    ideal = pinhole.project(own.P[None], box())[0]
    conforms.independent(pinhole.project_points(own, box()), ideal, atol=1e-10)
    np.testing.assert_array_equal(pinhole.projection_matrices([own, own])[1], own.P)


@pytest.mark.parametrize("size", [(960, 540), (480, 1080)])
def test_resized_images_scale_about_their_corner(conforms, size):
    own, small = camera(), pinhole.resize_camera(camera(), size)
    images, scale = pinhole.project_points(own, box()), np.array(size) / SIZE
    conforms.invariance(pinhole.project_points(small, box()), scale[:, None] * images, rtol=1e-12)
    assert small.size == size
    conforms.invariance(pinhole.resize_camera(small, SIZE).K, own.K, rtol=1e-15)


# The board.


def test_a_board_has_its_corners_where_four_tiles_meet(conforms):
    board = Board(7, 5, tile=0.02, margin=0.03)
    assert board.shape == (6, 4)
    grid = board.corners.reshape(3, 4, 6)
    conforms.closed_form(np.diff(grid[0], axis=1), 0.02, rtol=1e-7)
    conforms.closed_form(np.diff(grid[1], axis=0), 0.02, rtol=1e-7)
    conforms.closed_form(board.corners.sum(axis=1), 0, atol=1e-15)
    for corner in board.corners[:2].T:  # two dark tiles touch each inner corner
        touching = np.isclose(board.dark_tiles, corner, atol=1e-12).all(axis=2).any(axis=1)
        assert np.count_nonzero(touching) == 2
