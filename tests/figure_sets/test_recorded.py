"""Recordings that are data: what was measured on them is what the code measures, or it is said."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from thesis_lib.figure_sets.recorded import STEP

from thesis_lib import asides, files
from thesis_lib.facts import setups
from thesis_lib.figure_sets import recorded, repeated, sample
from thesis_lib.figure_sets.lab_layout import recordings as lab_layout_film
from thesis_lib.figure_sets.lab_modes.recordings import beam_rigs
from thesis_lib.figure_sets.registry import STUDIES, validate
from thesis_lib.laboratory import recordings as lab_films
from thesis_lib.studies import cache

EVERY = {of.request.name: of for of in recorded.every()}


@pytest.mark.parametrize("name", EVERY)
def test_the_data_are_of_this_code(name):
    """If not, `thesis record` makes them anew."""
    assert EVERY[name].kept() is not None


def test_the_example_is_of_this_code():
    """If not, `thesis record example` makes it anew, in a minute."""
    assert sample.current() is not None


def test_they_are_small_and_no_file_is_left_over():
    folder = setups.data_folder().parent / "recordings"
    there = {path.name for path in folder.iterdir()} - {"README.md"}
    names = [*EVERY, *(others.path.stem for others in repeated.every()), sample.path().stem]
    assert there == {f"{name}.{kind}" for name in names for kind in ("nc", "json")}
    assert sum(path.stat().st_size for path in folder.iterdir()) <= 10e6


def test_every_figure_set_of_chapter_5_is_computed_from_them():
    of = [one for name in STUDIES for one in recorded.behind(validate(name, {"trials": 7}))]
    assert len(of) > len(EVERY)
    assert {one.request.name for one in of} == set(EVERY)
    assert all(one.made_from == EVERY[one.request.name].made_from for one in of)


def assert_same_tracks(kept, now):
    """To a step of what is kept, but for one coordinate in a thousand, to 20 steps."""
    far = np.abs(kept - now) / STEP
    assert np.array_equal(np.isnan(kept), np.isnan(now))
    assert np.nanmax(far) < 20
    assert np.mean(far > 1.6) < 1e-3


@pytest.mark.slow
def test_a_sample_filmed_now_is_the_data():
    """Noise and rounding included; on another processor one pixel in many is rounded otherwise."""
    of = EVERY["lab-layout"]
    data = recorded.measured(of)
    rig = lab_layout_film.rig_of(of.request, of.request.filmed_settings()[1])
    for index in (0, 1):
        for name, now in zip(("tracks", "quiet"), lab_layout_film.tracks(rig, index), strict=True):
            kept = data[name].values[1, index]
            assert_same_tracks(kept[: len(now)], now)
    of = EVERY["lab-modes-recordings"]
    rig = beam_rigs(of.request, of.request.seed)[0]
    now, kept = lab_films.record([rig], of.request.frames), recorded.measured(of)
    assert_same_tracks(kept["tracks"].values[0], now["tracks"].values[0])


@pytest.mark.parametrize("name", EVERY)
def test_recordings_rest_on_what_films_and_follows_and_on_nothing_that_only_asks(name):
    files = {f"{path.parent.name}/{path.name}" for path in EVERY[name].sources}
    assert {"laboratory/render.py", "tracking/tracker.py", "vision/pinhole.py",
            "thesis/structures.toml"} <= files  # fmt: skip
    assert not any(one.startswith(("studies/", "web/", "plotting/", "ledger/")) for one in files)


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Recordings of which the film is quickly made, in a project of their own."""
    monkeypatch.setattr(recorded, "shipped", lambda: tmp_path)
    monkeypatch.setattr(cache, "workplace", lambda: tmp_path)
    (tmp_path / "requirements").mkdir()
    (tmp_path / "requirements" / "book.txt").touch()
    code = tmp_path / "film.py"
    code.write_text("a = 1\n")
    films = []

    def film(request):
        films.append(request)
        values = np.random.default_rng(0).normal(500, 300, (2, 5, 2, 30))
        values[0, 1, :, 7] = np.nan
        data = xr.Dataset({"tracks": (("camera", "frame", "axis", "marker"), values)})
        data["tracks"].attrs["units"] = "px"
        data["picture"] = (("row", "column"), np.arange(12, dtype=np.uint8).reshape(3, 4))
        data["pose"] = ("i", values[0, 0, 0, :3])
        return data

    return recorded.Recordings(EVERY["laboratory"].request, film, [code]), films


def test_what_is_kept_is_what_is_filmed_to_the_last_bit(own):
    of, films = own
    filmed = recorded.measured(of)
    assert len(films) == 1
    recorded.record(of)
    shutil.rmtree(of.path.parents[2] / "build")
    kept = recorded.measured(of)
    assert len(films) == 2
    for name, values in filmed.data_vars.items():
        assert values.dtype == kept[name].dtype
        np.testing.assert_array_equal(values, kept[name], strict=True)
    steps = kept["tracks"].values / STEP
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    np.testing.assert_allclose(kept["tracks"], of.film(None)["tracks"], atol=STEP / 2 * 1.001)


def broken(of):
    cut = of.path.read_bytes()
    return {
        "cut": lambda: of.path.write_bytes(cut[: len(cut) // 2]),
        "empty": lambda: of.path.write_bytes(b""),
        "edited": lambda: of.path.write_bytes(cut[:-9] + bytes([cut[-9] ^ 1]) + cut[-8:]),
        "other code": lambda: of.sources[0].write_text("a = 2\n"),
    }


@pytest.mark.parametrize("how", ["cut", "empty", "edited", "other code"])
def test_what_is_damaged_or_of_other_code_is_named_and_filmed_anew(own, how, capsys):
    of, films = own
    recorded.record(of)
    broken(of)[how]()
    before = len(asides.asides())
    again = recorded.measured(of)
    assert len(films) == 2
    (said,) = asides.asides()[before:]
    assert str(of.path) in said
    assert said.endswith("rendered anew, which takes minutes")
    np.testing.assert_array_equal(again["tracks"], recorded._filmed(of.film, of.request)["tracks"])


def test_another_request_is_filmed_without_a_word(own):
    of, films = own
    recorded.record(of)
    before = asides.asides()
    recorded.measured(replace(of, request=of.request.model_copy(update={"seed": 3})))
    assert len(films) == 2
    assert asides.asides() == before


def test_a_record_without_its_file_is_nothing(own):
    of, films = own
    recorded.record(of)
    of.path.unlink()
    recorded.measured(of)
    assert len(films) == 2


@pytest.mark.parametrize(
    ("edit", "same"),
    [
        ('"""Other."""\nimport os\n\n\ndef f(x):\n    """One.\n\n    Two."""\n    return x\n', 1),
        ("import os\n# a note\ndef f(x):  # another\n\n    return x\n", 1),
        ("import os\ndef f(x):\n    return x + 0\n", 0),
        ('import os\ndef f(x):\n    return "# x"\n', 0),
        ('import os\ndef f(x):\n    y = """no docstring"""\n    return x\n', 0),
    ],
)  # fmt: skip
def test_comments_do_not_change_the_code(tmp_path, edit, same):
    path, other = tmp_path / "a.py", tmp_path / "b.py"
    path.write_text('"""Words."""\n\nimport os\n\n\ndef f(x):\n    return x\n')
    other.write_text(edit)
    assert (files.code(path) == files.code(other)) is bool(same)


def test_text_in_the_code_counts(tmp_path):
    path = tmp_path / "a.py"
    for text in ("x = '# a'\n", "x = '# b'\n", 'x = f"{1}#{2}"\n', 'x = """a\n# b\n"""\n'):
        path.write_text(text)
        assert files.code(path) == text.encode()
