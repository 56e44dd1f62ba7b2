"""Other recordings: what is kept of them is what filming them gives, and filming goes on."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import xarray as xr
from command import thesis
from thesis_lib.figure_sets.repeated import STEP

from thesis_lib import asides
from thesis_lib.figure_sets import record, recorded, repeated
from thesis_lib.figure_sets.lab_modes.recordings import beam_rig
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES, validate
from thesis_lib.figure_sets.run import cube_of
from thesis_lib.laboratory import another
from thesis_lib.laboratory.direct import seen
from thesis_lib.studies.request import ParameterError

EVERY = {others.request.name: others for others in repeated.every()}
FILMED = [name for name, one in FIGURE_SETS.items() if one.others]
OTHERS = [name for name in FILMED if name != "lab-elevation"]


@pytest.mark.parametrize("name", EVERY)
def test_they_are_of_this_code_and_numbered(name):
    """If not, `thesis record` renders them anew.

    Markers that a camera lost but for a handful of frames have a deflection, and no scatter.
    """
    data = EVERY[name].kept()
    assert data is not None
    assert data["recording"].values.tolist() == list(range(1, EVERY[name].count + 1))
    known = data["deflection"].notnull()
    told = data["deviation"].notnull()
    assert (known | ~told).all()
    assert float(told.sum()) > 0.99 * float(known.sum())
    assert known.mean() > 0.5
    assert (data["deflection"].std("recording") > STEP).where(known.all("recording")).mean() > 0.5


def test_together_they_are_small():
    assert sum(others.path.stat().st_size for others in EVERY.values()) <= 2e6


@pytest.mark.slow
def test_one_of_them_filmed_now_is_what_is_kept(tmp_path):
    """Which one, all that they were made from decides; on other processors few values differ."""
    digests = " ".join(others.made_from for others in EVERY.values())
    rng = np.random.default_rng(list(digests.encode()))
    others = list(EVERY.values())[rng.integers(len(EVERY))]
    number = int(rng.integers(others.count)) + 1
    now, kept = others.made(number), others.kept().isel(recording=number - 1)
    assert set(now.data_vars) == set(kept.data_vars)
    for name, values in now.data_vars.items():
        assert np.array_equal(np.isnan(values), np.isnan(kept[name])), name
        # One grey value that is rounded otherwise moves all markers of its setting by nanometres.
        far = np.abs(values - kept[name]).values / (1.6 * STEP + 0.1 * kept["deviation"].values)
        assert np.mean(far[np.isfinite(far)] > 1) < 0.01, name


@pytest.mark.parametrize(
    "name", ["lab-elevation", *(pytest.param(n, marks=pytest.mark.slow) for n in OTHERS)]
)
def test_the_trials_of_a_cube_are_other_recordings(name):
    values = {"trials": 2} | ({"plane_shape": [7, 5]} if name == "lab-plate" else {})
    others, cube = (cube_of(validate(name, values | {"repeats": n})) for n in (3, 1))
    assert others.sizes["trial"] == 3
    assert others.attrs["draws"] == "2 recordings"
    assert cube.attrs["draws"] == STUDIES[name].draws
    assert others["trial"].attrs["long_name"].startswith("recording")
    drawn = {str(n) for n, v in others.data_vars.items() if "trial" in v.dims}
    for one in set(map(str, others.data_vars)) - drawn:  # what one recording tells is the same
        if not one.startswith(("pressure_measured", "best_and_worst")):
            xr.testing.assert_allclose(others[one], cube[one], rtol=1e-9)
    for one in drawn:
        first, same = (part[one].isel(trial=0).values for part in (others, cube))
        np.testing.assert_allclose(first, same, rtol=1e-9)
    error = others["mean_error"].transpose("trial", ...).values
    assert np.mean(np.abs(error[1] - error[2]) > 1e-3 * error[1]) > 0.3


def test_few_of_what_is_kept_are_not_taken_unless_asked_for(monkeypatch):
    product, asked = FIGURE_SETS["lab-layout"].others, validate("lab-layout", {})
    for count, taken in ((0, 0), (repeated.FEW - 1, 0), (repeated.FEW, repeated.FEW), (19, 19)):
        monkeypatch.setattr(repeated.Others, "count", count)
        assert repeated.asked_for(product, asked).trials == taken
        fewer = asked.model_copy(update={"trials": 3})
        assert repeated.asked_for(product, fewer).trials == min(3, taken)
    assert repeated.asked_for(product, validate("lab-layout", {"repeats": 3})).trials == 2
    other = validate("lab-layout", {"distance_mm": 600.0, "repeats": 1})
    assert repeated.asked_for(product, other).trials == 0


def test_deflections_stand_where_their_settings_are():
    """A cube's errors follow from the kept deflections, setting by setting."""
    kept = EVERY["lab-layout"].kept()
    cube = cube_of(validate("lab-layout", {"repeats": 2}))
    true = cube["reference_deflection"].values[0]
    error = kept["deflection"].values[0, :, 0] - true
    rms = 100 * np.sqrt(np.nanmean(error**2, axis=1)) / np.abs(true).max()
    np.testing.assert_allclose(cube["mean_error"].values[:, 0, 1], rms, rtol=1e-9)


@pytest.mark.parametrize("name", FILMED)
@pytest.mark.parametrize("given", [0, -1, 2.5, 1001, float("nan"), "many", True, None])
def test_no_recording_is_refused_in_one_line(name, given):
    with pytest.raises(ParameterError) as refused:
        validate(name, {"repeats": given})
    said = str(refused.value)
    assert said.startswith(f"{name}: repeats: given ")
    assert "a whole number from 1 to 1000" in said
    assert "\n" not in said


@pytest.mark.parametrize("given", ["0", "NaN"])
def test_the_command_refuses_it_with_status_2(given):
    done = thesis("run", "lab-elevation", "-p", f"repeats={given}")
    assert done.status == 2
    assert len(done.err.splitlines()) == 1
    assert "repeats" in done.err


# Filming, with a film that is quickly made.


@dataclass
class Film:
    """A module that films; each of its numbers gives other deflections."""

    stopped_at: int = 0
    films = ()

    def film(self, request, number):
        if number == self.stopped_at:
            raise KeyboardInterrupt
        self.films = (*self.films, (request.name, number))
        values = np.random.default_rng(number).normal(0, 1e-3, (2, 1, 5))
        values[0, 0, 3] = np.nan
        return another.of_every_setting([(own, np.abs(own) / 100) for own in values])


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Others of two requests in a folder of their own."""
    film, code = Film(), tmp_path / "film.py"
    code.write_text("a = 1\n")
    monkeypatch.setattr(repeated, "import_module", lambda _: film)
    monkeypatch.setattr(recorded, "sources_of", lambda _: [code])
    every = [replace(EVERY[name], folder=tmp_path) for name in ("lab-layout", "lab-elevation")]
    monkeypatch.setattr(repeated, "every", lambda: every)
    monkeypatch.setattr(recorded, "every", list)
    monkeypatch.setattr(record, "workplace", lambda: tmp_path)
    return film, every, code


def test_what_is_kept_is_what_is_filmed_to_a_step(own):
    film, (others, _), _ = own
    for _ in range(3):
        others.film()
    kept = others.kept()
    assert kept["recording"].values.tolist() == [1, 2, 3]
    for number in (1, 2, 3):
        made = film.film(others.request, number)
        for name in ("deflection", "deviation"):
            here = kept[name].sel(recording=number)
            np.testing.assert_allclose(here, made[name], rtol=0, atol=0.501 * STEP)
    np.testing.assert_array_equal(
        kept.isel(recording=1)["deflection"], others.made(2)["deflection"]
    )


def test_filming_goes_on_where_it_was_stopped(own):
    film, every, _ = own
    said, film.stopped_at = [], 3
    with pytest.raises(KeyboardInterrupt):
        record.record(5, said.append)
    assert [others.count for others in every] == [2, 2]
    film.stopped_at = 0
    record.record(5, said.append)
    assert [others.count for others in every] == [4, 4]
    assert film.films == tuple((one.request.name, n) for n in (1, 2, 3, 4) for one in every)
    assert all("left" in line for line in said)
    assert len(said) == 8
    record.record(5, said.append)  # all is there: anew
    assert len(film.films) == 16


@pytest.mark.parametrize("how", ["cut", "other code"])
def test_what_is_damaged_or_of_other_code_is_named_and_left_out(own, how):
    _, (others, _), code = own
    others.film()
    before = len(asides.asides())
    if how == "cut":
        others.path.write_bytes(others.path.read_bytes()[:99])
    else:
        code.write_text("a = 2\n")
    assert others.kept() is None
    assert others.count == 0
    assert str(others.path) in asides.asides()[before]


# Cameras that are put up again.


def test_a_camera_put_up_again_is_a_little_elsewhere_and_reads_less():
    request = validate("lab-modes", {}).others
    rig = beam_rig(request, 0, 2, 60.0)
    again = another.put_up_again(rig)
    small = another.windowed(rig)
    for one, other, part in zip(rig.cameras, again.cameras, small.cameras, strict=True):
        R = other.R_camera_world
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        turn = np.degrees(np.arccos((np.trace(R @ one.R_camera_world.T) - 1) / 2))
        assert 0.01 < turn < 0.5
        assert 1e-4 < np.linalg.norm(other.centre - one.centre) < 5e-3
        assert part.size[0] <= one.size[0]
        assert part.size[1] < one.size[1] / 2


def test_a_window_of_the_sensor_shows_the_same_markers():
    request = validate("lab-modes", {"shot_noise": 0, "read_noise": 0}).others
    rig = beam_rig(request, 0, 3, 480.0)
    rig = replace(rig, stations=rig.stations[:1])
    station, corner = another.window_of(rig, rig.stations[0])
    (whole,), (part,) = seen(rig), seen(replace(rig, stations=(station,)))
    np.testing.assert_allclose(part.centres + corner[:, None], whole.centres, atol=2e-3)
