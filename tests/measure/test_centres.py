"""What pixels see of blurred discs and edges, and the fit, against quadrature and SciPy's fit."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import least_squares
from scipy.special import ndtr

from thesis_lib.measure.recordings.markers import Markers
from thesis_lib.measure.tracking import centres
from thesis_lib.measure.tracking.centres import refine
from thesis_lib.measure.tracking.homography import View
from thesis_lib.measure.tracking.profiles import Profiles
from thesis_lib.vision.lens import Camera

BLURS = [0.15, 0.3, 0.6, 1.5]


def pixel(offset, blur):
    """What a pixel sees of a blurred point or line at an offset from its centre."""
    return ndtr((offset + 0.5) / blur) - ndtr((offset - 0.5) / blur)


def disc(u, v, ellipse, blur, rings=24, spokes=120):
    """Blurred disc in pixels (rows, columns) at u and v from its centre, ring by ring."""
    radius, weight = np.polynomial.legendre.leggauss(rings)
    radius, weight = (radius + 1) / 2, weight / 2
    angle = 2 * np.pi * np.arange(spokes) / spokes
    unit = radius * np.stack([np.cos(angle), np.sin(angle)])[:, :, None]
    x, y = np.tensordot(ellipse, unit, axes=1).reshape(2, -1)
    area = np.abs(np.linalg.det(ellipse)) * 2 * np.pi / spokes * weight * radius
    area = np.broadcast_to(area, (spokes, rings)).ravel()
    return (area * pixel(v[:, None] - y, blur)) @ pixel(u[:, None] - x, blur).T


@pytest.mark.parametrize("blur", BLURS)
@pytest.mark.parametrize("ellipse", [[[5.0, 0.4], [-0.3, 2.1]], [[2.0, 1.5], [1.0, -4.0]]])
def test_discs_are_what_pixels_see_of_them(conforms, blur, ellipse):
    ellipse, size = np.array(ellipse), (25, 31)
    middle = np.array([[15.0], [12.0]])
    seen = np.empty((2, 6, *size), np.float32)
    offsets = np.random.default_rng(1).uniform(-1, 1, (2, 2))
    tables = Profiles(blur, size)
    centres._Discs(tables, np.array([ellipse] * 2)).see(middle + offsets, seen)
    for got, (du, dv) in zip(seen, offsets.T, strict=True):
        u, v = np.arange(31) - 15 - du, np.arange(25) - 12 - dv
        many = {"rings": int(8 / blur) + 16, "spokes": int(50 / blur) + 40}
        conforms.closed_form(got[centres.DISC], disc(u, v, ellipse, blur, **many), atol=2e-4)
        for part, (su, sv) in ((centres.DU, (1e-4, 0)), (centres.DV, (0, 1e-4))):
            slope = (
                disc(u - su, v - sv, ellipse, blur, **many)
                - disc(u + su, v + sv, ellipse, blur, **many)
            ) / 2e-4
            conforms.closed_form(got[part], slope, atol=1e-3)


@pytest.mark.parametrize("blur", BLURS)
def test_an_edge_is_what_pixels_see_of_it(conforms, blur):
    inward = np.linspace(-4, 4, 41)
    share, slope = Profiles(blur, (5, 5)).step(inward.astype(np.float32))
    exact = [
        quad(lambda t, d=d: ndtr((d + t) / blur), -0.5, 0.5, epsabs=1e-10, points=[0, -d])[0]
        if abs(d) < 0.5
        else quad(lambda t, d=d: ndtr((d + t) / blur), -0.5, 0.5, epsabs=1e-10)[0]
        for d in inward
    ]
    conforms.closed_form(share, exact, atol=2e-6 / blur**2)
    conforms.closed_form(slope, pixel(inward, blur), atol=5e-6 / blur**2 + 5e-6)


def bench(noise, seed):
    """Three markers on a wide beam before a level camera, each off its place, and their picture."""
    scale, blur = 3000.0, 0.6  # px/m, px
    markers = Markers((0.2, 0.08), np.array([[0.05, 0.1, 0.15], [0.04] * 3]), 0.004)
    K = np.array([[1000.0, 0, 320], [0, 1000, 120], [0, 0, 1]])
    at = Camera("A", K, np.zeros(5), np.eye(3), np.zeros(3), (640, 240))
    view = View(at, markers, np.diag([scale, scale, 1]) + [[0, 0, 20], [0, 0, 0], [0, 0, 0]], blur)
    rng = np.random.default_rng(seed)
    true = view.to_image(markers.centres) + rng.uniform(-0.3, 0.3, (2, 3))
    ellipse = scale * 0.002 * np.eye(2)
    image = np.full((240, 640), 200.0)
    for u, v in true.T:
        dark = disc(np.arange(640) + 0.5 - u, np.arange(240) + 0.5 - v, ellipse, blur)
        image -= 170 * dark
    image = np.clip(np.rint(image + noise * rng.standard_normal(image.shape)), 0, 255)
    return view, image.astype(np.uint8), true, ellipse


@pytest.mark.parametrize("noise", [0.0, 4.0])
def test_the_fit_is_the_least_squares_fit(conforms, noise):
    view, image, true, ellipse = bench(noise, 3)
    markers = view.markers
    found, _ = refine(image, view, markers.centres, steps=8, done=1e-6)
    conforms.closed_form(found, true, atol=0.003 if noise == 0 else 0.05)
    half = int(np.ceil(6 + 3 * view.blur + 1))
    for got, start in zip(found.T, view.to_image(markers.centres).T, strict=True):
        u0, v0 = np.floor(start).astype(int)
        u, v = (k + np.arange(-half, half + 1) for k in (u0, v0))
        grey = image[np.ix_(v, u)].astype(float)

        def left(p, u=u, v=v, grey=grey):
            dark = disc(u + 0.5 - p[0], v + 0.5 - p[1], ellipse, view.blur)
            return (p[2] - p[3] * dark - grey).ravel()

        best = least_squares(left, [*start, 190, 150], xtol=1e-12, ftol=1e-12, gtol=1e-12)
        conforms.closed_form(got, best.x[:2], atol=2e-5)


def test_fewer_steps_are_as_good_where_the_guess_is(conforms):
    view, image, _, _ = bench(4.0, 5)
    exact, _ = refine(image, view, view.markers.centres, steps=8, done=0)
    near = view.to_plane(exact)
    conforms.invariance(refine(image, view, near)[0], exact, atol=2e-4)
    conforms.invariance(refine(image, view, view.markers.centres)[0], exact, atol=2e-4)
