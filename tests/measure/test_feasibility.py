"""Assessments of manifests: numbers against closed forms and simulations, one warning at a time."""

import copy
import json
import re
import warnings

import numpy as np
import pytest
from scenes import manifests

from thesis_lib.measure.feasibility import assess
from thesis_lib.measure.feasibility.prediction import predict_noise_errors
from thesis_lib.measure.fitting.result import model_of
from thesis_lib.measure.messages import CHECK_LIMITS
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.vision.optics import depth_of_field
from thesis_lib.vision.pinhole import ground_sample_distance, hemisphere_cameras, pixelate, project
from thesis_lib.vision.triangulation import triangulate


def rig(directions=((10, 22), (-10, 22), (190, 22), (170, 22)), **changes):
    """Values of a manifest without any warning: the thesis's four cameras."""
    cameras = [
        {
            "name": chr(65 + i), "video": f"{i}.mkv", "board_images": f"s{i}", "exposure_s": 0.004,
            "focal_length_mm": 24, "sensor_width_mm": 36, "f_number": 8, "distance_mm": 570,
            "azimuth_deg": azimuth, "elevation_deg": elevation,
        }
        for i, (azimuth, elevation) in enumerate(directions)
    ]  # fmt: skip
    excitation = {"amplitude_mm": 2.5, "steady_interval_s": [2.0, 4.0]}
    return {"structure": {}, "cameras": cameras, "excitation": excitation, **changes}


def change(values, **places):
    """Values with some changed; ``cameras__0__exposure_s`` is at "cameras.0.exposure_s"."""
    values = copy.deepcopy(values)
    for place, value in places.items():
        manifests.change(values, place.replace("__", "."), value)
    return values


def manifest(values):
    return Manifest.model_validate_json(json.dumps(values))


def assessed(values):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assessment = assess.assess_manifest(manifest(values))
        lines = assess.describe_assessment(assessment)
    assert all("\n" not in line for line in lines)
    return assessment


def codes(values):
    return {warning.code for warning in assessed(values).warnings}


# Numbers, of the four cameras and the markers of the beam about its middle.

CAMERAS = hemisphere_cameras(
    0.57, np.radians([10, -10, 190, 170]), np.radians([22] * 4), 1280.0, (1920, 1080)
)
P = CAMERAS.P
BEAM = manifest(rig()).structure
X = np.stack([*BEAM.marker_points - np.array([[BEAM.length_mm], [BEAM.width_mm]]) / 2000,
              np.zeros(75)])  # fmt: skip


def at_heights(*heights):
    return [X + [[0], [0], [z]] for z in heights]


def swing(z):
    """How far the first camera's images move, px."""
    low, high = (project(P[:1], points)[0] for points in at_heights(-z, z))
    return np.hypot(*(high - low)).max()


def test_a_pixel_spans_distance_over_focal_length_and_markers_move_as_their_images(conforms):
    row, A = assessed(rig()).table[0], 0.0025
    conforms.closed_form(row.ground_sample_mm, 1000 * ground_sample_distance(CAMERAS), rtol=1e-6)
    conforms.closed_form(row.along_px, 5 / (570 / 1280), rtol=1e-6)
    conforms.closed_form(row.across_px, row.along_px * np.sin(np.radians(22)), rtol=1e-6)
    conforms.independent(row.motion_px, swing(A) / 2, rtol=1e-3)
    R, C = CAMERAS.R_camera_world[0], CAMERAS.centres[0][:, None]
    depths = [(R @ (own - C))[2] for own in at_heights(-A, A)]
    conforms.independent(row.nearest_mm, 1000 * np.min(depths), rtol=1e-6)
    conforms.independent(row.farthest_mm, 1000 * np.max(depths), rtol=1e-6)


def test_depth_of_field_is_where_the_circle_of_confusion_is_reached(conforms):
    f, N, d, c = 24.0, 8.0, 570.0, 36 / 1920
    near, far = depth_of_field(f, N, d, c)
    sensor = f * d / (d - f)  # thin lens: 1/f = 1/object + 1/image
    for z in (near, far):
        image = f * z / (z - f)
        conforms.closed_form(f / N * abs(sensor - image) / image, c, rtol=1e-6)
    hyperfocal = f**2 / (N * c) + f
    assert depth_of_field(f, N, hyperfocal, c) == pytest.approx((hyperfocal / 2, np.inf))
    assert depth_of_field(f, N, 10 * hyperfocal, c)[1] == np.inf
    assert np.isnan(depth_of_field(f, N, f, c)).all()
    row = assessed(rig()).table[0]
    assert (row.near_mm, row.far_mm) == pytest.approx((near, far))
    image = np.array([f * z / (z - f) for z in (row.nearest_mm, row.farthest_mm)])
    conforms.closed_form(row.defocus_px, max(f / N * np.abs(sensor - image) / image) / c, rtol=1e-6)


def test_blur_is_velocity_times_exposure_and_the_loss_that_of_a_mean(conforms):
    T, f, A = 0.004, 4.25, 0.0025
    row = assessed(rig()).table[0]
    conforms.independent(row.blur_px, swing(A * np.sin(np.pi * f * T)), rtol=1e-3)
    within = (np.arange(1000) + 0.5) / 1000 - 0.5
    conforms.independent(row.lost, 1 - np.mean(np.cos(2 * np.pi * f * T * within)), rtol=1e-5)
    still = change(rig(), excitation__frequency_hz=25.0, cameras__0__exposure_s=1 / 60)
    row = assessed(still).table[0]
    conforms.closed_form(row.lost, 1 - np.sinc(25 / 60), rtol=1e-6)
    conforms.independent(row.blur_px, swing(A), rtol=2e-3)  # at most the whole swing


def test_movement_from_frame_to_frame_is_that_along_the_plane(conforms):
    f, rate, A = 4.25, 60.0, 0.0025
    t = (np.arange(400) / 400)[:, None] / f
    z = A * np.sin(2 * np.pi * f * np.hstack([t, t + 1 / rate]))
    worst = z[np.argmax(np.abs(np.diff(z, axis=1)))]
    C = CAMERAS.centres[0][:, None]
    plane = [(C + (X + [[0], [0], [dz]] - C) * C[2] / (C[2] - dz))[:2] for dz in worst]
    seen = np.hypot(*(plane[1] - plane[0])).max() / 0.010  # rows are 10 mm apart
    conforms.independent(assessed(rig()).table[0].move_spacings, seen, rtol=1e-3)


def test_a_hole_beside_a_marker_leaves_as_little_room_as_a_marker_would(conforms):
    x, y = 1000 * BEAM.marker_points[:, 30]
    places = [(x, y), (x + 40, y), (x + 40, y - 10), (x, y - 10)]

    def row(*more, hole=None):
        markers = {"points_mm": [*places, *more], "hole_mm": hole}
        return assessed(rig(structure={"markers": markers})).table[0]

    beside = x + 6.5, y
    holed, marked, alone = row(hole=beside), row(beside), row()
    conforms.invariance(holed.gap_px, marked.gap_px, rtol=1e-9)
    conforms.closed_form(holed.move_spacings, alone.move_spacings * 10 / 6.5, rtol=1e-9)


def test_markers_in_view_are_counted_as_they_swing(conforms):
    def share(amplitude):
        # The camera above sees ±187.5 mm of x and more than the width.
        values = rig([(0, 90), (0, 22)], excitation={"amplitude_mm": amplitude})
        values["cameras"][0] |= {"distance_mm": 400, "sensor_width_mm": 22.5}
        return assessed(values).table[0].in_view

    for amplitude in (0.001, 60.0):
        inside = np.abs(X[0]) < 22.5 / 24 / 2 * (0.4 - amplitude / 1000)
        conforms.independent(share(amplitude), np.mean(inside), rtol=1e-6)
    assert share(0.001) > share(60.0) > 0


def test_errors_are_those_of_noisy_images(conforms):
    some, sigma = X[:, ::8], np.array([0.03, 0.06, 0.03, 0.02])
    noise = np.random.default_rng(1).standard_normal((4, 2, 2000, some.shape[1]))
    noise *= sigma[:, None, None, None]
    Z = triangulate(P, project(P, some)[:, :, None] + noise)[2]
    every = np.ones((4, some.shape[1]), bool)
    predicted = predict_noise_errors(P, some, sigma, every)
    conforms.sampled(np.sqrt(np.mean(Z**2)), np.sqrt(np.mean(predicted**2)), rtol=0.05)
    conforms.sampled(Z.std(axis=0) / predicted, 1, atol=0.05)
    seen = every.copy()
    seen[2:, 0], seen[1:, 1] = False, False
    partly = predict_noise_errors(P, some, sigma, seen)
    conforms.invariance(
        partly[0], predict_noise_errors(P[:2], some[:, :1], sigma[:2], every[:2, :1])[0], rtol=1e-6
    )
    assert np.isnan(partly[1])
    conforms.invariance(partly[2:], predicted[2:], rtol=1e-7)
    assert np.isinf(predict_noise_errors(P[[0, 0]], some, sigma[:2], every[:2])).all()


def test_one_frame_and_harmonic_fit_are_those_of_simulated_recordings(conforms):
    values = rig(excitation={"amplitude_mm": 2.0, "steady_interval_s": [1.0, 3.0]})
    for camera, rate in zip(values["cameras"], (60, 120, 60, 240), strict=True):
        camera["frame_rate_hz"] = rate
    values["excitation"]["frequency_hz"] = 20.0  # loses 1 %
    outlook = assessed(values).rig
    rng, uv, trials = np.random.default_rng(2), project(P, X), 60
    found = np.empty((4, 2, trials, X.shape[1]))
    for i, camera in enumerate(values["cameras"]):
        n = 2 * camera["frame_rate_hz"]
        angle = 2 * np.pi * 20.0 * (np.arange(n) + 0.3) / camera["frame_rate_hz"]
        basis = np.stack([np.ones(n), np.cos(angle), np.sin(angle)], axis=1)
        noise = assess.CENTRE_NOISE_PX * rng.standard_normal((n, 2 * trials * X.shape[1]))
        cosine = np.linalg.lstsq(basis, noise, rcond=None)[0][1] / np.sinc(20.0 * 0.004)
        found[i] = cosine.reshape(2, trials, -1) + uv[i, :, None]
    fit = np.sqrt(np.mean(triangulate(P, found)[2] ** 2))
    conforms.sampled(1000 * fit, outlook.fit[0], rtol=0.05)
    alike = assessed(rig(excitation={"steady_interval_s": [2.0, 22.0]})).rig
    ratio = np.array(alike.fit) / alike.one_frame
    conforms.closed_form(ratio, np.sqrt(2 / 1200) / np.sinc(4.25 * 0.004), rtol=1e-7)
    conforms.closed_form(outlook.smallest_mm, 3 * outlook.fit[1], rtol=1e-6)
    single = 1000 * predict_noise_errors(
        P, X, np.full(4, assess.CENTRE_NOISE_PX), np.ones((4, X.shape[1]), bool)
    )
    conforms.independent(outlook.one_frame, (np.sqrt(np.mean(single**2)), single.max()), rtol=1e-6)


@pytest.mark.parametrize(("amplitude", "f"), [(0.0003, 4.25), (0.0031, 20.0)])
def test_whole_pixels_err_by_the_law_of_rounding(conforms, amplitude, f):
    values = rig(excitation={"amplitude_mm": 1000 * amplitude, "frequency_hz": f})
    rng, trials, turn = np.random.default_rng(3), 3000, 2 * np.pi * f / 60
    shift = rng.uniform(-0.5, 0.5, (4, 2, trials, X.shape[1]))
    z = amplitude * np.cos(rng.uniform(-0.5, 0.5, (trials, X.shape[1])) * turn)
    up = np.stack([0 * z, 0 * z, z])

    def rounded(points):
        return triangulate(P, pixelate(project(P, points) + shift) - shift)[2]

    rest = np.repeat(X[:, None], trials, axis=1)
    squares = np.mean((rounded(rest + up) - rounded(rest) - z) ** 2, axis=0)
    drawn = 1000 * np.sqrt([squares.mean(), squares.max()])
    conforms.sampled(drawn, assessed(values).rig.rounding, rtol=0.05)


# Warnings.


ONE = {
    "undersampled": {"excitation__frequency_hz": 31.0},
    "near-nyquist": {"excitation__frequency_hz": 25.0},
    "few-samples": {"excitation__frequency_hz": 13.0},
    "higher-modes": {"cameras__1__frame_rate_hz": 10.0},
    "long-exposure": {"excitation__frequency_hz": 26.0},
    "motion-blur": {"cameras__2__exposure_s": 0.016},
    "depth-of-field": {"cameras__1__f_number": 2.8},
    "too-near": {"cameras__0__distance_mm": 24.0},
    "coarse": {"cameras__3__width_px": 800},
    "foreshortened": {"cameras__3__elevation_deg": 14.0},
    "crowded-markers": {"structure__markers": {"row_spacing_mm": 6.5, "hole_mm": None}},
    "out-of-view": {"cameras__0__sensor_width_mm": 20.0},
    "shallow-view": {"cameras__0__elevation_deg": 7.0},
    "steep-view": {"cameras__0__elevation_deg": 81.0},
    "same-line": {"cameras__1__azimuth_deg": 6.0},
    "below-noise": {"excitation__amplitude_mm": 0.001},
    "small-motion": {"excitation__amplitude_mm": 0.15},
    "large-move": {"excitation__amplitude_mm": 5.0},
    "short-rest": {"excitation__rest_duration_s": 0.9},
    "few-rest-frames": {"excitation__rest_duration_s": 0.1},
    "few-frames": {"excitation__steady_interval_s": [2.0, 2.3]},
    "few-periods": {"excitation__steady_interval_s": [2.0, 2.4]},
    "steady-at-rest": {"excitation__steady_interval_s": [0.5, 4.0]},
}
ALONE = {"short-rest", "depth-of-field", "motion-blur", "same-line", "small-motion"}


@pytest.mark.parametrize("code", ONE)
def test_one_change_brings_its_warning(code):
    assert codes(rig()) == set()
    assessment = assessed(change(rig(), **ONE[code]))
    assert code not in ALONE or {one.code for one in assessment.warnings} == {code}
    found = [one.where for one in assessment.warnings if one.code == code]
    assert found
    (field,) = ONE[code]
    if field.startswith("cameras__"):
        assert any(where.startswith(f"cameras[{field.split('__')[1]}].") for where in found)
    assert any(
        line.endswith(f"[{code}]") for line in joined(assess.describe_assessment(assessment))
    )


def joined(lines):
    """Lines as they were before they were wrapped."""
    return "\n".join(lines).replace("\n  ", " ").splitlines()


def test_a_declared_alias_is_told_and_warned_of_at_the_edges():
    declared = change(
        rig(), excitation__undersampled=True, excitation__frequency_hz=100.0,
        **{f"cameras__{i}__exposure_s": 0.0005 for i in range(4)},
    )  # fmt: skip
    found = {one.code: one for one in assessed(declared).warnings}
    assert "undersampled" not in found
    assert "alias-edge" not in found
    assert "seen at 20 Hz" in found["alias"].text
    assert "known to 0.05 Hz" in found["alias"].text  # 0.1 turn in 2 s
    for f in (120.4, 149.7, 30.0):
        assert "alias-edge" in codes(change(declared, excitation__frequency_hz=f))
    assert "alias" not in codes(change(declared, excitation__frequency_hz=5.0))


def test_markers_that_too_few_cameras_see_are_named():
    pair = rig([(0, 22), (180, 22)])
    narrow = change(pair, cameras__0__sensor_width_mm=20.0)
    assert {"lost-markers", "out-of-view"} <= codes(narrow)
    (lost,) = [one for one in assessed(narrow).warnings if one.code == "lost-markers"]
    share = assessed(narrow).table[0].in_view
    assert lost.text.startswith(f"{75 - round(75 * share)} of 75 ")
    out = next(one for one in assessed(narrow).warnings if one.code == "out-of-view")
    assert out.text.startswith(f"{round(75 * share)} of 75 markers stay")
    three = rig([(0, 60), (5.5 / np.cos(np.radians(60)), 60), (180, 60)])
    assert "weak-markers" not in codes(three)
    assert "weak-markers" in codes(change(three, cameras__2__sensor_width_mm=20.0))


@pytest.mark.parametrize(
    ("code", "field", "said", "others"),
    [
        ("depth-of-field", "cameras__1__f_number", r"allowed: ([\d.]+)", {}),
        ("motion-blur", "cameras__2__exposure_s", r"so ([\d.]+) s", {}),
        ("motion-blur", "cameras__2__exposure_s", r"so ([\d.]+) s",  # longer than half a period
         {"excitation__frequency_hz": 25.0, "excitation__amplitude_mm": 1.2}),
        ("long-exposure", "cameras__2__exposure_s", r"allowed: ([\d.]+)",
         {"excitation__frequency_hz": 18.0, "cameras__2__exposure_s": 0.016}),
        ("small-motion", "cameras__0__distance_mm", r"from ([\d.]+) mm, with",
         {"cameras__0__distance_mm": 2500.0, "excitation__amplitude_mm": 0.4}),
        ("below-noise", "excitation__amplitude_mm", r"allowed: ([\d.]+)", {}),
        ("few-rest-frames", "excitation__rest_duration_s", r"allowed: ([\d.]+)",
         {"cameras__0__frame_rate_hz": 23.976}),
        ("near-nyquist", "cameras__0__frame_rate_hz", r"allowed: ([\d.]+)",
         {"excitation__frequency_hz": 82.9 / 3}),
    ],
)  # fmt: skip
def test_what_a_warning_allows_is_allowed(code, field, said, others):
    values = change(rig(), **ONE[code] | others)
    first, *_ = (one for one in assessed(values).warnings if one.code == code)
    mended = assessed(change(values, **{field: float(re.search(said, first.text)[1])})).warnings
    assert not [one for one in mended if (one.code, one.where) == (code, first.where)]


@pytest.mark.parametrize(("begin", "rate"), [(2.0, 25.0), (0.5, 100.0), (7.3, 23.976)])
def test_as_long_an_interval_as_is_allowed_is_long_enough(begin, rate):
    def said(seconds):
        values = rig(excitation={"steady_interval_s": [begin, round(begin + seconds, 6)]})
        values["cameras"][0]["frame_rate_hz"] = rate
        return [one.text for one in assessed(values).warnings if one.code == "few-frames"]

    (text,) = said(5 / rate)
    assert not said(float(re.search(r"allowed: ([\d.]+)", text)[1]))


def test_a_folded_mode_is_named_by_its_frequency():
    values = change(rig(), **{f"cameras__{i}__frame_rate_hz": 75.0 for i in range(4)})
    assert codes(values) == set()  # 39.6 Hz is the second, the driven one's own is 6.3 Hz
    own = model_of(manifest(values).structure).angular_frequencies(3)[2] / (2 * np.pi)
    values = change(values, **{f"cameras__{i}__frame_rate_hz": own - 4.5 for i in range(4)})
    (text,) = {one.text for one in assessed(values).warnings}
    assert f"{own:.4g} Hz is seen at 4.5 Hz" in text
    flat = change(values, structure__kind="flat")
    assert codes(flat) == set()


# Whether it will do.


@pytest.mark.parametrize(
    ("places", "outcome", "words"),
    [
        ({}, "compressed", "It will do."),
        ({"excitation__amplitude_mm": 0.15}, "lossless", "It will do without loss; compressed, it"),
        ({"excitation__amplitude_mm": 0.001}, "none", "It will not do: it takes a deflection of"),
        ({"excitation__amplitude_mm": None}, "amplitude unknown", "will do from a largest deflect"),
        ({f"cameras__{i}__distance_mm": None for i in range(3)}, "unknown", "give lens and place"),
        ({f"cameras__{i}__distance_mm": 1.0 for i in range(4)}, "unseen", "will not do: 0 % of"),
    ],
)
def test_the_verdict_turns_with_what_is_filmed(places, outcome, words):
    found = assessed(change(rig(), **places))
    assert found.verdict.outcome == outcome
    assert words in " ".join(assess.describe_verdict(found))
    if np.isfinite(found.verdict.compressed_from_mm):  # what it takes would do
        enough = {"excitation__amplitude_mm": 1.001 * found.verdict.compressed_from_mm}
        assert assessed(change(rig(), **enough)).verdict.outcome == "compressed"


def test_nothing_of_a_steady_sine_is_said_of_a_receptance():
    excitation = {"kind": "sweep", "amplitude_mm": 2.5, "frequency_hz": None}
    found = assessed(rig(excitation=excitation, force={"file": "force.csv", "offset_s": 0.0}))
    assert found.verdict.outcome == "response"
    said = [*assess.describe_assessment(found), *assess.describe_verdict(found)]
    lines = " ".join(joined(said))
    assert "The uncertainty of the motion over the force is not predicted" in lines
    assert "not checked: errors of the motion over the force" in lines
    for words in ("harmonic fit", "smallest deflection", "steady_interval_s", "It will do"):
        assert words not in lines


# What is not known.


@pytest.mark.parametrize(
    ("places", "line"),
    [
        ({"cameras__0__f_number": None}, "depth of field of camera A: give f_number"),
        ({f"cameras__{k}__azimuth_deg": None for k in range(4)},
         "view, errors and depth of field of cameras A, B, C and D: give azimuth_deg"),
        ({"excitation__frequency_hz": None},
         "frame rate, exposure, blur and movement: give excitation.frequency_hz"),
        ({"excitation__sound": "room"}, "a clap: no field shows whether every sound track has one"),
        ({"structure__kind": "flat"},
         'natural frequencies: give structure.kind "beam" or "plate" if it is one'),
    ],
)  # fmt: skip
def test_what_is_missing_is_said(places, line):
    assessment = assessed(change(rig(), **places))
    assert line in assessment.unknown
    said = assess.describe_assessment(assessment)
    assert f"not checked: {line}" in joined(said)
    assert assessment.warnings == ()
    rows = [one.split() for one in said if one[:2] in ("A ", "B ", "C ", "D ")]
    assert all({*column} != {"-"} for column in zip(*rows, strict=True))
    assert not [one for one in said if one.endswith(" -") and one.startswith("  ")]


def test_cameras_without_a_place_do_not_count():
    values = change(rig(), cameras__1__elevation_deg=None, cameras__3__focal_length_mm=None)
    found = assessed(values).rig
    assert found == assessed(rig([(10, 22), (190, 22)])).rig
    assert found.located == 2


# Any manifest.


def random_values(rng):
    """Values of a manifest, wild but valid."""

    def maybe(value):
        return None if rng.random() < 0.1 else value

    def upto(low, high):
        return 10 ** rng.uniform(low, high)

    kind = str(rng.choice(["beam", "plate", "flat"]))
    length, width = upto(1.5, 4), upto(1.5, 4)
    rows, columns = int(rng.integers(2 if kind == "plate" else 1, 7)), int(rng.integers(1, 12))
    along, across = 0.88 * length / columns, 0.88 * width / rows
    markers = {
        "rows": rows, "columns": columns, "spacing_mm": along, "row_spacing_mm": across,
        "diameter_mm": rng.uniform(0.01, 0.9) * min(along, across),
    }  # fmt: skip
    cameras = []
    for i in range(int(rng.choice([2, 2, 3, 4, 16]))):
        rate = upto(0, 4)
        cameras.append({
            "name": f"camera {i}", "video": f"{i}.mkv", "board_images": f"s{i}",
            "width_px": int(rng.integers(2, 6000)), "height_px": int(rng.integers(2, 6000)),
            "frame_rate_hz": rate, "exposure_s": rng.uniform(0.001, 1) / rate,
            "focal_length_mm": maybe(upto(0, 3)), "sensor_width_mm": maybe(upto(0, 2)),
            "f_number": maybe(upto(-0.5, 2)), "distance_mm": maybe(upto(0, 4.5)),
            "azimuth_deg": maybe(float(rng.choice([0, 180, rng.uniform(-360, 360)]))),
            "elevation_deg": maybe(float(rng.choice([90, 22, rng.uniform(0.01, 90)]))),
        })  # fmt: skip
    frequency, begin = maybe(upto(-1, 4)), rng.uniform(0, 5)
    return {
        "structure": {
            "kind": kind, "length_mm": length, "width_mm": width, "markers": markers,
            "thickness_mm": upto(-1, 2), "force_position_mm": length / 2,
        },
        "cameras": cameras,
        "excitation": {
            "frequency_hz": frequency, "undersampled": frequency is not None and rng.random() < 0.5,
            "amplitude_mm": maybe(upto(-4, 3)), "rest_duration_s": rng.uniform(0, 3),
            "sound": str(rng.choice(["force", "room"])),
            "steady_interval_s": maybe([begin, begin + upto(-3, 2)]),
        },
    }  # fmt: skip


def test_no_valid_manifest_breaks_it():
    rng = np.random.default_rng(0)
    found = set()
    for _ in range(120):
        values = random_values(rng)
        assessment = assessed(values)
        assert len(assessment.table) == len(values["cameras"])
        for one in assessment.warnings:
            found.add(one.code)
            assert not re.search("nan|None", one.text), one
    assert found >= set(CHECK_LIMITS) - {"weak-markers"}
