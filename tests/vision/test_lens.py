"""Cameras with lens distortion against OpenCV, differences, and their own inverses."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision import pinhole
from thesis_lib.vision.pinhole import (
    Camera,
    hemisphere_directions,
    hemisphere_rotations,
    intrinsics,
)
from thesis_lib.vision.pinhole import project as ideal_project

SIZE = (1920, 1080)


def camera(distortion=(-0.1, 0.02, 1e-3, -8e-4, 0.0), size=SIZE, azimuth=0.4, elevation=0.5):
    K = intrinsics(1280.0, SIZE, skew=0.01, aspect=1.02)
    K[:2, 2] += [7.3, -11.9]
    R = hemisphere_rotations(azimuth, elevation)
    centre = 0.57 * hemisphere_directions(azimuth, elevation)
    return Camera("A", K, np.array(distortion, float), R, centre, size)


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
    conforms.invariance(
        pinhole.undistort_coordinates(pinhole.distort_coordinates(xy, distortion), distortion),
        xy,
        atol=1e-12,
    )


@given(lenses())
def test_distortion_undoes_undistortion(conforms, distortion):
    xy = field(seed=1)
    back = pinhole.distort_coordinates(pinhole.undistort_coordinates(xy, distortion), distortion)
    inside = np.isfinite(back[0])
    assert inside[np.hypot(*xy) < 0.5].all()
    conforms.invariance(back[:, inside], xy[:, inside], atol=1e-9)


@pytest.mark.parametrize("k1", [-0.3, -0.1])
def test_what_is_beyond_the_fold_has_no_undistorted_counterpart(k1):
    # x (1 + k₁x²) is largest at x² = −1 / 3k₁, where it is 2x / 3.
    fold = np.sqrt(-1 / (3 * k1))
    turn = np.array([[np.cos(0.7)], [np.sin(0.7)]])
    found = pinhole.undistort_coordinates(
        turn * np.linspace(0, 0.99, 50) * 2 * fold / 3, [k1, 0, 0, 0, 0]
    )
    assert np.all(np.hypot(*found) < fold)
    assert np.isnan(pinhole.undistort_coordinates(turn * np.linspace(1.001, 9, 3000) * 2 * fold / 3,
                                   [k1, 0, 0, 0, 0])).all()  # fmt: skip


@given(lenses(), st.integers(0, 2**32 - 1))
def test_the_jacobian_is_the_derivative_of_distortion(conforms, distortion, seed):
    xy, h = field(20, seed), 1e-5
    for j in range(2):
        step = h * np.eye(2)[j][:, None]
        numerical = pinhole.distort_coordinates(
            xy + step, distortion
        ) - pinhole.distort_coordinates(xy - step, distortion)
        conforms.independent(
            pinhole.distortion_jacobian(xy, distortion)[:, j], numerical / (2 * h), atol=1e-8
        )


@given(lenses())
def test_opencv_projects_alike_half_a_pixel_off(conforms, distortion):
    # OpenCV knows no skew.
    K = intrinsics(1280.0, SIZE, aspect=1.02)
    own = Camera("A", K, distortion, camera().R_camera_world, camera().centre, SIZE)
    theirs_K = K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    turn, _ = cv2.Rodrigues(own.R_camera_world)
    theirs, _ = cv2.projectPoints(box().T.copy(), turn, own.t, theirs_K, distortion)
    conforms.independent(pinhole.project_points(own, box()), theirs[:, 0].T + 0.5, atol=1e-9)


def test_without_distortion_a_camera_is_that_of_the_other_chapters(conforms):
    own = camera(np.zeros(5))
    conforms.independent(
        pinhole.project_points(own, box()), ideal_project(own.P[None], box())[0], atol=1e-10
    )
    np.testing.assert_array_equal(pinhole.projection_matrices([own, own])[1], own.P)


def test_undistorted_pixels_are_those_of_the_projection_matrix(conforms):
    own = camera()
    seen = pinhole.project_points(own, box())
    ideal = ideal_project(own.P[None], box())[0]
    assert np.abs(seen - ideal).max() > 10
    conforms.independent(pinhole.undistort_pixels(own, seen), ideal, atol=1e-8)


def test_pixels_and_normalised_coordinates_are_each_other_s_inverse(conforms):
    K = camera().K
    xy = field()
    conforms.closed_form(
        pinhole.to_pixels(K, xy), (K @ np.vstack([xy, np.ones(200)]))[:2], atol=1e-9
    )
    conforms.invariance(pinhole.from_pixels(K, pinhole.to_pixels(K, xy)), xy, atol=1e-14)


@pytest.mark.parametrize("size", [(960, 540), (1280, 720), (640, 360), (480, 1080)])
def test_resized_images_scale_about_their_corner(conforms, size):
    own, small = camera(), pinhole.resize_camera(camera(), size)
    scale = np.array(size) / SIZE
    conforms.invariance(
        pinhole.project_points(small, box()),
        scale[:, None] * pinhole.project_points(own, box()),
        rtol=1e-12,
    )
    assert small.size == size
    conforms.invariance(pinhole.resize_camera(small, SIZE).K, own.K, rtol=1e-15)


def test_points_behind_the_camera_have_no_image():
    own = camera()
    ahead = -own.centre
    points = np.stack([own.centre - 0.3 * ahead, own.centre + 0.3 * ahead, own.centre], axis=1)
    np.testing.assert_array_equal(
        np.isnan(pinhole.project_points(own, points)), [[True, False, True]] * 2
    )


def test_any_shape_of_points_is_kept(conforms):
    own, points = camera(), box(24)
    flat = pinhole.project_points(own, points)
    conforms.invariance(
        pinhole.project_points(own, points.reshape(3, 2, 3, 4)),
        flat.reshape(2, 2, 3, 4),
        rtol=1e-14,
    )
    again = pinhole.undistort_pixels(own, flat.reshape(2, 2, 12))
    conforms.invariance(again.reshape(2, 24), pinhole.undistort_pixels(own, flat), rtol=1e-14)


# The board.


@pytest.mark.parametrize(("columns", "rows"), [(9, 9), (7, 5)])
def test_a_board_has_its_corners_where_four_tiles_meet(conforms, columns, rows):
    board = Board(columns, rows, tile=0.02, margin=0.03)
    nx, ny = board.shape
    assert (nx, ny) == (columns - 1, rows - 1)
    grid = board.corners.reshape(3, ny, nx)
    conforms.closed_form(np.diff(grid[0], axis=1), 0.02, rtol=1e-7)
    conforms.closed_form(np.diff(grid[1], axis=0), 0.02, rtol=1e-7)
    conforms.closed_form(board.corners.sum(axis=1), 0, atol=1e-15)
    for corner in board.corners[:2].T:  # two dark tiles touch each inner corner
        touching = np.isclose(board.dark_tiles, corner, atol=1e-12).all(axis=2).any(axis=1)
        assert np.count_nonzero(touching) == 2


def test_a_board_s_tiles_fill_half_of_it_within_the_margin(conforms):
    board = Board()
    assert len(board.dark_tiles) == 41  # of 81, the corners dark
    conforms.closed_form(board.dark_tiles.min(axis=(0, 1)), -4.5 * 0.045, rtol=1e-7)
    conforms.closed_form(board.dark_tiles.max(axis=(0, 1)), 4.5 * 0.045, rtol=1e-7)
    conforms.closed_form(board.outline[2], [5.5 * 0.045] * 2, rtol=1e-7)
    x, y = board.dark_tiles.transpose(2, 0, 1)
    areas = 0.5 * np.sum(x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1), axis=1)
    conforms.closed_form(areas, 0.045**2, rtol=1e-7)
