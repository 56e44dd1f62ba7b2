"""Plans for the plate's sound: the criterion against draws, gains, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from command import refusal, thesis
from scipy.stats import qmc

from thesis_lib.acoustics.planes import plate_pistons
from thesis_lib.acoustics.radiation import radiation_matrix, rayleigh_pressure
from thesis_lib.facts import setups
from thesis_lib.planning import errors, positions, sound
from thesis_lib.planning.planner import plan
from thesis_lib.planning.request import plan_request
from thesis_lib.vision.pinhole import project
from thesis_lib.vision.triangulation import triangulate

PLATE = setups.thesis_plate()
ASKED = {
    "body": "plate", "amplitude_mm": 10, "counts": [2], "resolutions_px": [[320, 180]],
    "target_percent": None, "starts": 0, "step_deg": 20, "trials": 400,
}  # fmt: skip
SQUARE = np.array([[0.0, 0.6, 0.75, 24 / 36], [np.pi, 0.6, 0.75, 24 / 36]])
TURNED = SQUARE + [np.radians(3), 0, 0, 0]
POINT = [300.0, 200.0, 900.0]


@pytest.fixture(scope="module")
def request_():
    return plan_request({**ASKED, "goal": "sound"})


@pytest.fixture(scope="module")
def made(request_):
    return plan(request_)


def drawn(scene, layout):
    """Deflection errors (modes, draws, markers) in m from whole pixels, without any law."""
    P, body = positions.place_cameras(scene, layout, 320).P, scene.body
    shift = qmc.Sobol(2 * len(P), rng=0).random_base2(9) - 0.5
    shift = np.moveaxis(shift.reshape(-1, len(P), 2), 0, 2)[..., None]

    def found(points):
        return triangulate(P, np.rint(project(P, points)[:, :, None] + shift) - shift)[2]

    moved = np.moveaxis(body.deflected(scene.peaks), 1, 0)
    rest = found(body.points)
    return np.stack([found(one) - rest - one[2] for one in moved])


def fields(request, wrong):
    """Rms errors of the field in % on the worse plane, by Rayleigh's sum at some of its points."""
    rms = []
    for one, error in zip(request.sounds, wrong, strict=True):
        worst = []
        for operator, largest in zip(one.operators, one.largest, strict=True):
            points = replace(operator.plane, shape=(25, 17)).points
            sent = [rayleigh(one, e, points) for e in error]
            worst.append(100 * np.sqrt(np.mean(np.abs(sent) ** 2)) / largest)
        rms.append(np.nanmax(worst))
    return np.array(rms)


def rayleigh(one, moved, points):
    """Pressures of a displacement at the mode's frequency."""
    return rayleigh_pressure(plate_pistons(PLATE), one.omega * moved, points, one.omega)


def powers(request, wrong):
    """Rms errors of the sound power in %: W = ω² wᵀRw, with Rayleigh's matrix."""
    off = []
    for one, error in zip(request.sounds, wrong, strict=True):
        R = radiation_matrix(plate_pistons(PLATE), one.omega)
        true, *power = (w @ R @ w for w in (one.reference, *(one.reference + error)))
        off.append(np.array(power) / true - 1)
    return 100 * np.sqrt(np.mean(np.square(off), axis=1))


def pressures(request, wrong):
    """Rms errors of the pressure at the point in %."""
    at, ratios = np.array(POINT)[:, None] / 1000, []
    for one, error in zip(request.sounds, wrong, strict=True):
        true = rayleigh(one, one.reference, at)
        ratios.append([np.abs(rayleigh(one, e, at) / true) for e in error])
    return 100 * np.sqrt(np.mean(np.square(ratios), axis=(1, 2)))


@pytest.mark.slow
@pytest.mark.parametrize("layout", [SQUARE, TURNED], ids=["square", "turned"])
def test_predicted_errors_are_those_of_draws(conforms, request_, layout):
    scene, sounds = request_.scene(), request_.sounds
    wrong = drawn(scene, layout)
    law = sound.predict_sound_errors(sounds, scene, layout, 320)
    conforms.sampled(fields(request_, wrong[:, ::4]) / law, 1, atol=0.12)
    at_point = plan_request({**ASKED, "goal": "sound-point", "point_mm": POINT})
    for request, goal, found in (
        (request_, "sound-power", powers(request_, wrong)),
        (at_point, "sound-point", pressures(at_point, wrong)),
    ):
        law = sound.predict_sound_errors(request.sounds, scene, layout, 320, goal)
        conforms.sampled(found / law, 1, atol=0.12)
        again, _ = sound.simulate_sound_errors(request.sounds, wrong, goal)
        conforms.independent(again, found, rtol=1e-9)


def test_mirrored_layouts_sound_alike(conforms, request_):
    scene = request_.scene()
    one = sound.average_sound_error(request_.sounds, scene, TURNED, 320)
    other = sound.average_sound_error(request_.sounds, scene, TURNED * [-1, 1, 1, 1], 320)
    conforms.invariance(other, one, rtol=1e-9)


def test_cameras_that_stand_square_are_moved_and_keep_the_rules(conforms, request_):
    scene, sounds = request_.scene(), request_.sounds
    distances = positions.nearest_distances(scene, SQUARE[:, :2], 24 / 36)
    start = positions.combine_positions(SQUARE[:, :2], distances, 24 / 36)
    found = sound.move_cameras(sounds, scene, start, 320)
    assert positions.is_allowed(scene, found)
    now, before = (sound.predict_sound_errors(sounds, scene, one, 320) for one in (found, start))
    conforms.closed_form(now.max(), below=0.5 * before.max())
    shape = [errors.layout_cost(scene, one, "mean") for one in (found, start)]
    conforms.closed_form(np.sqrt(shape[0] / shape[1]), below=1.15)


# The plan.


def test_plan_is_never_worse_than_that_for_the_shape_but_better(conforms, made, request_):
    shape = plan(plan_request(ASKED))
    (one,), (before,) = made.options, shape.options
    np.testing.assert_array_equal(one.shape_plan.layout, before.layout)
    conforms.closed_form(one.error, below=one.shape_plan_error.max() * (1 + 1e-12))
    assert positions.is_allowed(one.scene, one.layout)
    conforms.sampled(one.simulated / one.predicted, 1, atol=0.15)
    assert np.all((one.band[0] < one.simulated) & (one.simulated < one.band[1]))
    asked = before.scene, before.layout, 320, 400, 0, "least-squares"
    simulated, _ = sound.simulate_sound_errors(request_.sounds, errors.draw_errors(*asked))
    conforms.sampled(one.simulated.max() / simulated.max(), below=0.9)


GAINS = {  # by goal: changed parameters, quantity, at most of before
    "sound-point": ({"point_mm": POINT, "modes": [1]}, "pressure", 0.95),
    "sound-plane": ({"plane": "YZ", "modes": [1, 3]}, "field", 0.95),
    "sound-power": ({"modes": [1, 5]}, "power", 1 + 1e-9),  # mode (2, 2) has power, if no field
}


@pytest.mark.slow
@pytest.mark.few(1)
@pytest.mark.parametrize("goal", GAINS)
def test_a_plan_for_a_sound_is_better_at_that_and_says_so(tmp_path, conforms, goal):
    changed, quantity, most = GAINS[goal]
    words = [f"-p{key}={json.dumps(value)}" for key, value in (ASKED | changed).items()]
    done = thesis("plan", f"-pgoal={goal}", *words, "--out", "made", cwd=tmp_path)
    assert done.status == 0, done.err
    with xr.open_dataset(tmp_path / "made" / "plan.nc") as cube:
        now, before = (cube[name].values for name in ("predicted_error", "shape_plan_error"))
        conforms.sampled(cube["simulated_error"].values / now, 1, atol=0.2)
        assert cube.attrs["goal"] == goal
        assert all(name in cube.attrs["command"] for name in changed)
    conforms.closed_form(now.max(), below=most * before.max())
    assert f"have a {quantity} error of {before.max():.3g} %" in done.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["goal=noise"], 'goal: given "noise", allowed: "shape"'),
        (["goal=sound-power", "body=beam"], "for the plate"),
        (["goal=sound-plane", "body=plate", "plane=YZ", "modes=[2]"],
         "modes: given 2, allowed: modes heard on YZ"),
        (["goal=sound-point", "body=plate", "point_mm=[0,0,20]"],
         "point_mm: given [0.0, 0.0, 20.0], allowed: Z of 44.53 or more"),
    ],
)  # fmt: skip
def test_what_cannot_be_planned_for_sound_is_refused_in_one_line(tmp_path, words, said):
    options = [word for one in words for word in ("-p", one)]
    line = refusal(thesis("plan", *options, "--out", "made", cwd=tmp_path))
    assert line.startswith("thesis: plan: ")
    assert said in line
    assert not list(tmp_path.iterdir())
