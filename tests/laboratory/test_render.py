"""Images against exact areas, closed forms of blur and noise, and projected discs."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, strategies as st
from scenes.calibration import picture
from scenes.discs import camera, disc_centroids
from scipy.special import ndtr

from thesis_lib.facts import setups
from thesis_lib.laboratory import render
from thesis_lib.laboratory.rig import default_poses
from thesis_lib.measure.recordings.board import Board, rows_on
from thesis_lib.vibration.motion import Component, Motion

BEAM = setups.thesis_beam()
SHARP = render.Sensor(spread=0.0, samples=1)
SIZE = (40, 30)


def coverage(uv):
    polygons = render.Polygons(np.array([0]), np.array([1.0]))
    return render.rasterise_polygons(np.asarray(uv, float), polygons, *SIZE)


def star(seed, n=9, middle=(20, 15)):
    """A polygon that does not cross itself, far from convex."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, n)) + rng.uniform(0, 7)
    radius = 14 * rng.uniform(0.1, 1, n)
    return np.array(middle)[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)])


def by_intersection(uv):
    """Areas that the polygon has in common with the square of each pixel."""
    v, u = np.indices(SIZE[::-1])
    return shapely.area(
        shapely.intersection(shapely.Polygon(uv.T), shapely.box(u, v, u + 1, v + 1))
    )


SEEDS = st.integers(0, 2**32 - 1)


# Areas.


@pytest.mark.parametrize("middle", [(20, 15), (2, 28), (38.3, 4.1), (-3, 12)])
def test_coverage_is_the_area_of_the_polygon_in_each_pixel(conforms, middle):
    """Also of polygons that are partly out of the picture."""
    uv = star(0, middle=middle)
    conforms.independent(coverage(uv), by_intersection(uv), atol=1e-12)


@given(SEEDS, st.integers(3, 40))
def test_whole_coverage_is_the_area_from_any_vertex_and_either_way_round(conforms, seed, n):
    uv = star(seed, n)
    conforms.closed_form(
        coverage(uv).sum(), shapely.Polygon(uv.T).area, atol=1e-12 * SIZE[0] * SIZE[1]
    )
    conforms.invariance(coverage(uv[:, ::-1]), coverage(uv), atol=1e-13)
    conforms.invariance(coverage(np.roll(uv, 4, axis=1)), coverage(uv), atol=1e-13)


@pytest.mark.parametrize("share", [0.0, 0.25])
def test_vertices_and_sides_may_lie_on_the_borders_of_pixels(conforms, share):
    square = np.array([[3, 7, 7, 3], [2, 2, 5, 5]]) + share
    expected = np.zeros((30, 40))
    whole = [1 - share, 1, 1, 1, share]
    expected[2:6, 3:8] = np.outer([1 - share, 1, 1, share], whole)
    conforms.closed_form(coverage(square), expected, atol=1e-14)


@pytest.mark.parametrize(
    ("grey", "shot", "read"),
    [(20.0, 0.05, 1.0), (200.0, 0.05, 1.0), (150.0, 0.0, 3.0), (150.0, 0.2, 0)],
)
def test_noise_is_white_with_the_variance_of_photons_and_of_reading(conforms, grey, shot, read):
    sensor, rounding = replace(SHARP, shot=shot, read=read), 1 / 12
    uv = np.array([[50.0, 350, 350, 50], [50, 50, 250, 250]])
    polygons = render.Polygons(np.array([0]), np.array([grey - sensor.background]))
    light = render.collect_light(uv, polygons, (400, 300), sensor)
    image = light.recorded(sensor, np.random.default_rng(1)).astype(float)
    for part, level in [(image[60:240, 60:340], grey), (image[:45], 60.0)]:
        expected = shot * level + read**2 + rounding
        conforms.sampled(part.mean(), level, atol=4 * np.sqrt(expected / part.size))
        conforms.sampled(part.var(ddof=1), expected, rtol=5 * np.sqrt(2 / part.size))
        for way in [(0, 1), (1, 0), (1, 1)]:
            together = np.mean((part - level) * (np.roll(part, way, (0, 1)) - level))
            conforms.sampled(abs(together), below=5 * expected / np.sqrt(part.size))


@pytest.mark.parametrize("spread", [0.4, 1.2])
@pytest.mark.parametrize("place", [50.0, 50.3])
def test_an_edge_is_blurred_by_a_gaussian_and_the_pixel(conforms, spread, place):
    uv = np.array([[place, 350, 350, place], [50, 50, 250, 250]])
    polygons = render.Polygons(np.array([0]), np.array([140.0]))
    sensor = replace(SHARP, spread=spread)
    row = render.collect_light(uv, polygons, (400, 300), sensor).recorded(sensor)[150, 30:70]
    u = np.arange(30, 70)
    to = (np.stack([u, u + 1]) - place) / spread
    bell = np.exp(-0.5 * to**2) / np.sqrt(2 * np.pi)
    exact = 60 + 140 * spread * np.diff(to * ndtr(to) + bell, axis=0)[0]
    # The trapezoidal rule on the finer grid errs by its step squared over 12 at each kink.
    kink = 140 * np.abs(np.diff(bell, axis=0)).max() / spread
    by_grid = kink / (12 * render.SUBPIXELS_PER_PIXEL**2)
    conforms.closed_form(row, exact, atol=0.6 + by_grid)


# The beam.


def view(motion=None, sensor=None, markers=None, at=None):
    markers = markers or rows_on(BEAM)
    sensor = sensor or render.Sensor()
    return render.BeamView(at or camera(), markers, motion or Motion(BEAM), sensor)


def grey_centroids(image, where, white, half):
    """Centroids of what is missing to white about some places."""
    found = []
    for u, v in np.floor(where).astype(int).T:
        across, along = slice(v - half[1], v + half[1] + 1), slice(u - half[0], u + half[0] + 1)
        part = white - image[across, along].astype(float)
        du, dv = np.arange(-half[0], half[0] + 1) + 0.5, np.arange(-half[1], half[1] + 1) + 0.5
        moments = np.array([np.sum(part * du), np.sum(part * dv[:, None])])
        found.append([u, v] + moments / part.sum())
    return np.array(found).T


ROW_BEAM = replace(BEAM, length=0.68, width=0.06)
ROW = rows_on(ROW_BEAM, rows=1, hole=None)  # room to integrate


@pytest.mark.parametrize(("azimuth", "time"), [(-10.0, 2.3), (170.0, 2.37)])
def test_markers_are_where_their_discs_on_the_deflected_surface_project_to(conforms, azimuth, time):
    parts = (Component(), Component("torsion", 1, 6.0, 0.002))
    motion, at = Motion(ROW_BEAM, parts), camera(azimuth)
    sensor = replace(render.Sensor(), samples=1, white=250, dark=0)  # rounding matters least
    image = view(motion, sensor, ROW, at).frame(time)
    assert image.dtype == np.uint8
    assert image.shape == (1080, 1920)

    def deflection(points):
        return motion.deflection(points, np.array([time]))[0]

    exact = disc_centroids(at, ROW, deflection)
    found = grey_centroids(image, exact, 250, (10, 7))
    conforms.closed_form(found, exact, atol=0.005)
    conforms.closed_form(np.abs(np.mean(found - exact, axis=1)).max(), below=0.001)


def test_an_exposure_shrinks_a_vibration_by_sinc(conforms):
    motion, at, exposure = Motion(ROW_BEAM), camera(), 1 / 30
    peak = motion.start + 10.25 / 4.25
    sensor = replace(render.Sensor(), exposure=exposure, samples=16)
    moving = view(motion, sensor, ROW, at)

    def centroid(time):
        return disc_centroids(at, ROW, lambda p: motion.deflection(p, np.array([time]))[0], [-1])

    still, most = centroid(0.0), centroid(peak)
    times = peak + exposure * ((np.arange(200) + 0.5) / 200 - 0.5)
    mean = np.mean([centroid(t) for t in times], axis=0)
    found = grey_centroids(moving.frame(peak), mean, 200, (10, 7))
    conforms.closed_form(found, mean, atol=0.006)
    shrunk = np.linalg.norm(found - still) / np.linalg.norm(most - still)
    conforms.closed_form(shrunk, np.sinc(4.25 * exposure), atol=0.0015)


def test_a_beam_partly_out_of_view_is_the_part_of_a_larger_picture(conforms):
    at = camera(size=(1920, 1080), k1=0.0)
    shifted = replace(at, K=at.K + np.array([[0, 0, -700.0], [0, 0, -540.0], [0, 0, 0]]),
                      size=(700, 400))  # fmt: skip
    whole, part = view(at=at).frame(2.3), view(at=shifted).frame(2.3)
    assert part.max() == 200
    inside = slice(5, 395), slice(5, 695)  # the spread mirrors what is beyond the border
    off = part.astype(int) - whole[540:940, 700:1400]
    conforms.closed_form(off[inside], 0, atol=1)


# The board.


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("pose", [0, 9])
def test_a_board_is_what_counting_samples_makes_of_it(conforms, pose):
    R, t = (part[pose] for part in default_poses())
    at = camera(size=(640, 360))
    image = render.render_board(at, Board(), R, t, replace(render.Sensor(), background=90.0))
    counted = picture(at, R, t, samples=512)
    assert image.shape == (360, 640)
    difference = (image - counted)[4:-4, 4:-4]  # the spread mirrors what is beyond the border
    conforms.independent(np.abs(difference).max(), below=5)
    conforms.independent(np.sqrt(np.mean(difference**2)), below=0.3)
