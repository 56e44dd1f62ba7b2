"""Marker centres against the projected discs, and what is hidden, cut off or not there."""

from dataclasses import replace
from functools import partial
from itertools import permutations

import numpy as np
import pytest
from refused import line_of
from scenes.discs import camera, disc_centroids

from thesis_lib.facts import setups
from thesis_lib.laboratory.render import BeamView, Sensor
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.board import on_surface, rows_on
from thesis_lib.measure.recordings.manifest import CameraFiles
from thesis_lib.measure.recordings.media_info import frame_clock
from thesis_lib.measure.tracking import follow as following, homography
from thesis_lib.measure.tracking.follow import Follower
from thesis_lib.measure.tracking.tracker import (
    Tracker,
    assign_places,
    fill_missing,
    sharpen_view,
)
from thesis_lib.measure.tracking.tracks import record_track
from thesis_lib.vibration.motion import Component, Motion
from thesis_lib.vision import pinhole

BEAM = setups.thesis_beam()
MARKERS = rows_on(BEAM)
MOTION = Motion(BEAM, (Component(), Component("torsion", 1, 6.0, 0.0005)), 0.0, 0.25)
HALF = (960, 540)
refusal = partial(line_of, homography.TrackingError)


def followed(video, at, markers, shares=(), corners=None):
    """What a video's file of tracks holds, and the notes."""
    files = CameraFiles(
        name="A", video=video.name, width_px=at.size[0], height_px=at.size[1], exposure_s=0.004,
        board_images="shots", corners_px=corners
    )  # fmt: skip
    clock, out = frame_clock(video), video.with_name(f"{len(shares)}.npy")
    folder = video.parent
    notes, _ = record_track(files, folder, clock, at, markers, 0.0, out, lambda _: None, shares)
    return np.load(out), notes


def filmed(at, times, motion=MOTION, markers=MARKERS, seed=None):
    """Frames of a camera; without a seed they have no noise."""
    beam = BeamView(at, markers, motion, Sensor(samples=4))
    rng = None if seed is None else np.random.default_rng(seed)
    return [beam.frame(t, rng) for t in times]


def truth(at, times, motion=MOTION, markers=MARKERS):
    """Centroids of the projected discs, averaged over the exposure, (frames, 2, markers)."""
    within = ((np.arange(4) + 0.5) / 4 - 0.5) * Sensor().exposure
    return np.array(
        [
            np.mean(
                [disc_centroids(at, markers, lambda p, t=t + dt: motion.deflection(p, [t])[0],
                                slice(markers.count), n=256) for dt in within], axis=0)
            for t in times
        ]
    )  # fmt: skip


def found_view(at, image, markers=MARKERS):
    return sharpen_view(image, homography.find_view(image, at, markers))


def tabulated(frames, view):
    """Centres of all frames, (frames, 2, markers), as a measurement follows them."""
    follower = Follower(Tracker(view), frames[0])
    return np.array([follower.centres(frame) for frame in frames])


def off(found, exact):
    """Distances in px."""
    return np.hypot(*(found - exact))


@pytest.fixture(scope="module")
def rest():
    """Camera, its image of the beam at rest, the view found there, and the true centres."""
    at = camera()
    (image,) = filmed(at, [-1.0])
    return at, image, found_view(at, image), truth(at, [-1.0])[0]


# Centres.


@pytest.mark.slow
def test_centres_are_those_of_the_projected_discs(conforms):
    at, times = camera(), np.arange(-1, 22) / 60
    frames = filmed(at, times)
    found = tabulated(frames, found_view(at, frames[0]))
    assert np.isfinite(found).all()
    exact = truth(at, times)
    assert np.ptp(exact[:, 1], axis=0).max() > 12  # they move
    error = found - exact
    conforms.closed_form(np.abs(error).max(), below=0.015)
    conforms.closed_form(np.sqrt(np.mean(error**2)), below=0.006)
    conforms.closed_form(np.abs(error.mean(axis=(0, 2))).max(), below=0.003)


@pytest.mark.parametrize("width", [0.016, 0.020])
def test_markers_near_both_edges_of_a_narrow_strip_are_found(conforms, width):
    strip = replace(BEAM, width=width)
    at, times, markers = camera(size=(1280, 720)), np.arange(-1, 4) / 60, rows_on(strip, rows=2)
    motion = Motion(strip, (Component(),), 0.0, 0.25)
    frames = filmed(at, times, motion, markers)
    given = pinhole.project_points(at, on_surface(markers.extent, markers.corners))
    given += 2 * np.random.default_rng(2).uniform(-1, 1, given.shape)  # px, of 10 across
    found = tabulated(frames, following.first_view(frames[0], at, markers, given.T))
    conforms.closed_form(found, truth(at, times, motion, markers), atol=0.02)


@pytest.mark.slow
def test_markers_turned_far_out_of_their_plane_are_missing_rather_than_wrong(conforms):
    # At 22° a twist of 7° makes the discs' images a third higher or lower; tables know the discs
    # as they are at rest.
    motion = Motion(BEAM, (Component(), Component("torsion", 1, 6.0, 0.002)), 0.0, 0.25)
    at, times = camera(), np.arange(-1, 22) / 60
    frames = filmed(at, times, motion)
    found = tabulated(frames, found_view(at, frames[0]))
    error = np.hypot(*(found - truth(at, times, motion)).swapaxes(0, 1))
    conforms.closed_form(np.nanmax(error), below=0.1)
    assert np.mean(np.isnan(error)) < 0.05


@pytest.mark.slow
def test_noise_moves_centres_little_more_than_it_must(conforms, rest):
    # Cramér and Rao: 1 / variance ≤ Σ (∂I/∂u)² / (0.05 I + 1), the slopes by differences.
    at, clean, view, exact = rest
    found = tabulated(filmed(at, [-1.0] * 12, seed=5), view)
    scatter = np.std(found, axis=0, ddof=1)
    for axis, step in enumerate(0.25 * np.eye(2)):
        shifted = []
        for sign in (-1, 1):
            K = at.K.copy()
            K[:2, 2] += sign * step
            shifted += filmed(replace(at, K=K), [-1.0])
        slope = (shifted[1].astype(float) - shifted[0]) / 0.5
        information = slope**2 / (0.05 * clean + 1)
        ratios = []
        for marker in range(25, 50):  # with no edge near
            u, v = np.floor(exact[:, marker]).astype(int)
            bound = information[v - 4 : v + 5, u - 8 : u + 9].sum() ** -0.5
            ratios.append(scatter[axis, marker] / bound)
        conforms.sampled(np.sqrt(np.mean(np.square(ratios))), above=0.9, below=1.5)


@pytest.mark.slow
def test_no_marker_is_taken_for_its_neighbour_in_the_next_row(conforms):
    # On the plane at rest ±4 mm look like 9.9 mm, and the rows are 10 mm apart.
    at, motion = camera(size=HALF), Motion(BEAM, (Component(),), 0.0, 0.25)
    times = np.arange(-1, 15 + 15) / 60
    exact = truth(at, times, motion)
    frames = filmed(at, times, motion, seed=1)
    view = found_view(at, frames[0])
    seen = view.to_plane(exact[:, :, MARKERS.middle_row][:, :, -1].T)
    assert np.ptp(seen[1]) > 0.018
    found = tabulated(frames, view)
    missing = np.isnan(found[:, 0])
    assert missing.mean() <= 0.03
    conforms.closed_form(np.hypot(*(found - exact).swapaxes(0, 1))[~missing].max(), below=0.25)


def test_a_motion_faster_than_the_frames_is_followed_from_rest(rest):
    """Where the frames before tell nothing, as of a decay, no row takes the place of the next."""
    _, _, view, _ = rest
    beam = Tracker(view)
    size = 1.7e-3 * BEAM.mode_shapes([2], beam.grid)[0] / BEAM.shape_peak(2)
    row = np.array([0.0, 1.0])[:, None] / np.tan(np.radians(22))
    for k in range(30):
        place = beam.grid + row * size * np.cos(2.6 * k) * 0.97**k
        found = beam._assign_matches(place[:, ::-1])
        np.testing.assert_array_equal(found, place)
        beam.before, beam.moved = beam.moved, found - beam.grid


# Hidden, cut off, doubtful.


def painted(image, where, half, grey):
    u, v = np.floor(where).astype(int)
    image = image.copy()
    image[v - half : v + half + 1, u - half : u + half + 1] = grey
    return image


@pytest.mark.parametrize(("marker", "grey"), [(0, 200), (37, 60), (49, 120)])
def test_a_hidden_marker_is_missing_and_its_neighbours_keep_their_places(
    conforms, rest, marker, grey
):
    _, image, view, exact = rest
    before = Tracker(view).centres(image)
    after = Tracker(view).centres(painted(image, exact[:, marker], 4, grey))
    assert np.isnan(after[:, marker]).all()
    others = np.arange(75) != marker
    # What covers it may touch its neighbours in the same column; they are missing or unharmed.
    near = np.abs(np.arange(75) % 25 - marker % 25) == 0
    assert np.isfinite(after[:, others & ~near]).all()
    conforms.invariance(np.nanmax(off(after, before)[others]), below=0.02)


def test_what_was_hidden_is_followed_again(conforms):
    at, times = camera(size=HALF), np.arange(-1, 40) / 60
    exact, frames = truth(at, times), filmed(at, times)
    tracker = Tracker(found_view(at, frames[0]), 2 * np.pi * Component().frequency / 60)
    for k in range(6, 12):
        frames[k] = painted(frames[k], exact[k][:, 37], 4, 200)
    for k in range(16, 19):  # and images without light
        frames[k] = np.full_like(frames[k], 60)
    follower = Follower(tracker, frames[0])
    found = np.array([follower.centres(frame) for frame in frames])
    error = np.hypot(*(found - exact).swapaxes(0, 1))
    assert np.isnan(error[6:12, 37]).all()
    assert np.isnan(error[16:19]).all()
    after = error[[*range(12, 16), *range(20, len(frames))]]
    assert np.mean(np.isnan(after)) < 0.03
    conforms.closed_form(np.nanmax(after), below=0.08)


@pytest.mark.parametrize("rows", [rows_on(replace(BEAM, n_markers=2)), rows_on(BEAM, 1, hole=None)])
def test_few_markers_and_those_on_a_line_move_as_they_are_seen(rows):
    """Where no surface can be laid through them, a missing one stays, and no other."""
    grid = rows.positions
    last, exact = np.full_like(grid, 0.001), np.stack([0 * grid[0], 0.002 + 0.1 * grid[0]])
    seen = exact.copy()
    seen[:, 1] = np.nan
    found = fill_missing(seen, grid, last)
    np.testing.assert_array_equal(np.delete(found, 1, 1), np.delete(exact, 1, 1))
    np.testing.assert_array_equal(found[:, 1], last[:, 1])


def test_without_room_for_tables_each_frame_is_searched(rest, monkeypatch):
    at, image, view, _ = rest
    monkeypatch.setattr(following, "MAX_TABLE_BYTES", 0)
    follower, searching = Follower(Tracker(view), image), Tracker(view)
    for frame in [image, *filmed(at, np.arange(2) / 60)]:
        np.testing.assert_allclose(follower.centres(frame), searching.centres(frame), atol=1e-6)


def cropped(at, image, view, left, top, right, bottom):
    """Part of an image, with the camera and the view that belong to it."""
    shift = np.array([[1, 0, -left], [0, 1, -top], [0, 0, 1.0]])
    small = replace(at, K=shift @ at.K, size=(right - left, bottom - top))
    part = np.ascontiguousarray(image[top:bottom, left:right])
    return part, replace(view, camera=small, H_image_plane=shift @ view.H_image_plane)


def test_what_the_border_cuts_off_is_missing_and_the_rest_stays(conforms, rest):
    at, image, view, exact = rest
    left = round(exact[0, 10])  # the middle of a marker
    part, own = cropped(at, image, view, left, 0, 1920, 1080)
    found = Tracker(own).centres(part) + np.array([[left], [0]])
    out, clear = exact[0] - left < 3, exact[0] - left > 16
    assert 5 < np.count_nonzero(out) < 70
    assert np.isnan(found[:, out]).all()
    assert np.isfinite(found[:, clear]).all()
    conforms.invariance(np.nanmax(off(found, Tracker(view).centres(image))), below=0.02)


def test_what_is_no_beam_gives_no_markers_and_it_comes_back(rest):
    at, image, view, _ = rest
    tracker = Tracker(view)
    tracker.centres(image)
    assert np.isnan(tracker.centres(np.full_like(image, 60))).all()
    noise = np.random.default_rng(0).integers(0, 256, image.shape, np.uint8)
    assert np.mean(np.isnan(tracker.centres(noise)[0])) > 0.95
    assert np.isfinite(tracker.centres(image)).all()
    part, own = cropped(at, image, view, 0, 800, 1920, 1080)
    assert np.isnan(Tracker(own).centres(part)).all()


def test_the_hole_is_dropped_and_takes_no_marker_s_place(rest):
    at, image, view, exact = rest
    hole = hole_px(at)
    found = Tracker(view).centres(image)
    assert found.shape == (2, 75)
    assert off(found, hole[:, None]).min() > 5
    beside = np.argsort(off(exact, hole[:, None]))[:4]
    hidden = image
    for marker in beside:
        hidden = painted(hidden, exact[:, marker], 3, 200)
    assert np.isnan(Tracker(view).centres(hidden)[:, beside]).all()


# Finding the beam.


def seen_corners(at):
    """Images of the beam's corners, in the order of its frame."""
    length, width = BEAM.extent
    world = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1], [0, 0, 0, 0]]) / 2
    return pinhole.project_points(at, world * np.array([[length], [width], [1]]))


def corners(at):
    """The same without distortion."""
    return pinhole.undistort_pixels(at, seen_corners(at))


def hole_px(at):
    """Where the hole is seen."""
    place = np.array([0.024 - BEAM.length / 2, 0.010 - BEAM.width / 2, 0])
    return pinhole.project_points(at, place)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "k1", "width", "upside_down"),
    [(10, 22, 0.2, 1920, False), (140, 15, 0.3, 960, False), (80, 22, -0.08, 960, False),
     (175, 60, 0.3, 1920, False), (-5, 15, 0.0, 640, False), (10, 22, 0.1, 1920, True),
     (190, 22, 0.1, 1920, False)],
)  # fmt: skip
def test_the_beam_and_its_clamped_end_are_found_in_any_rig_that_the_laboratory_allows(
    conforms, azimuth, elevation, k1, width, upside_down
):
    """In the fifth its markers cut it in two."""
    at = camera(azimuth, elevation, k1=k1)
    if upside_down:
        at = replace(at, R_camera_world=np.diag([-1.0, -1, 1]) @ at.R_camera_world)
    assert np.isfinite(corners(at)).all()
    (image,) = filmed(at, [-1.0])
    small = pinhole.resize_camera(at, (width, width * 9 // 16))
    view = homography.find_view(following.reduce_frame(image, width), small, MARKERS)
    found = homography.apply_homography(view.H_image_plane, MARKERS.corners)
    conforms.closed_form(off(found, corners(small)).max(), below=2)  # px


def test_pictures_that_do_not_show_the_beam_are_refused(rest):
    at, image, _, _ = rest
    spot = np.zeros((1080, 1920), np.uint8)
    spot[500:505, 700:703] = 250
    assert "too small" in refusal(homography.find_view, spot, at, MARKERS)
    refusal(found_view, at, np.full((1080, 1920), 60, np.uint8))
    hole = painted(image, hole_px(at), 5, 200)
    assert "the hole is not seen" in refusal(homography.find_view, hole, at, MARKERS)
    blank = np.where(image > 60, 200, image).astype(np.uint8)
    message = refusal(sharpen_view, blank, homography.corner_view(at, MARKERS, corners(at)))
    assert "of 76 markers" in message
    bow = np.array([[100, 1800, 100, 1800], [100, 900, 900, 100]])
    message = refusal(sharpen_view, image, homography.corner_view(at, MARKERS, bow))
    assert message.startswith("camera A: ")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (rows_on(BEAM, rows=4, row_spacing=0.0075), "one of the rows"),
        (rows_on(BEAM, row_spacing=0.007), "corners"),
        (rows_on(replace(BEAM, n_markers=24)), "of 73 markers"),
    ],
)
def test_markers_of_another_grid_are_refused(rest, wrong, said):
    at, image, _, _ = rest
    view = homography.corner_view(at, wrong, corners(at))
    message = refusal(sharpen_view, image, view)
    assert message.startswith("camera A: ")
    assert said in message


# Corners as the manifest gives them, and reduced widths.


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """A short video of camera A: at rest, then moving."""
    path, at = tmp_path_factory.mktemp("tracking") / "A.mkv", camera()
    times = np.arange(-2, 6) / 60
    media.write_video(path, filmed(at, times, seed=4), 60, np.zeros(8 * 800))
    return path, at, times


def test_given_corners_are_those_in_the_picture(conforms, rest, video):
    """They have to be given where no hole tells the clamped end, and need not be exact."""
    path, at, times = video
    px = seen_corners(at)
    assert off(px, corners(at)).max() > 5  # the lens bends them
    markers = rows_on(BEAM, hole=None)  # which is then one more dark disc
    assert "corners_px" in refusal(homography.find_view, rest[1], at, markers)
    px = px + 2.0 * np.random.default_rng(3).uniform(-1, 1, px.shape)
    given, _ = followed(path, at, markers, corners=tuple(map(tuple, px.T.tolist())))
    apart = np.linalg.norm(given - truth(at, times), axis=1)
    conforms.closed_form(apart.max(), below=0.1)


@pytest.mark.slow
def test_a_video_is_followed_at_several_widths_at_once(video):
    path, at, times = video
    widths = [320, 640, 1280, 1920]
    found, notes = followed(path, at, MARKERS, [width / 1920 for width in widths])
    assert found.shape == (len(times), 8, 2, 75)  # fitted, then by the template match alone
    found = found.swapaxes(0, 1)[:4]
    exact = truth(at, times)
    share, wrong = [], []
    for width, own in zip(widths, found, strict=True):
        error = np.hypot(*(own - exact * width / 1920).swapaxes(0, 1))
        seen = np.isfinite(error)
        share.append(seen.mean())
        wrong.append(np.mean(error[seen] > 1) if seen.any() else 0.0)
    assert share[3] == 1
    assert share[2] > 0.98
    assert share[0] < 0.6  # too few pixels, as in the thesis
    assert max(wrong[1:]) == 0
    assert all("320 px" in note for note in notes)


# The beam resampled on its plane.


@pytest.mark.slow
def test_matches_are_the_centres_to_whole_pixels_of_the_plane(conforms):
    at, times = camera(45.0, k1=0.1), np.arange(3, 7) / 60
    view = found_view(at, *filmed(at, [-1.0]))
    tracker, away = Tracker(view), []
    assert np.isnan(tracker.matched).all()
    for frame in filmed(at, times):
        centres = tracker.centres(frame)
        away.append(tracker.scale * (view.to_plane(tracker.matched) - view.to_plane(centres)))
    away = np.hypot(*np.moveaxis(away, 1, 0))  # pixels of the plane
    conforms.closed_form(np.nanmax(away), below=0.75 * np.sqrt(2))
    assert np.nanmedian(away) > 0.15
    tracker.centres(np.full((1080, 1920), 60, np.uint8))
    assert np.isnan(tracker.matched).all()


# Assignment and homographies.


@pytest.mark.parametrize("seed", range(3))
def test_the_assignment_has_the_least_sum_of_squares(conforms, seed):
    rng = np.random.default_rng(seed)
    predicted, found = rng.uniform(0, 1, (2, 5)), rng.uniform(0, 1, (2, 5))
    places = assign_places(predicted, found, gate=10.0)
    squared = np.sum((predicted[:, :, None] - found[:, None]) ** 2, axis=0)
    best = min(sum(squared[i, p[i]] for i in range(5)) for p in permutations(range(5)))
    conforms.independent(np.sum((places - predicted) ** 2), best, rtol=1e-12)
    assert np.isfinite(places).all()


def test_a_homography_is_found_from_points_some_of_them_missing(conforms):
    H = np.array([[800, 40, 900], [-30, 700, 500], [0.1, -0.2, 1.0]])
    plane = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 20))
    image = homography.apply_homography(H, plane)
    image[:, 3] = np.nan
    again = homography.apply_homography(homography.fit_homography(plane, image), plane)
    conforms.closed_form(np.delete(again - image, 3, axis=1), 0, atol=1e-3)
    image[:, 3:] = np.nan
    assert "only 3 of 20 points" in refusal(homography.fit_homography, plane, image)


def test_plane_and_picture_are_each_other_s_inverse(conforms, rest):
    at, _, _, _ = rest
    view = homography.corner_view(at, MARKERS, corners(at))
    plane = np.random.default_rng(0).uniform([[0], [0]], [[0.6], [0.03]], (2, 30))
    world = np.stack([*(plane - np.array(BEAM.extent)[:, None] / 2), np.zeros(30)])
    conforms.independent(view.to_image(plane), pinhole.project_points(at, world), atol=1e-3)
    conforms.invariance(view.to_plane(view.to_image(plane)), plane, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("light", ["by rows", "shaded"])
def test_the_beam_is_found_in_uneven_light(conforms, rest, light):
    """Of a lamp at its left, or that flickers at 100 Hz, read row by row in 16 ms."""
    at, image, _, exact = rest
    rows = 1.6 * np.arange(image.shape[0])[:, None] / image.shape[0]
    for phase in (0.0, 0.3):
        gain = 0.75 + 0.25 * np.sin(2 * np.pi * (rows + phase))
        if light == "shaded":
            gain = np.geomspace(1, 0.25, image.shape[1])
        seen = np.clip(image * gain, 0, 255).astype(np.uint8)
        found = following.first_view(seen, at, MARKERS, None)
        centres = Tracker(found).centres(seen)
        conforms.closed_form(np.nanmax(off(centres, exact)), below=0.15)
        assert np.isfinite(centres).mean() > 0.95
