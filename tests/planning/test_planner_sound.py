"""Plans for the plate's sound: the criterion against draws, gains, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from command import thesis
from scipy.stats import qmc

from thesis_lib.acoustics.planes import plate_pistons
from thesis_lib.acoustics.radiation import radiation_matrix, rayleigh_pressure
from thesis_lib.facts import setups
from thesis_lib.planning import errors, positions, search, sound
from thesis_lib.planning.planner import plan
from thesis_lib.planning.request import plan_request
from thesis_lib.studies.request import ParameterError
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.triangulation import triangulate

PLATE = setups.thesis_plate()
ASKED = {
    "body": "plate",
    "amplitude_mm": 10,
    "counts": [2],
    "resolutions_px": [[320, 180]],
    "target_percent": None,
    "starts": 0,
    "step_deg": 20,
    "trials": 400,
}
SQUARE = np.array([[0.0, 0.6, 0.75, 24 / 36], [np.pi, 0.6, 0.75, 24 / 36]])
TURNED = SQUARE + [np.radians(3), 0, 0, 0]


@pytest.fixture(scope="module")
def request_():
    return plan_request({**ASKED, "goal": "sound"})


@pytest.fixture(scope="module")
def made(request_):
    return plan(request_)


def drawn(scene, layout, scale=1.0):
    """Deflection errors (modes, draws, markers) in m from whole pixels, without any law."""
    P, body = positions.place_cameras(scene, layout, 320).P, scene.body
    shift = qmc.Sobol(2 * len(P), rng=0).random_base2(9) - 0.5
    shift = np.moveaxis(shift.reshape(-1, len(P), 2), 0, 2)[..., None]

    def found(points):
        return triangulate(P, np.rint(project(P, points)[:, :, None] + shift) - shift)[2]

    moved = np.moveaxis(body.deflected([scale * peak for peak in scene.peaks]), 1, 0)
    rest = found(body.points)
    return np.stack([found(one) - rest - one[2] for one in moved])


def fields(request, wrong):
    """Rms errors of the field in % on the worse plane, by Rayleigh's sum at some of its points."""
    rms = []
    for one, error in zip(request.sounds, wrong, strict=True):
        worst = []
        for operator, largest in zip(one.operators, one.largest, strict=True):
            points = replace(operator.plane, shape=(25, 17)).points
            sent = [
                rayleigh_pressure(plate_pistons(PLATE), one.omega * e, points, one.omega)
                for e in error
            ]
            worst.append(100 * np.sqrt(np.mean(np.abs(sent) ** 2)) / largest)
        rms.append(np.nanmax(worst))
    return np.array(rms)


@pytest.mark.parametrize("layout", [SQUARE, TURNED], ids=["square", "turned"])
def test_predicted_field_errors_are_those_of_draws(conforms, request_, layout):
    scene = request_.scene()
    law = sound.predict_sound_errors(request_.sounds, scene, layout, 320)
    found = fields(request_, drawn(scene, layout)[:, ::4])
    conforms.sampled(found / law, 1, atol=0.12)


@pytest.mark.slow
def test_average_is_about_that_of_draws_over_amplitudes_and_turns(conforms, request_):
    scene = request_.scene()
    for layout in (SQUARE, TURNED):
        each = [
            fields(request_, drawn(scene, layout + [turn, 0, 0, 0], scale)[:, ::16]) ** 2
            for turn in sound.AVERAGED_TURNS_RAD
            for scale in (0.83, 1.0, 1.21)
        ]
        found = np.sqrt(np.mean(each, axis=0))
        conforms.sampled(
            sound.average_sound_error(request_.sounds, scene, layout, 320) / found,
            above=0.7,
            below=1.5,
        )


@pytest.mark.parametrize("layout", [SQUARE, TURNED], ids=["square", "turned"])
def test_predicted_power_errors_are_those_of_draws(conforms, request_, layout):
    scene, sounds = request_.scene(), request_.sounds
    law = sound.predict_sound_errors(sounds, scene, layout, 320, "sound-power")
    wrong = drawn(scene, layout)
    found = []
    for one, error in zip(sounds, wrong, strict=True):  # W = ω² wᵀRw, with Rayleigh's matrix
        R = radiation_matrix(plate_pistons(PLATE), one.omega)
        power = [w @ R @ w for w in (one.reference, *(one.reference + error))]
        found.append(100 * np.sqrt(np.mean((np.array(power[1:]) / power[0] - 1) ** 2)))
    conforms.sampled(np.array(found) / law, 1, atol=0.12)
    again, _ = sound.simulate_sound_errors(sounds, wrong, "sound-power")
    conforms.independent(again, np.array(found), rtol=1e-9)


def test_mirrored_layouts_sound_alike(conforms, request_):
    scene = request_.scene()
    one = sound.average_sound_error(request_.sounds, scene, TURNED, 320)
    other = sound.average_sound_error(request_.sounds, scene, TURNED * [-1, 1, 1, 1], 320)
    conforms.invariance(other, one, rtol=1e-9)


def test_cameras_that_stand_square_are_moved_and_keep_the_rules(conforms, request_):
    scene = request_.scene()
    start = positions.places_at(
        SQUARE[:, :2], positions.nearest_distances(scene, SQUARE[:, :2], 24 / 36), 24 / 36
    )
    found = sound.move_cameras(request_.sounds, search.Surroundings(scene), start, 320)
    assert errors.is_allowed(scene, found)
    now, before = (
        sound.predict_sound_errors(request_.sounds, scene, one, 320) for one in (found, start)
    )
    conforms.closed_form(now.max(), below=0.5 * before.max())
    shape = [errors.layout_cost(scene, one, "mean") for one in (found, start)]
    conforms.closed_form(np.sqrt(shape[0] / shape[1]), below=1.15)


# The plan.


def test_plan_begins_with_that_for_the_shape_and_is_never_worse(conforms, made):
    shape = plan(plan_request(ASKED))
    for one, before in zip(made.options, shape.options, strict=True):
        np.testing.assert_array_equal(one.instead.plan.layout, before.layout)
        conforms.closed_form(one.error, below=one.instead.field.max() * (1 + 1e-12))
        assert np.isnan(one.bound)
        assert errors.is_allowed(one.scene, one.layout)


def test_gain_is_there_when_simulated(conforms, made, request_):
    (one,), (found,) = made.options, made.verified
    conforms.sampled(found.simulated / one.predicted, 1, atol=0.15)
    assert np.all(found.band[0] < found.simulated)
    assert np.all(found.simulated < found.band[1])
    before = one.instead.plan
    asked = before.scene, before.layout, 320, 400, 0, "least-squares"
    drawn_, _ = sound.simulate_sound_errors(request_.sounds, errors.draw_errors(*asked))
    conforms.sampled(found.simulated.max() / drawn_.max(), below=0.9)


POINT = [300.0, 200.0, 900.0]


def pressures(one, error):
    """Errors of the pressure at the point in % by Rayleigh's sum."""
    at = np.array(POINT)[:, None] / 1000
    true, wrong = (rayleigh_pressure(plate_pistons(PLATE), one.omega * w, at, one.omega)[0] for w in
                   (one.reference, error))  # fmt: skip
    return 100 * abs(wrong / true)


@pytest.mark.parametrize("layout", [SQUARE, TURNED], ids=["square", "turned"])
def test_predicted_pressures_at_a_point_are_those_of_draws(conforms, request_, layout):
    asked = plan_request({**ASKED, "goal": "sound-point", "point_mm": POINT})
    scene, sounds = request_.scene(), asked.sounds
    law = sound.predict_sound_errors(sounds, scene, layout, 320, "sound-point")
    wrong = drawn(scene, layout)
    found = [
        np.sqrt(np.mean([pressures(one, e) ** 2 for e in error]))
        for one, error in zip(sounds, wrong, strict=True)
    ]
    conforms.sampled(np.array(found) / law, 1, atol=0.12)
    again, _ = sound.simulate_sound_errors(sounds, wrong, "sound-point")
    conforms.independent(again, np.array(found), rtol=1e-9)


def test_one_plane_has_the_error_that_it_has_of_both(conforms):
    def expected(goal, **of):
        asked = plan_request({**ASKED, "modes": [1], "goal": goal, **of})
        return sound.predict_sound_errors(asked.sounds, asked.scene(), TURNED, 320, goal)[0]

    each = [expected("sound-plane", plane=plane) for plane in ("XZ", "YZ")]
    assert each[0] != each[1]
    conforms.invariance(max(each), expected("sound"), rtol=1e-12)


GAINS = {  # by goal: changed parameters, quantity, what it is a percentage of, at most of before
    "sound": ({}, "field", "largest pressure on a plane", 0.95),
    "sound-power": ({"modes": [1, 5]},  # mode (2, 2) has power, if no field
                    "power", "worst mode in % of its sound power", 1 + 1e-9),
    "sound-plane": ({"plane": "YZ", "modes": [1, 3]}, "field", "largest pressure on the plane",
                    0.95),
    "sound-point": ({"point_mm": POINT}, "pressure", "pressure at the point", 0.95),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("goal", GAINS)
def test_a_plan_for_a_sound_is_better_at_that_and_says_so(tmp_path, conforms, goal):
    changed, quantity, counted, most = GAINS[goal]
    values = {**ASKED, **changed, "goal": goal}
    words = [
        f"-p{key}={value if isinstance(value, str) else json.dumps(value)}"
        for key, value in values.items()
    ]
    done = thesis("plan", *words, "--out", "made", cwd=tmp_path)
    assert done.status == 0, done.err
    with xr.open_dataset(tmp_path / "made" / "plan.nc") as cube:
        now, before = (cube[name].values for name in ("predicted_error", "shape_plan_error"))
        conforms.sampled(cube["simulated_error"].values / now, 1, atol=0.2)
        assert cube.attrs["goal"] == goal
        assert all(name in cube.attrs["command"] for name in changed)
    now, before = now.max(), before.max()
    conforms.closed_form(now, below=most * before)
    less = 100 * (1 - now / before)
    assert f"have a {quantity} error of {before:.3g} %; this plan is {less:.0f} % lower" in done.out
    assert counted in (tmp_path / "made" / "plan.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["goal=sound"], 'goal: given "sound", allowed: "shape", or for the plate, with in_view 1'),
        (["goal=sound", "body=beam"], "for the plate"),
        (["goal=sound-power", "body=beam"], "for the plate"),
        (["goal=sound-plane", "body=beam"], "for the plate"),
        (
            ["goal=sound-plane", "body=plate", "plane=XY"],
            'plane: given "XY", allowed: "XZ" or "YZ"',
        ),
        (
            ["goal=sound-plane", "body=plate", "plane=YZ", "modes=[2]"],
            "modes: given 2, allowed: modes that are not silent on the plane",
        ),
        (["goal=sound-point", "body=plate"], "point_mm: given null, allowed: null, or with goal"),
        (["body=plate", "point_mm=[0,0,900]"], 'with goal "sound-point" [X, Y, Z]'),
        (["goal=sound-point", "body=plate", "point_mm=[0,0,-5]"], "point_mm[2]: given -5"),
        (["goal=sound-point", "body=plate", "point_mm=[0,0]"], "point_mm: given [0, 0], allowed"),
        (
            ["goal=sound-point", "body=plate", "point_mm=[0,0,20]"],
            "point_mm: given [0.0, 0.0, 20.0], allowed: Z of 44.53 or more",
        ),
        (
            ["goal=sound-point", "body=plate", "point_mm=[0,0,900]", "modes=[1,2]"],
            "modes: given 2, allowed: modes that are heard at point_mm",
        ),
        (["goal=noise"], 'goal: given "noise", allowed: "shape"'),
        (["goal=sound", "body=plate", "in_view=0.5"], "with in_view 1"),
        (["goal=sound", "body=plate", "objective=worst"], 'objective "mean"'),
        (["goal=sound", "body=plate", "modes=[5]"], "modes: given 5, allowed: modes that are not"),
        (["goal=sound", "body=plate", "modes=[30]", "frame_rates_hz=[50000]"], "modes: given 30"),
    ],
)
def test_what_cannot_be_planned_for_sound_is_refused_in_one_line(tmp_path, words, said):
    options = [word for one in words for word in ("-p", one)]
    done = thesis("plan", *options, "--out", "made", cwd=tmp_path)
    assert (done.status, done.out) == (2, "")
    (line,) = done.err.splitlines()
    assert line.startswith("thesis: plan: ")
    assert said in line
    assert not list(tmp_path.iterdir())


def test_another_body_than_the_plate_is_refused(request_):
    with pytest.raises(ParameterError, match="goal"):
        plan(request_, replace(request_.measured, name="mine"))
