"""Boards, markers and places of cameras on paper, read back from the PDF by other programs."""

import re

import cv2
import numpy as np
import pypdfium2
import pytest
import yaml
from command import refusal, thesis

from thesis_lib.laboratory.recording_files import example_manifest, example_rig
from thesis_lib.measure.calibration.corners import find_corners
from thesis_lib.measure.paper import BORDER_MM, PAGE_SIZES_MM, STRIP_MM, write_stand
from thesis_lib.measure.recordings.board import MARK_RATIO, Board, BoardSpec
from thesis_lib.measure.recordings.manifest import write_manifest

DPI = 200
PX = DPI / 25.4  # of a mm


def pages(path):
    """Grey images of all pages, and their texts."""
    document = pypdfium2.PdfDocument(str(path))
    pictures = [page.render(scale=DPI / 72, grayscale=True).to_numpy() for page in document]
    return pictures, [page.get_textpage().get_text_range() for page in document]


def made(tmp_path, *options):
    done = thesis("print", *options[:1], tmp_path / "sheet.pdf", *options[1:])
    assert (done.status, done.err) == (0, "")
    return tmp_path / "sheet.pdf", done.out


def test_a_checkerboard_has_its_true_size(conforms, tmp_path):
    options = ["--columns", "6", "--rows", "8", "--tile-mm", "30", "--paper", "A3"]
    path, said = made(tmp_path, "board", *options)
    (picture,), (text,) = pages(path)
    conforms.closed_form([*picture.shape[::-1]], np.multiply(PAGE_SIZES_MM["A3"], PX), atol=2)
    corners = find_corners(picture, Board(6, 8)).reshape(2, 7, 5)
    # To a pixel or so, 0.15 mm, since edges are drawn at whole ones.
    along, up = 30 * PX * np.arange(5), 30 * PX * np.arange(7)
    conforms.closed_form(corners[0] - corners[0, :, :1], np.tile(along, (7, 1)), atol=1.3)
    conforms.closed_form(corners[1, 0] - corners[1], np.tile(up, (5, 1)).T, atol=1.3)
    line = "board: {columns: 6, rows: 8, tile_mm: 30, "
    assert line in said
    assert line in " ".join(text.split())


def test_the_line_that_is_measured_is_100_mm_long(conforms, tmp_path):
    path, _ = made(tmp_path, "board")
    (picture,), (text,) = pages(path)
    assert "This line is 100 mm long" in text
    foot = picture[-round(22 * PX) :] < 128
    runs = [np.diff(np.flatnonzero(np.diff(np.pad(row.astype(int), 1)))) for row in foot]
    lengths = [run[::2].max() for run in runs if run.size]  # of dark pixels side by side
    conforms.closed_form(float(max(lengths)), 100 * PX, atol=0.4 * PX)


def test_a_charuco_board_is_read_by_what_is_said_of_it(conforms, tmp_path):
    path, said = made(tmp_path, "board", "--charuco", "--columns", "8")
    line = re.search(r"in the manifest: board: (\{.*\})", said)[1]
    board = BoardSpec(**yaml.safe_load(line)).board
    page = pypdfium2.PdfDocument(str(path))[0]
    picture = page.render(scale=600 / 72, grayscale=True).to_numpy()
    # As a camera sees it from aside, at a quarter of the size, for edges are drawn at whole pixels.
    view = np.array([[0.22, 0.03, 20], [-0.02, 0.19, 90], [2e-5, 3e-5, 1]])
    seen = cv2.warpPerspective(cv2.GaussianBlur(picture, (0, 0), 3), view, (1400, 1000),
                               flags=cv2.INTER_AREA, borderValue=90)  # fmt: skip
    middle = np.array(picture.shape[::-1]) / 2 - [0, STRIP_MM / 2 / 25.4 * 600]
    places = board.corners[:2] * [[1], [-1]] * 600 / 0.0254 + middle[:, None]
    u, v, w = view @ [*(places - 0.5), np.ones(places.shape[1])]
    found = find_corners(seen, board)
    conforms.independent(found, np.array([u / w, v / w]) + 0.5, atol=0.2)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
    opencv = cv2.aruco.CharucoBoard((8, 5), 25.0, 25.0 * MARK_RATIO, dictionary)
    corners, numbers, *_ = cv2.aruco.CharucoDetector(opencv).detectBoard(pages(path)[0][0])
    np.testing.assert_array_equal(numbers.ravel(), np.arange(7 * 4))
    places = PX * opencv.getChessboardCorners()[:, :2]
    apart = corners.reshape(-1, 2) - corners.reshape(-1, 2)[0]
    conforms.closed_form(apart, places - places[0], atol=1.3)


def test_the_back_of_a_board_has_tile_behind_tile(tmp_path):
    path, _ = made(tmp_path, "board", "--two-sided", "--columns", "6")
    (front, back), _ = pages(path)
    rows = slice(0, round(175 * PX))  # without the foot and its words
    assert np.mean(np.abs(front[rows, ::-1].astype(int) - back[rows]) > 60) < 2e-3
    assert np.mean(front[rows] != back[rows]) > 0.2  # six columns are no mirror image of themselves


def test_markers_are_at_their_places_on_all_pages(conforms, tmp_path):
    options = ["--columns", "16", "--rows", "8", "--spacing-mm", "30", "--diameter-mm", "9"]
    path, said = made(tmp_path, "markers", *options, "--bright")
    pictures, texts = pages(path)
    assert len(pictures) == 4
    assert "4 pages" in said
    assert "columns 10 to 16, rows 7 to 8" in " ".join(texts[3].split())
    counts = []
    for picture in pictures:
        bright = (picture > 128).astype(np.uint8)
        _, _, stats, centres = cv2.connectedComponentsWithStats(bright)
        area = np.pi / 4 * (9 * PX) ** 2
        discs = np.abs(stats[:, cv2.CC_STAT_AREA] / area - 1) < 0.03
        counts.append(discs.sum())
        u, v = centres[discs].T
        for values in (u, v):
            steps = np.diff(np.sort(values))
            conforms.closed_form(steps[steps > 5], 30 * PX, atol=0.3)
    assert sum(counts) == 16 * 8


def test_a_stand_tells_where_each_camera_is(tmp_path):
    write_manifest(example_manifest(example_rig()), tmp_path / "manifest.yaml")
    done = thesis("print", "stand", tmp_path / "manifest.yaml", tmp_path / "stand.pdf")
    assert (done.status, done.err) == (0, "")
    _, (text,) = pages(tmp_path / "stand.pdf")
    text = " ".join(text.split())
    away, above = 570 * np.cos(np.radians(26)), 570 * np.sin(np.radians(26))
    assert f"A: azimuth 12°, elevation 26°; {away:.0f} mm along its ray, {above:.0f} mm" in text
    assert "C: azimuth 175°" in text


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["board", "x.pdf", "--tile-mm", "45"], ["--tile-mm", "at most 30.33"]),
        (["board", "x.png"], ["x.png", "allowed: one that ends in .pdf"]),
        (["board", "x.pdf", "--charuco", "--two-sided"], ["--two-sided", "with --charuco"]),
        (["markers", "x.pdf", "--diameter-mm", "30"], ["--diameter-mm", "30", "below 25"]),
        (["markers", "x.pdf", "--columns", "1", "--row-spacing-mm", "60", "--diameter-mm", "50"],
         ["--diameter-mm", "50", "below 25"]),
        (["stand", "none.yaml", "x.pdf"], ["none.yaml", "no such file"]),
    ],
)  # fmt: skip
def test_what_cannot_be_printed_is_refused_in_one_line(tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    said = refusal(thesis("print", *options))
    assert all(word in said for word in words)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("paper", PAGE_SIZES_MM)
def test_a_stand_of_many_cameras_stays_above_the_ruler(tmp_path, paper):
    camera = example_manifest(example_rig()).cameras[0]
    cameras = [camera.model_copy(update={"name": f"c{k}"}) for k in range(16)]
    write_stand(tmp_path / "stand.pdf", cameras, paper)
    words = pypdfium2.PdfDocument(str(tmp_path / "stand.pdf"))[0].get_textpage()
    heights = [words.get_charbox(words.search(f"c{k}: azimuth").get_next()[0])[1] / PX * DPI / 72
               for k in range(16)]  # mm from the page's foot  # fmt: skip
    assert heights[-1] > BORDER_MM + STRIP_MM - 1
    assert np.diff(heights).max() < -2.7  # of letters of 2 mm or less
