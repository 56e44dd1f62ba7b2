"""Numbers that the thesis prints: read, computed, and held against independent arithmetic.

And the statements that exclude each other: the arithmetic is done again from the rows themselves.
"""

from functools import partial
from itertools import combinations, product
from math import acos, asin, atan, cos, cosh, degrees, inf, pi, radians, sin, sqrt, tan

import numpy as np
import pytest

from thesis_lib.facts import claims as stated_numbers, setups
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.vision.optics import angle_of_view

NUMBERS = stated_numbers.read_numbers()
BY_ID = {number.id: number for number in NUMBERS}
DIFFERENT = [
    "cameras-sizes", "format-1280-4-3", "view-up", "view-diagonal-43", "sine-factor", "instant",
    "zero-column", "figures-announced", "axes-1", "axes-2a-160", "caption-2c", "reversed-4a",
    "mirrored-4e", "plate-density", "plate-modulus", "mixed-term", "rank-2-2", "rank-1-4",
    "resonance", "resonance-rounded", "tip", "distance", "axes-rig", "places", "board",
    "frames-per-resonance", "simulated-width", "wave-sign", "parameters",
]  # fmt: skip


def value(name):
    return BY_ID[name].value


# -- Reading --


def test_every_way_to_compute_a_number_is_used():
    assert {number.value_of[0] for number in NUMBERS} == set(stated_numbers.CORRECT_VALUES)


@pytest.mark.parametrize(
    ("stated", "low", "high"),
    [
        ("39.6", 39.55, 39.65),
        ("16e6", 15.5e6, 16.5e6),
        ("1/60", 1 / 60, 1 / 60),
        ("12×4", 48, 48),
        ("-1", -1.5, -0.5),
    ],
)
def test_a_number_stands_for_what_is_rounded_to_it(stated, low, high):
    number = stated_numbers.PrintedNumber("n", 3, "3.1", "words", stated, "", "tip")
    np.testing.assert_allclose(number.ends, [low, high], rtol=2e-9)
    assert number.ends[0] < number.ends[1]


# -- Values, by other ways --


def test_these_and_no_others_differ_from_what_is_printed():
    outside = [n.id for n in NUMBERS if not n.ends[0] <= n.value <= n.ends[1]]
    assert outside == DIFFERENT


def test_angles_of_view(conforms):
    hold = partial(conforms.independent, rtol=1e-6)
    for size in (24, 36, 43):  # half the side subtends half the angle
        hold(tan(angle_of_view(size, 50) / 2) * 100, size)
    hold(angle_of_view(2, 1), pi / 2)
    hold(value("view-diagonal"), degrees(2 * atan(sqrt(36**2 + 24**2) / 100)))
    hold(degrees(angle_of_view(36, value("view-lens"))), 39.6)
    conforms.independent(degrees(angle_of_view(24, 17.14)), 70, atol=0.01)  # what 70° would need


def test_heights_are_in_proportion_within_a_pixel():
    for number in NUMBERS:
        if number.id.startswith("format-"):
            _, width, side, other = number.id.split("-")
            ratio = min(int(side), int(other)) / max(int(side), int(other))
            assert 0 <= int(width) * ratio - number.value < 1
            near = abs(int(width) * ratio - float(number.stated)) < 1
            assert near == (number.id != "format-1280-4-3")


def test_resonance_and_tip_by_hand(conforms):
    length, width, thickness, density, modulus, damping, at = (
        0.623, 0.03, 0.003, 2700, 6.9e10, 0.02, 0.055,
    )  # fmt: skip
    kl = value("root-1")
    natural = (kl / length) ** 2 * sqrt(modulus / 12 / density) * thickness
    resonance = natural * sqrt(1 - 2 * damping**2) / (2 * pi)
    conforms.independent(value("resonance"), resonance, rtol=1e-6)
    k = kl / length
    sigma = (np.sinh(kl) - sin(kl)) / (cosh(kl) + cos(kl))
    shape = cosh(k * at) - cos(k * at) - sigma * (np.sinh(k * at) - sin(k * at))
    mass = density * width * thickness * length
    q = shape / (mass * 2 * damping * natural**2 * sqrt(1 - damping**2))
    conforms.independent(value("tip"), 2 * q * 1e3, rtol=1e-6)
    conforms.independent(value("instant"), damping / sqrt(1 - damping**2), rtol=1e-6)


def test_ranks_by_counting_the_modes_below():
    for m1, m2 in ((2, 1), (1, 2), (2, 2), (1, 4)):
        own = (m1 / 668) ** 2 + (m2 / 443) ** 2
        below = sum(
            (a / 668) ** 2 + (b / 443) ** 2 < own for a, b in product(range(1, 20), repeat=2)
        )
        assert value(f"rank-{m1}-{m2}") == below + 1


def test_angles_between_optical_axes(conforms):
    def between(half, elevation):  # spherical law of cosines
        s, c = sin(radians(elevation)), cos(radians(elevation))
        return degrees(acos(s * s + c * c * cos(radians(2 * half))))

    hold = partial(conforms.independent, rtol=1e-6)
    hold(value("axes-1"), between(30, 25))
    hold(value("axes-2a-160"), between(80, 10))
    hold(value("axes-rig"), degrees(2 * asin(cos(radians(22)) * sin(radians(10)))))
    for elevation in (5, 20, 40, 60):
        hold(value(f"aperture-2b-{180 - 2 * elevation}"), 180 - 2 * elevation)


def test_counts():
    sizes = {len(s.directions_deg) for s in setups.array_settings(
        list(setups.camera_pairs()), {}, {}, 500, (320, 180))}  # fmt: skip
    assert sizes == {2, 4, 6, 8, 10, 12}
    assert value("cameras-sizes") == len(sizes)
    assert value("frames-per-resonance") == pytest.approx(60 / 4.25)


def test_only_opposite_pairs_on_an_axis_mirror_each_other():
    def mirrored(pair):
        places = [np.round([sin(radians(a)), cos(radians(a))], 9) for a, _ in pair]
        return any((places[0] * flip == places[1]).all() for flip in ([-1, 1], [1, -1]))

    found = {case: sum(map(mirrored, pairs)) for case, pairs in setups.camera_pairs().items()}
    assert found.pop("4e") == value("mirrored-4e") == 2
    assert found == {"4a": 6, "4a'": 6, "4b": 4, "4c": 6, "4d": 4}


# -- Statements that exclude each other --


CLAIMS = stated_numbers.read_claims()
MARKERS = 25
NEARLY = 0.9  # of the bound, that the rms of the other markers would have to reach


def bounds(claim):
    """What is rounded to the stated value or lies within the stated bound, in %."""
    low, high = claim.low - claim.rounding[0], claim.high + claim.rounding[1]
    if claim.relation == "less_than":
        high = claim.high
    upper = claim.relation in ("max", "less_than")
    return 0.0 if upper else low, inf if claim.relation == "min" else high


def common(claims):
    """What all of them allow."""
    ends = [bounds(claim) for claim in claims]
    return max([low for low, _ in ends], default=0.0), min([high for _, high in ends], default=inf)


def infeasible(claim, others):
    """Whether statements on one setup exclude each other: "", "nearly" or "excluded".

    The mean error is an rms over 25 markers. With the largest error T and all others at most R
    it is at most √((24 R² + T²)/25), and at least T/5.
    """
    claims = [claim, *others]
    mean = common([c for c in claims if c.quantity == "mean_error"])
    peaks = [c for c in claims if c.quantity == "max_point_error"]
    top = common([c for c in peaks if c.excepted == 0])
    rest = common([c for c in peaks if c.excepted == 1])
    rest = rest[0], min(rest[1], top[1])
    if any(low > high for low, high in (mean, top, rest)):
        return "excluded"
    most = sqrt(((MARKERS - 1) * rest[1] ** 2 + top[1] ** 2) / MARKERS)
    least = sqrt((max(top[0], rest[0]) ** 2 + rest[0] ** 2) / MARKERS)
    if mean[0] > most or mean[1] < least:
        return "excluded"
    if any(low == high for low, high in (mean, top, rest)):
        return "nearly"
    if top[1] == inf:
        return ""
    needed = sqrt(max(MARKERS * mean[0] ** 2 - top[1] ** 2, 0) / (MARKERS - 1))
    return "nearly" if needed > NEARLY * rest[1] else ""


def test_no_conflict_within_a_setup_is_left_out():
    settings = {}
    for claim in CLAIMS:
        for place in places(claim):
            settings.setdefault((*place, claim.mode), []).append(claim)
    found = set()
    for made in settings.values():
        for number in (2, 3):
            for group in combinations(made, number):
                smaller = (g for n in range(2, number) for g in combinations(group, n))
                if infeasible(group[0], group[1:]) and not any(
                    infeasible(g[0], g[1:]) for g in smaller
                ):
                    found.add(frozenset(claim.id for claim in group))
                    nearly = infeasible(group[0], group[1:]) == "nearly"
                    assert group[0].conflict_why.startswith("nearly: ") == nearly
    stated = {frozenset([claim.id, *claim.conflicts]) for claim in CLAIMS if claim.conflicts}
    assert found == stated


def places(claim):
    """Cameras, distances and pixels of the beam's settings that a claim speaks of."""
    if not claim.figure_set.startswith("beam-"):
        return []
    return [
        (s.distance_mm, frozenset((a % 360, e) for a, e in s.directions_deg), s.resolution_px)
        for s in validate_request(claim.figure_set, {}).settings()
        if s.case == claim.case and (not claim.values or s.value in claim.values)
    ]
