"""Corners against the projections of the board that the image was made from."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes.calibration import BOARD, exact_images, nearest_order, photograph, picture, rig
from scipy.spatial.transform import Rotation

from thesis_lib.laboratory.rig import default_poses
from thesis_lib.measure.calibration.corners import BoardNotFound, find_corners
from thesis_lib.measure.recordings.board import Board
from thesis_lib.vision.pinhole import Camera, resize_camera

HALF_SIZE = (960, 540)
MARKED = Board(8, 6, 0.045, 0.045, mark=0.0315)


@pytest.fixture(scope="module")
def scenes():
    """Clean images and exact corners: views from 8 to 65 degrees off the board's normal."""
    cameras = [resize_camera(camera, HALF_SIZE) for camera in rig()]
    R, t = default_poses()
    exact = exact_images(cameras, R, t)
    chosen = [(0, 0), (1, 3), (3, 9), (0, 4)]
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


@pytest.mark.slow
@pytest.mark.parametrize(("noisy", "most"), [(False, 0.005), (True, 0.009)])
def test_corners_are_exact_and_unbiased(conforms, scenes, noisy, most):
    found = errors(scenes, noisy)
    conforms.sampled(rms(found), below=most)
    conforms.sampled(np.abs(found).max(), below=0.05)
    if not noisy:
        conforms.closed_form(np.abs(found.mean(axis=2)).max(), below=0.002)


@pytest.mark.parametrize(("blur", "most"), [(0.05, 0.1), (1.2, 0.03)])  # px
def test_corners_are_found_whatever_the_spread(conforms, blur, most):
    """Edges along the pixels are ramps under a lens that spreads no light, unlike the fit's."""
    K = np.array([[760, 0, 320], [0, 760, 180], [0, 0, 1.0]])
    facing = Rotation.from_euler("xz", [180, 0.3], degrees=True).as_matrix()
    centre, board = np.array([0.02, -0.03, 0.9]), Board(9, 9, 0.028, 0.020)
    camera = Camera("S", K, np.zeros(5), facing, centre, (640, 360))
    R, t = np.eye(3), np.zeros(3)
    found = find_corners(photograph(picture(camera, R, t, board, blur=blur), 0), board)
    exact = exact_images([camera], R[None], t[None], board.corners)[0, 0]
    conforms.sampled(rms(np.hypot(*nearest_order(found, exact))), below=most)


# Boards with marks: each corner is known by them, wherever it is.


@pytest.fixture(scope="module")
def marked():
    """A clean image of such a board, nearly as large as it is, and its exact corners."""
    camera, (R, t) = resize_camera(rig()[1], HALF_SIZE), default_poses()
    exact = exact_images([camera], R[3:4], t[3:4], MARKED.corners)[0, 0]
    return picture(camera, R[3], t[3], MARKED), exact


@pytest.mark.slow
def test_corners_between_marks_are_as_exact_as_without_them(conforms, marked):
    """Whether the board begins with a dark tile or, as those by older programs, a light one."""
    clean, exact = marked
    camera, (R, t) = resize_camera(rig()[1], HALF_SIZE), default_poses()
    for image in (clean, picture(camera, R[3], t[3], MARKED, legacy=True)):
        off = find_corners(photograph(image), MARKED) - exact
        conforms.closed_form(rms(off), below=0.005)
        conforms.closed_form(np.abs(off.mean(axis=1)).max(), below=0.002)
    for seed in range(3):
        conforms.sampled(rms(find_corners(photograph(clean, seed), MARKED) - exact), below=0.009)


@pytest.mark.parametrize("side", ["left", "bottom"])
def test_a_board_with_marks_may_be_cut_off(conforms, marked, side):
    clean, exact = marked
    axis, end = (0, False) if side == "left" else (1, True)
    low, high = exact[axis].min(), exact[axis].max()
    cut = round((0.35 * low + 0.65 * high) if end else (0.65 * low + 0.35 * high))
    part = np.s_[:cut] if end else np.s_[cut:]
    image = photograph(clean[:, part] if axis == 0 else clean[part], 1)
    found = find_corners(image, MARKED)
    found[axis] += 0 if end else cut
    seen = np.isfinite(found[0])
    assert 12 <= seen.sum() < 0.7 * len(seen)
    inside = exact[axis] - cut
    assert not seen[(inside > 0) == end].any()
    conforms.sampled(rms((found - exact)[:, seen]), below=0.009)


def test_corners_beside_a_covered_mark_are_not_seen(conforms, marked):
    clean, exact = marked
    spoiled = clean.copy()
    u, v = exact.reshape(2, 5, 7)[:, 2:4, 2:4].mean(axis=(1, 2)).astype(int)  # of a light tile
    spoiled[v - 8 : v + 8, u - 8 : u + 8] = 200
    found = find_corners(photograph(spoiled), MARKED)
    gone = np.isnan(found[0])
    np.testing.assert_array_equal(np.flatnonzero(gone), [16, 17, 23, 24])
    conforms.closed_form(rms((found - exact)[:, ~gone]), below=0.005)


@pytest.mark.parametrize(
    ("change", "words"),
    [({}, "0 marks of DICT_5X5_1000 seen, but 24 mirrored: it is seen from the back, .*"),
     ({"dictionary": "DICT_6X6_250"},
      "0 marks of DICT_6X6_250 seen, but 24 of DICT_5X5_250; 0 .* 8 × 6 tiles, needs 12"),
     ({"columns": 7},
      "24 marks of DICT_5X5_1000 seen; 0 corners .* as on .* 7 × 6 tiles, needs 12"),
     ({"mark": 0.0}, "a corner's edges misfit by [0-9]+% of the contrast, allowed 60%")],
)  # fmt: skip
def test_another_board_with_marks_is_refused_by_what_is_seen(marked, change, words):
    image = photograph(marked[0] if change else np.ascontiguousarray(marked[0][:, ::-1]))
    with pytest.raises(BoardNotFound, match=f"^{words}$"):
        find_corners(image, replace(MARKED, **change))


# Images as cameras make them, and boards as people print them.


@pytest.mark.slow
def test_sharpened_images_give_the_same_corners(conforms, scenes, marked):
    def sharpened(image):
        soft = cv2.GaussianBlur(image.astype(float), (0, 0), 1.0)
        return np.clip(np.rint(image + 4 * (image - soft)), 0, 255).astype(np.uint8)

    clean, exact = scenes[0]
    found = find_corners(sharpened(photograph(clean, 1)), BOARD)
    conforms.sampled(rms(nearest_order(found, exact)), below=0.06)  # noise is five times as much
    found = find_corners(sharpened(photograph(marked[0], 1)), MARKED)
    conforms.sampled(rms(found - marked[1]), below=0.06)


@pytest.mark.parametrize("scale", [0.5, 2])
def test_a_slightly_bent_board_is_found_at_any_size(scenes, scale):
    clean, exact = scenes[0]
    (u, v), size = exact.mean(axis=1), np.ptp(exact[0])
    y, x = np.indices(clean.shape, np.float32)
    along = (x - u + 0.4 * (y - v)) / size
    bent = (y + 0.02 * size / 7 * np.cos(9 * along)).astype(np.float32)  # 2 % of a tile
    image = photograph(cv2.remap(clean.astype(np.float32), x, bent, cv2.INTER_LINEAR), 0)
    image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    assert np.isfinite(find_corners(image, BOARD)).all()


def test_boards_printed_white_on_black_are_read(conforms, scenes, marked):
    for board, (clean, exact) in ((BOARD, scenes[0]), (MARKED, marked)):
        found = find_corners(255 - photograph(clean, 1), board)
        off = found - exact if board.mark else nearest_order(found, exact)
        conforms.sampled(rms(off), below=0.012)


@pytest.mark.parametrize("tiles", [(8, 9), (6, 6)])
def test_a_larger_board_than_expected_is_refused(scenes, tiles):
    with pytest.raises(BoardNotFound):
        find_corners(photograph(scenes[0][0]), Board(*tiles))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spoiled", "words"),
    [
        (lambda image: cv2.blur(image, (25, 1)), "the edges are blurred unevenly, as by motion"),
        (lambda image: cv2.GaussianBlur(image, (0, 0), 8), "the image is blurred: edges are wider"),
        (lambda image: np.full_like(image, 128), "^no checkerboard seen$"),
    ],
)
def test_a_moving_a_blurred_or_no_board_is_refused(scenes, spoiled, words):
    with pytest.raises(BoardNotFound, match=words):
        find_corners(spoiled(photograph(scenes[0][0], 0)), BOARD)


def test_a_corner_with_something_before_it_is_refused_or_right(scenes):
    clean, exact = scenes[0]
    u, v = exact[:, 27].astype(int)
    for size in (4, 12):
        spoiled = clean.copy()
        spoiled[v : v + size, u : u + size] = 200
        try:
            found = find_corners(photograph(spoiled, 0), BOARD)
        except BoardNotFound:
            continue
        assert np.abs(nearest_order(found, exact)).max() < 1
    hidden = clean.copy()
    hidden[v - 14 : v + 14, u - 14 : u + 14] = 200
    with pytest.raises(BoardNotFound):
        find_corners(photograph(hidden), BOARD)
