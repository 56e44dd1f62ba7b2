"""Corners against the projections of the board that the picture was made from."""

import numpy as np
import pytest
from scenes.calibration import BOARD, exact_images, nearest_order, photograph, picture, rig

from thesis_lib.laboratory.poses import default_poses
from thesis_lib.measure.calibration.corners import BoardNotFound, find_corners
from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision.lens import resized

HALF_SIZE = (960, 540)


@pytest.fixture(scope="module")
def scenes():
    """Clean pictures and exact corners: views from 8 to 65 degrees off the board's normal."""
    cameras = [resized(camera, HALF_SIZE) for camera in rig()]
    R, t = default_poses()
    exact = exact_images(cameras, R, t)
    chosen = [(0, 0), (1, 3), (2, 5), (3, 9), (0, 4), (2, 11)]
    return [(picture(cameras[c], R[s], t[s]), exact[c, s]) for c, s in chosen]


def errors(scenes, noisy):
    return np.array(
        [
            nearest_order(find_corners(photograph(clean, i if noisy else None), BOARD), exact)
            for i, (clean, exact) in enumerate(scenes)
        ]
    )


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def test_corners_are_unbiased_without_noise(conforms, scenes):
    found = errors(scenes, noisy=False)
    conforms.closed_form(rms(found), below=0.005)
    conforms.closed_form(np.abs(found.mean(axis=2)).max(), below=0.002)


def test_corners_are_exact_to_nine_thousandths_of_a_pixel_with_noise(conforms, scenes):
    found = errors(scenes, noisy=True)
    conforms.sampled(rms(found), below=0.009)
    conforms.sampled(np.abs(found).max(), below=0.05)


def test_corners_are_ordered_as_seen_from_the_printed_side(scenes):
    for clean, _ in scenes:
        u, v = find_corners(photograph(clean), BOARD).reshape((2,) + BOARD.shape[::-1])
        along_x = np.array([u[0, -1] - u[0, 0], v[0, -1] - v[0, 0]])
        along_y = np.array([u[-1, 0] - u[0, 0], v[-1, 0] - v[0, 0]])
        assert along_x[0] * along_y[1] - along_x[1] * along_y[0] < 0


def test_darker_and_softer_pictures_give_the_same_corners(conforms, scenes):
    clean, exact = scenes[0]
    found = find_corners(photograph(0.3 * clean + 20), BOARD)
    conforms.invariance(rms(nearest_order(found, exact)), below=0.01)


def test_oblong_boards_are_found(conforms):
    board = Board(columns=6, rows=5)
    camera, (R, t) = resized(rig()[0], HALF_SIZE), default_poses()
    found = find_corners(photograph(picture(camera, R[1], t[1], board), 0), board)
    exact = exact_images([camera], R[1:2], t[1:2], board.corners)[0, 0]
    turned = exact.reshape(2, 4, 5)[:, ::-1, ::-1].reshape(2, -1)
    conforms.closed_form(min(rms(found - exact), rms(found - turned)), below=0.01)


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_a_picture_without_a_board_is_refused(grey):
    with pytest.raises(BoardNotFound, match=r"^no checkerboard seen$"):
        find_corners(np.full((200, 300), grey, np.uint8), BOARD)


def test_a_board_partly_outside_is_refused_or_right(conforms):
    camera, (R, _) = resized(rig()[0], HALF_SIZE), default_poses()
    refused = 0
    for x in (0.16, 0.2, 0.24, 0.28, 0.32):
        shift = np.array([x, 0, 0])
        exact = exact_images([camera], R[:1], shift[None])[0, 0]
        try:
            found = find_corners(photograph(picture(camera, R[0], shift, samples=16), 0), BOARD)
        except BoardNotFound:
            refused += 1
        else:
            conforms.closed_form(np.abs(nearest_order(found, exact)).max(), below=0.2)
    assert refused >= 2


def test_corners_at_the_border_are_refused(scenes):
    clean, exact = scenes[0]
    left = int(exact[0].min()) - 2
    with pytest.raises(BoardNotFound):
        find_corners(photograph(clean[:, left:]), BOARD)


def test_a_corner_that_is_hidden_is_no_corner(scenes):
    clean, exact = scenes[0]
    u, v = exact[:, 27].astype(int)
    spoiled = clean.copy()
    spoiled[v - 14 : v + 14, u - 14 : u + 14] = 200
    with pytest.raises(BoardNotFound):
        find_corners(photograph(spoiled), BOARD)


def test_pictures_in_colour_are_refused():
    with pytest.raises(ValueError, match=r"^image: given uint8 of shape \(9, 9, 3\)"):
        find_corners(np.zeros((9, 9, 3), np.uint8), BOARD)
