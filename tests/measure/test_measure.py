"""``thesis measure`` as a stranger runs it: the example, broken folders, interruptions."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import pyuff
import xarray as xr
import yaml
from command import Done, hears_signals, thesis
from filelock import FileLock

from thesis_lib.figure_sets import record
from thesis_lib.files import CACHE_TAG, LOCK_NAME, RECORD_NAME, STAGING_PREFIX, put_files
from thesis_lib.laboratory import recording_files
from thesis_lib.laboratory.recording_files import example_manifest, example_rig, write_example
from thesis_lib.measure import steps as steps_module
from thesis_lib.measure.feasibility.assess import assess_manifest
from thesis_lib.measure.fitting import result
from thesis_lib.measure.pipeline import OUTPUT_FILES
from thesis_lib.measure.recordings.manifest import Manifest, read_manifest, write_manifest
from thesis_lib.measure.recordings.validation import markers_of
from thesis_lib.measure.report import animation
from thesis_lib.measure.report.warnings import check_shape
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision.pinhole import project_points
from thesis_lib.vision.simulation import assurance_criterion

pytestmark = pytest.mark.slow  # for the report of conformance


def with_digests(names):
    return [*(f".{name}.sha256" for name in names), *names]


SIZE_PX = (960, 540)  # of the example here: what is said of it holds for more pixels, too
WHOLE = [CACHE_TAG, *with_digests(["calibration.nc", "sound.nc"])]
TRACKS = [f"tracks-{k:02d}.nc" for k in range(3)]
CENTRES = [f"tracks-{k:02d}.npy" for k in range(3)]
STEPS = sorted([*WHOLE, *with_digests(TRACKS), *CENTRES])
RESULTS = {
    RECORD_NAME, "calibration.nc", "cameras.toml", "cameras.yaml", "figures", "measured.mat",
    "measured.nc", "motion.csv", "motion.nc", "motion.uff", "report.html", "shape.gif", "shape.mp4",
    "shapes.csv", "shapes.uff", "tracked.mp4", "vtk",
}  # fmt: skip


def begun(*arguments):
    """The command under way in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "thesis_lib", *map(str, arguments)],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        encoding="utf-8", start_new_session=True, preexec_fn=hears_signals,
    )  # fmt: skip


def ended(process):
    """How a process ended, and what it said."""
    try:
        out, err = process.communicate(timeout=300)
    finally:
        process.kill()
    return Done(process.returncode, out, err)


def copied(folder, to, results=False):
    """A copy of a recording that a test may break; times of change stay, so that steps count.

    With `results` the folder ``measured`` comes along, without its results but with its steps.
    """
    unwanted = RESULTS if results else {"measured"}

    def ignored(place, names):  # a step may be named like a result
        return set() if Path(place).name == ".steps" else unwanted & set(names)

    shutil.copytree(folder, to, ignore=ignored)
    return to


def change_manifest(folder, change):
    path = folder / "manifest.yaml"
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    change(values)
    path.write_text(yaml.safe_dump(values, sort_keys=False, allow_unicode=True), encoding="utf-8")


class Page(HTMLParser):
    """What a page loads, its pictures' descriptions, its text."""

    def __init__(self, path):
        super().__init__()
        self.loaded: list[str] = []
        self.pictures: list[str | None] = []
        self.text = self.styles = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        self.loaded += [value for name, value in attrs
                        if name in {"src", "srcset", "data", "poster", "action"}
                        or (name == "href" and tag != "a")]  # fmt: skip
        if tag == "img":
            self.pictures.append(dict(attrs).get("alt"))

    def handle_data(self, data):
        self.text += data
        self.styles += data if self.lasttag == "style" else ""


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The example, as the command makes it with fewer pixels; nobody changes it."""
    folder = tmp_path_factory.mktemp("example") / "recording"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording_files, "EXAMPLE_SIZE_PX", SIZE_PX)
        done = thesis("measure", "--example", folder)
    assert (done.status, done.err) == (0, "")
    assert done.out.splitlines()[-1] == f"Now run: thesis measure {folder / 'manifest.yaml'}"
    return folder


@pytest.fixture(scope="module")
def measured(example):
    """The example's folder after a measurement by a process of its own."""
    done = ended(begun("measure", example / "manifest.yaml"))
    assert (done.status, done.err) == (0, "")
    assert done.out.splitlines()[-1] == f"Open {example / 'measured' / 'report.html'}"
    return example


@pytest.fixture(scope="module")
def rig():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording_files, "EXAMPLE_SIZE_PX", SIZE_PX)
        return example_rig()


@pytest.fixture
def still(monkeypatch):
    """Leave out the films, which take time and change no number."""
    for film in ("write_shape", "write_mp4"):
        monkeypatch.setattr(animation, film, lambda *_: None)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def stamps(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / ".steps").iterdir()}


def results_of(folder):
    return xr.load_dataset(folder / "measured.nc")


@pytest.fixture(scope="module")
def data(measured):
    return results_of(measured / "measured")


def assert_same_results(one, other):
    """Byte by byte, but for what tells when it was made."""
    assert set(one.variables) == set(other.variables)
    for name in one.variables:
        assert one[name].dtype == other[name].dtype
        assert one[name].values.tobytes() == other[name].values.tobytes(), name
        assert one[name].attrs == other[name].attrs
    for key in set(one.attrs) | set(other.attrs):
        assert key == "created" or one.attrs[key] == other.attrs[key], key


# The example, against what was rendered.


def test_it_is_checked_before_anything_is_filmed(example, rig, tmp_path):
    assert read_manifest(example / "manifest.yaml") == example_manifest(rig)
    write_manifest(example_manifest(example_rig()), tmp_path / "manifest.yaml")
    done = thesis("measure", tmp_path / "manifest.yaml", "--check")
    assert (done.status, done.err) == (0, "")
    assert "smallest deflection" in done.out
    assert done.out.endswith("It will do.\n")
    assert names(tmp_path) == ["manifest.yaml"]


def test_the_deflection_is_the_rendered_one(conforms, data, rig):
    part = rig.motion.components[0]
    true = part.amplitude * part.shape(rig.motion.structure, rig.markers.centres)
    found = data["deflection"].values
    conforms.closed_form(np.sqrt(np.mean((found - true) ** 2)), below=0.005 * np.abs(true).max())
    conforms.closed_form(assurance_criterion(found, true), above=0.9999)
    quadrature = np.sqrt(np.mean(data["quadrature"] ** 2))
    conforms.closed_form(quadrature, below=0.003 * np.abs(true).max())
    # Before anything was filmed that was the most that compressed videos would leave of error.
    predicted = assess_manifest(example_manifest(rig)).verdict.compressed
    conforms.closed_form(np.abs(found - true).max() / np.abs(true).max(), below=predicted)
    assert data.attrs["most_similar"] == "bending 1"
    conforms.closed_form(float(data["mac"].max()), above=0.9999)
    assert (data["cameras_seen"] == 3).all()


def test_the_frequency_is_the_rendered_one(conforms, data, rig):
    true = rig.motion.components[0].frequency
    error = float(data["frequency_of_tracks"]) - true
    conforms.sampled(abs(error), below=max(1e-3, 5 * float(data["frequency_deviation"])))
    conforms.closed_form(abs(float(data["frequency"]) - true), below=1e-3)
    conforms.sampled(float(data["frequency_deviation"]), below=1e-3)  # by few parts


def test_the_cameras_are_where_they_were(conforms, data, rig):
    starts = np.array([station.start for station in rig.stations])
    frames = (data["delay"].values - (starts - starts[0])) * rig.stations[0].frame_rate
    conforms.closed_form(np.abs(frames).max(), below=0.05)
    true = np.array([station.camera.centre for station in rig.stations])
    found = data["camera_centre"].values
    conforms.closed_form(np.linalg.norm(found - true, axis=1).max(), below=1e-4)
    # Without what the structure's frame is off, which comes from a few markers' images.
    middle, true_middle = found.mean(axis=0), true.mean(axis=0)
    U, _, Vt = np.linalg.svd((found - middle).T @ (true - true_middle))
    turn = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    off = np.linalg.norm((found - middle) @ turn - (true - true_middle), axis=1)
    conforms.sampled(off, below=4 * data["centre_deviation"].values)
    focal = data["K"].values[:, 0, 0] - [station.camera.K[0, 0] for station in rig.stations]
    conforms.sampled(np.abs(focal), below=4 * data["focal_deviation"].values)


@pytest.mark.nightly
def test_rendered_and_measured_now_it_is_what_is_kept_for_the_book(tmp_path):
    """But for last digits, which another processor has otherwise."""
    now = record.measure_recording(write_example(tmp_path / "example", str), tmp_path / "steps")
    data = record.read_example()
    assert set(now.variables) == set(data.variables)
    error = data["standard_error"].values
    far = np.abs(now["deflection"].values - data["deflection"].values) / error
    assert far.max() < 0.05
    for name in record.ROUNDED_VARIABLES:
        one, other = now[name].values, data[name].values
        assert np.array_equal(np.isnan(one), np.isnan(other)), name
        assert np.nanquantile(np.abs(one - other), 0.99) < 20 * record.TRACK_STEP_PX, name
    assert [one.code for one in check_shape(now)] == [one.code for one in check_shape(data)]


# What is written.


def test_every_file_is_there_and_the_report_loads_no_other(measured, data):
    out = measured / "measured"
    assert names(out) == sorted(RESULTS | {".steps"})
    files = {file for file in out.rglob("*.*") if not {".steps", RECORD_NAME} & {*file.parts}}
    assert files == {file for one in OUTPUT_FILES for file in out.glob(one)}
    assert names(out / ".steps") == STEPS
    page = Page(out / "report.html")
    assert all(source.startswith("data:") for source in page.loaded)
    assert len(page.pictures) == len(names(out / "figures")) == 8
    assert all(page.pictures)
    assert "http" not in page.styles
    assert f"{1e3 * float(np.abs(data['deflection']).max()):.4g} ±" in page.text


def test_the_cube_opens_anywhere_and_says_what_it_holds(data):
    for name, variable in data.data_vars.items():
        assert variable.attrs["long_name"], name
        assert variable.attrs["units"], name
        assert variable.dtype.kind in "fi", name
    for name in data.coords:
        assert data[name].dtype.kind in "fU", name
    manifest = Manifest.model_validate_json(data.attrs["parameters"])
    assert [camera.name for camera in manifest.cameras] == data["camera"].values.tolist()
    assert {"title", "source", "versions", "created", "Conventions"} <= set(data.attrs)


def test_table_and_universal_file_hold_the_cube_s_numbers(conforms, measured, data):
    table = pd.read_csv(measured / "measured" / "shapes.csv")
    conforms.closed_form(table["deflection_mm"], 1e3 * data["deflection"], atol=1e-6)
    conforms.closed_form(table["x_mm"], 1e3 * data["x"], atol=1e-6)
    sets = pyuff.UFF(str(measured / "measured" / "shapes.uff")).read_sets()
    shape = next(part for part in sets if part["type"] == 55)
    amplitude = data["amplitude_real"].values + 1j * data["amplitude_imag"].values
    conforms.closed_form(shape["r3"], amplitude, atol=1e-7)
    assert sum(part["type"] == 58 for part in sets) == 75


# Folders that are broken, and requests that are wrong: more are in test_bad_input.


def line_of(done, status):
    """The one line of a command that did not do it."""
    assert (done.status, done.warned) == (status, ()), done
    line = done.err.removeprefix("thesis: ").removesuffix("\n")
    assert done.err == f"thesis: {line}\n"
    assert line.isprintable(), line
    assert len(line) < 700
    return line


@pytest.mark.usefixtures("still")
def test_the_sound_is_told_if_it_is_asked_for(measured, tmp_path):
    folder = copied(measured, tmp_path / "recording", results=True)
    change_manifest(folder, lambda values: values.update(radiation={}))
    done = thesis("measure", folder / "manifest.yaml", "--json")
    told = json.loads(done.out)
    assert done.status == 0
    assert told["report"] == str(folder / "measured" / "report.html")
    assert any("sound power at 4.25 Hz: 48." in line for line in told["found"])
    assert all(one["text"] for one in told["notes"])
    page = (folder / "measured" / "report.html").read_text(encoding="utf-8")
    assert "<h2>Sound</h2>" in page
    assert "rigid wall (a baffle)" in page
    assert {"heard-1.wav", "radiated.csv"} <= {p.name for p in (folder / "measured").iterdir()}
    line = line_of(thesis("compare", folder / "measured" / "measured.nc"), 2)
    assert line.endswith("a result of `thesis measure`; compare takes those of `thesis run`")


def with_tracks_of(measured, patch):
    """Take the tracks of the whole measurement instead of tracking anew."""

    def take(files, folder, clock, camera, markers, turn, path, tick, shares):
        shutil.copy(measured / "measured" / ".steps" / path.name, path)
        return [], np.zeros(0, int)

    patch.setattr(steps_module, "record_track", take)


def test_shots_of_another_camera_do_not_fit_the_markers(measured, tmp_path, monkeypatch):
    def swapped(values):
        for camera, letter in zip(values["cameras"], "BAC", strict=True):
            camera["board_images"] = [f"board/{letter}-{k:02d}.jpg" for k in range(5)]

    folder = copied(measured, tmp_path / "recording")
    with_tracks_of(measured, monkeypatch)
    change_manifest(folder, swapped)
    line = line_of(thesis("measure", folder / "manifest.yaml"), 1)
    assert all(word in line for word in ("off their grid", "allowed: 1 mm", "the same cameras"))
    assert names(folder / "measured") == [".steps"]


# Places to write to.


def test_places_that_cannot_be_written_to_are_told_before_the_work(example, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "nowhere").symlink_to(tmp_path / "none")
    for out in ("file/inside", "nowhere"):
        line = line_of(thesis("measure", example / "manifest.yaml", "--out", tmp_path / out), 2)
        assert line.startswith(f"--out: given {tmp_path / out}")
        assert "allowed: a folder, new or not" in line
    line = line_of(thesis("measure", "--example", example), 2)
    assert line.startswith("--example: ")
    assert "allowed: a new or empty folder" in line
    assert (tmp_path / "file").read_text() == "mine"
    assert names(tmp_path) == ["file", "nowhere"]
    closed = tmp_path / "closed"
    closed.mkdir(0o555)
    if os.access(closed, os.W_OK):  # as the superuser may
        monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != closed)
    line = line_of(thesis("measure", example / "manifest.yaml", "--out", closed / "new"), 2)
    assert f"{closed} cannot be written to" in line
    assert names(closed) == []
    with FileLock(tmp_path / LOCK_NAME):  # as another measurement has
        line = line_of(thesis("measure", example / "manifest.yaml", "--out", tmp_path), 1)
    assert "another command writes there" in line


def test_a_full_disk_leaves_the_results_of_before(measured, tmp_path):
    folder = copied(measured, tmp_path / "recording", results=True)
    out = folder / "measured"
    (out / "part").mkdir()
    (out / "part" / "report.html").write_text("of before")
    put_files(out / "part", out)
    (out / "part").rmdir()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))  # the HDF5 library would not survive
    try:
        line = line_of(thesis("measure", folder / "manifest.yaml"), 1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert f"{out}" in line
    assert "File too large" in line
    assert "put that right, and run the same command again" in line
    assert names(out) == [".steps", RECORD_NAME, "report.html"]
    assert (out / "report.html").read_text() == "of before"
    assert names(out / ".steps") == STEPS


# What is kept, and what is not trusted.


@pytest.mark.usefixtures("still")
def test_only_what_depends_on_a_change_is_done_again(measured, data, tmp_path, monkeypatch):
    folder = copied(measured, tmp_path / "Messung – früh [1]", results=True)
    before = stamps(folder / "measured")

    def change(values):
        values["structure"]["youngs_modulus_pa"] = 6.0e10
        values["cameras"][0] |= {"f_number": 8.0, "distance_mm": 600.0}

    change_manifest(folder, change)
    monkeypatch.chdir(folder)  # as most people run it
    done = thesis("measure", "manifest.yaml")
    assert (done.status, done.err, done.warned) == (0, "", ())
    assert stamps(folder / "measured") == before
    again = results_of(folder / "measured")
    np.testing.assert_array_equal(again["deflection"], data["deflection"])
    assert float(again["model_frequency"][0]) < 0.95 * float(data["model_frequency"][0])
    # Another steady part: the sound is heard again, the markers are where they were.
    steady = {"steady_interval_s": [1.95, 2.8]}
    change_manifest(folder, lambda values: values["excitation"].update(steady))
    done = thesis("measure", "manifest.yaml", "--out", "./measured/../measured")
    assert (done.status, done.err, done.warned) == (0, "", ())
    after = stamps(folder / "measured")
    changed = {name for name in before if after[name] != before[name]}
    assert changed == {"sound.nc", ".sound.nc.sha256"}
    assert results_of(folder / "measured")["steady"].values.tolist() == [1.95, 2.8]


@pytest.mark.nightly
def test_damaged_and_edited_steps_are_done_again(measured, data, tmp_path):
    folder = copied(measured, tmp_path / "recording", results=True)
    steps = folder / "measured" / ".steps"
    before, edited = stamps(folder / "measured"), steps / "tracks-01.npy"
    whole = edited.read_bytes()
    for name in ("sound.nc", "tracks-00.nc", "tracks-02.npy"):
        content = (steps / name).read_bytes()
        (steps / name).write_bytes(content[: len(content) // 2])
    edited.write_bytes(whole[:-8] + np.float64(1.0).tobytes())
    done = thesis("measure", folder / "manifest.yaml")
    told = [
        f"{steps / name} is not what was stored there; it is computed again"
        for name in ("sound.nc", *TRACKS)
    ]
    assert (done.status, sorted(done.err.splitlines()), done.warned) == (0, told, ())
    assert_same_results(results_of(folder / "measured"), data)
    after = stamps(folder / "measured")
    changed = {name for name in before if after[name] != before[name]}
    assert changed == {*with_digests(["sound.nc", *TRACKS]), *CENTRES}
    assert edited.read_bytes() == whole


@pytest.mark.nightly
def test_odd_names_of_cameras_are_shown_as_they_are(measured, tmp_path, monkeypatch):
    """Neither marks of a page nor formulas of a figure."""
    folder, name = copied(measured, tmp_path / "ä ö – [x] #%20 'q'"), "<b>Müller's</b> & $\\foo_$"
    with_tracks_of(measured, monkeypatch)
    change_manifest(folder, lambda values: values["cameras"][0].update(name=name))
    done = thesis("measure", folder / "manifest.yaml", "--out", folder)
    assert (done.status, done.err, done.warned) == (0, "", ())
    assert name in Page(folder / "report.html").text
    assert set(names(folder)) >= RESULTS | {".steps", "manifest.yaml", "B.mkv"}


# Interruptions.


def tracked(steps):
    """When each camera's tracks were stored, of those that are whole."""
    marks = [steps / f".{name}.sha256" for name in TRACKS]
    return {mark.name: mark.stat().st_mtime_ns for mark in marks if mark.exists()}


@pytest.mark.nightly
@pytest.mark.parametrize("ended_by", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.usefixtures("interrupts_ignored")
def test_whatever_stops_it_the_same_command_goes_on(measured, data, tmp_path, ended_by):
    out = tmp_path / "out"
    steps = out / ".steps"
    steps.mkdir(parents=True)
    for name in WHOLE:  # the tracking is what takes time
        shutil.copy2(measured / "measured" / ".steps" / name, steps)
    before = stamps(out)
    command = ("measure", measured / "manifest.yaml", "--out", out)

    running, other = begun(*command), f"{STAGING_PREFIX}*/new/tracks-*.npy"
    for _ in range(30_000):  # until one is tracked and another begun: it hears signals by then
        if tracked(steps) and [*steps.glob(other)]:
            break
        assert running.poll() is None, running.communicate()
        time.sleep(0.01)
    start = time.monotonic()
    running.send_signal(ended_by)
    stopped = ended(running)
    assert time.monotonic() - start < 10
    if ended_by == signal.SIGINT:
        assert stopped.status == 130
        assert stopped.err.endswith("interrupted; run the same command again to go on\n")
    else:
        assert stopped.status == -signal.SIGKILL
    kept = tracked(steps)
    assert 0 < len(kept) < 3
    assert names(out) == [".steps"]

    done = ended(begun(*command))
    assert (done.status, done.err) == (0, "")
    assert names(steps) == STEPS
    assert kept.items() <= tracked(steps).items()  # these are not tracked again
    assert {name: stamps(out)[name] for name in before} == before
    assert_same_results(results_of(out), data)


# Long recordings.


@pytest.mark.nightly
def test_memory_does_not_hold_a_long_recording(conforms, tmp_path, rig):
    manifest = example_manifest(rig)
    few = {"rows": 2, "columns": 4, "spacing_mm": 150.0, "hole_mm": None}
    markers = manifest.structure.markers.model_copy(update=few)
    beam = manifest.structure.model_copy(update={"markers": markers})
    manifest = manifest.model_copy(update={"structure": beam})
    grid, count, rate = markers_of(manifest), 30_000, 60.0
    shape = 0.003 * (grid.centres[0] / 0.623) ** 2
    lift = np.sin(2 * np.pi * 4.25 * np.arange(count) / rate) * (np.arange(count) >= rate)
    noise, recordings = 0.02 * np.random.default_rng(1).standard_normal((count, 2, grid.count)), []
    for station in rig.stations[:2]:
        rest = project_points(station.camera, grid.world)
        up = project_points(station.camera, grid.world + shape * np.array([[0], [0], [1]])) - rest
        path = tmp_path / f"{station.camera.name}.npy"
        np.save(path, rest + up * lift[:, None, None] + noise)
        recordings.append(Recording(station.camera, rate, 0.0, 1e-6, 0.0, path))
    del noise
    sound = xr.Dataset({"frequency": 4.25, "of_sound": np.nan, "of_sound_deviation": np.nan,
                        "force": ("part", [1.0, 0.0]), "of_force": 1,
                        "steady": ("end", [1.0, count / rate - 0.1])})  # fmt: skip
    result.shape_result(manifest, sound, recordings)  # what is imported now is not counted
    tracemalloc.start()
    data = result.shape_result(manifest, sound, recordings)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    found = np.abs(data["deflection"].values)
    conforms.closed_form(np.sqrt(np.mean((found - shape) ** 2)), below=1e-3 * shape.max())
    assert peak < path.stat().st_size  # of the tracks of one camera
