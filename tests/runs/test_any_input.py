"""Whatever is given, the command ends with its result or with one line.

Hundreds of inputs; with ``--hypothesis-profile night`` eight times as many.
"""

import copy
import json
import resource
from contextlib import suppress

import pytest
import yaml
from command import thesis
from hypothesis import HealthCheck, given, settings, strategies as st

from thesis_lib.figure_sets.cube_file import cube_of
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.figure_sets.registry import STUDIES
from thesis_lib.laboratory.recording_files import example_rig, manifest_of
from thesis_lib.planning.request import PlanRequest, plan_request
from thesis_lib.runs.command_line import build_requests, parse_assignments
from thesis_lib.studies import storage
from thesis_lib.text import RefusedError

pytestmark = pytest.mark.slow


def many(examples):
    times = 8 if settings.get_current_profile_name() == "night" else 1
    return settings(max_examples=times * examples, derandomize=True, deadline=None, database=None,
                    suppress_health_check=list(HealthCheck))  # fmt: skip


ODD = ["", "null", "NaN", "1e999", "[[]]", '{"a":1,"a":2}', "[" * 3000, "9" * 5000, "\x1b[2J"]
TEXT = st.text(max_size=30) | st.sampled_from(ODD)
SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | TEXT
JUNK = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=10,
)
NAMES = st.sampled_from([*STUDIES, "ch3", "ch6"]) | TEXT
FIELDS = sorted({field for model in STUDIES.values() for field in model.model_fields} - {"cube"})
PLANNED = sorted(PlanRequest.model_fields)


def as_given(field, value):
    """A parameter as on the command line."""
    with suppress(ValueError, RecursionError):
        return f"{field}={value if isinstance(value, str) else json.dumps(value)}"
    return f"{field}="


GIVEN = st.builds(as_given, st.sampled_from(FIELDS) | TEXT, JUNK)
TO_PLAN = st.builds(as_given, st.sampled_from(PLANNED) | TEXT, JUNK)


def assert_one_line(status, out, err, words):
    assert status in (1, 2), (words, out[:300], err[:300])
    lines = err.splitlines()
    assert len(lines) == 1, (words, err[:1000])
    assert len(lines[0]) <= 400, (words, err)
    assert lines[0].isprintable(), (words, err)
    assert out == "", (words, out[:300])


def refused(place, *words):
    """Hold one command to what every refusal is; those that are allowed do not run."""
    before = sorted(place.rglob("*"))
    done = thesis(*words, cwd=place)
    assert done.warned == ()
    assert_one_line(done.status, done.out, done.err, words)
    assert sorted(place.rglob("*")) == before


@pytest.fixture(scope="module", autouse=True)
def memory():
    """All of them together take less than 1 GB more than the process had before."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1e9 / 1024


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("place")


@many(120)
@given(NAMES, st.lists(GIVEN, min_size=1, max_size=3))
def test_requests(place, name, given):
    if name.startswith("-"):
        return
    try:
        build_requests([name], parse_assignments(given))
    except RefusedError:
        refused(place, "run", name, *(word for one in given for word in ("-p", one)))


@many(40)
@given(TO_PLAN)
def test_plans(place, given):
    try:
        plan_request(parse_assignments([given]))
    except RefusedError:
        refused(place, "plan", "-p", given)


# Cubes.


@pytest.fixture(scope="module")
def cube():
    given = {"distances_mm": [600], "trials": 2, "modes": [1]}
    return cube_of(camera_study("beam-distance", given)).load()


@many(40)
@given(st.data())
def test_damaged_files_of_cubes(tmp_path_factory, cube, data):
    folder = tmp_path_factory.getbasetemp() / "cubes"
    if not folder.exists():
        folder.mkdir()
        storage.write_netcdf(cube, folder / "whole.nc")
    content = bytearray((folder / "whole.nc").read_bytes())
    places = st.integers(0, len(content) - 1)
    how = data.draw(st.sampled_from(["cut", "flip", "insert", "junk"]))
    if how == "cut":
        del content[data.draw(places) :]
    elif how == "insert":
        content[data.draw(places) : 0] = data.draw(st.binary(min_size=1, max_size=300))
    elif how == "junk":
        content = bytearray(data.draw(st.binary(max_size=600)))
    else:
        for _ in range(data.draw(st.integers(1, 8))):
            content[data.draw(places)] ^= data.draw(st.integers(1, 255))
    (folder / "any.nc").write_bytes(content)
    done = thesis("compare", "any.nc", "whole.nc", cwd=folder)
    if done.status:
        assert_one_line(done.status, done.out, done.err, how)
    assert sorted(one.name for one in folder.iterdir()) == ["any.nc", "whole.nc"]


# Manifests.


@pytest.fixture(scope="module")
def manifest(tmp_path_factory):
    text = yaml.safe_dump(manifest_of(example_rig()).model_dump(mode="json"))
    return yaml.safe_load(text), tmp_path_factory.mktemp("recording")


def places_in(values, path=()):
    """All places in nested values."""
    yield path
    inside = values.items() if isinstance(values, dict) else enumerate(
        values if isinstance(values, list) else [])  # fmt: skip
    for key, value in inside:
        yield from places_in(value, (*path, key))


@many(60)
@given(st.data())
def test_manifests(manifest, data):
    """No video is there, so whatever is written in it, none is measured."""
    whole, folder = manifest
    changed = copy.deepcopy(whole)
    for _ in range(data.draw(st.integers(1, 2))):
        *path, last = data.draw(st.sampled_from([one for one in places_in(changed) if one]))
        where = changed
        for key in path:
            where = where[key]
        if data.draw(st.booleans()):
            where[last] = data.draw(JUNK)
        elif isinstance(where, dict):
            where[data.draw(TEXT)] = where.pop(last)
    try:
        text = yaml.safe_dump(changed)
        if data.draw(st.integers(0, 4)) == 0:
            at = data.draw(st.integers(0, len(text)))
            text = text[:at] + data.draw(TEXT) + text[at + data.draw(st.integers(0, 9)) :]
        (folder / "m.yaml").write_text(text, encoding="utf-8")
    except (RecursionError, UnicodeEncodeError):
        return
    refused(folder, "measure", "m.yaml")
