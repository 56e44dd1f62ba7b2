"""Studies larger than memory or than one machine: the same cube, bounded memory, lost workers."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from command import refusal, thesis

from thesis_lib import files
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric import sound
from thesis_lib.figure_sets.registry import validate
from thesis_lib.notebook import show as notebook
from thesis_lib.studies import blocks as chunks
from thesis_lib.studies import cubes, schedulers, storage
from thesis_lib.studies.request import ParameterError
from thesis_lib.studies.schema import with_provenance
from thesis_lib.vision import rounding

distributed = pytest.importorskip("distributed", reason="Dask is not installed")

ROOT = Path(__file__).parents[2]
ARRAYS = {"trials": 60, "cases": ["4a"], "amplitude_mm": 4.0}
SOUND = {"trials": 60, "distances_mm": [500.0, 900.0], "plane_shape": [15, 10]}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two worker processes on this machine."""
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as running:
        yield running


@pytest.fixture
def small_blocks(monkeypatch):
    """Blocks so small that every setting needs several."""
    monkeypatch.setattr(chunks, "BLOCK_BYTES", 2**18)


# How a study is cut.


@pytest.mark.parametrize("trial_bytes", [1, 2**20, 5 * 2**20, 2**26])
def test_runs_of_trials_are_whole_bounded_and_in_order(trial_bytes):
    runs = list(chunks.runs_of_trials(100, trial_bytes))
    assert [t for run in runs for t in range(run.start, run.stop)] == list(range(101))
    for run in runs:
        n = run.stop - run.start
        assert n == 1 or n * trial_bytes <= chunks.BLOCK_BYTES


def test_pieces_hold_all_blocks_in_order_within_the_bound():
    sizes = [5, 1, 1, 9, 2, 2, 2, 30, 1]
    blocks = [chunks.Block(i, slice(0, 1), size, None) for i, size in enumerate(sizes)]
    cut = list(chunks.pieces(blocks, 6))
    assert [block for piece in cut for block in piece] == blocks
    assert all(len(piece) == 1 or sum(b.nbytes for b in piece) <= 6 for piece in cut)
    assert [len(piece) for piece in cut] == [2, 1, 1, 3, 1, 1]


def test_a_range_of_shifts_is_a_part_of_all():
    whole = rounding.grid_shifts(7, 50, 5)
    np.testing.assert_array_equal(rounding.grid_shifts(7, 50, 5, 20), whole[20:])
    np.testing.assert_array_equal(rounding.grid_shifts(7, 9, 3), whole[:10, :3])


@pytest.mark.parametrize(
    ("estimator", "noise_px"),
    [("least-squares", 0.0), ("analytic-centre", 0.0), ("interval", 0.0), ("interval", 0.1)],
)
def test_smaller_blocks_change_the_last_bits_alone(monkeypatch, estimator, noise_px):
    few = {**ARRAYS, "trials": 15}  # of two cameras 9 fill a block
    study = validate("beam-arrays", {**few, "estimator": estimator, "noise_px": noise_px})
    whole = studies.run(study)
    monkeypatch.setattr(chunks, "BLOCK_BYTES", 2**15)
    cut = studies.run(study)
    for name in ("measured_deflection", "mean_error", "max_point_error", "mac"):
        np.testing.assert_allclose(cut[name], whole[name], rtol=1e-7, atol=1e-15)
    for name in ("predicted_error", "in_view", "ground_sample_distance"):
        np.testing.assert_array_equal(cut[name], whole[name])


def test_settings_of_the_thesis_are_one_block_each():
    for name in ("beam-arrays", "plate-arrays"):
        study = validate(name, {})
        settings = study.settings()
        points = 4 * study.structure.markers.shape[1]
        blocks = list(studies._blocks(settings, study.trials, points))
        assert len(blocks) == len(settings)


# The same cube whoever computes it.


@pytest.mark.parametrize("piece_bytes", [1, 2**19, 2**30])
def test_cube_ofs_are_the_same_bit_for_bit_by_workers(cluster, small_blocks, piece_bytes):
    study = validate("beam-arrays", ARRAYS)
    alone = studies.run(study)
    address = cluster.scheduler_address
    xr.testing.assert_identical(studies.outline(study, address, piece_bytes).in_memory(), alone)


def test_plate_and_sound_are_the_same_by_workers(cluster, small_blocks):
    request, address = validate("sound-distance", SOUND), cluster.scheduler_address
    values = {**request.plate_request, "estimator": "interval", "noise_px": 0.05}
    plate = studies.run(validate("plate-distance", values))
    xr.testing.assert_identical(studies.run(validate("plate-distance", values), address), plate)
    alone = sound.run(request, plate)
    xr.testing.assert_allclose(sound.run(request, plate, address), alone, rtol=1e-12)


@pytest.mark.slow
def test_processes_of_this_machine_give_the_same_cube_without_a_port(small_blocks, monkeypatch):
    """Where nothing can listen: no stranger on this machine can send them code."""
    study = validate("beam-distance", {"trials": 60})
    alone = studies.run(study)

    def refuse(*_):
        raise PermissionError("a port")

    monkeypatch.setattr(socket.socket, "listen", refuse)
    xr.testing.assert_identical(studies.run(study, "processes"), alone)


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(cluster, small_blocks):
    study = validate("beam-arrays", {**ARRAYS, "trials": 300})
    alone = studies.run(study)
    outline = studies.outline(study, cluster.scheduler_address, piece_bytes=1)
    killed: list[str] = []
    written = 0

    class Values(dict):
        """Arrays; after some results a worker that has work or results is killed."""

        def __getitem__(self, name: str) -> Any:
            nonlocal written
            written += 1
            if written == 30:
                killed.append(kill())
            return super().__getitem__(name)

    def kill() -> str:
        for _ in range(400):
            for address, state in dict(cluster.scheduler.workers).items():
                if state.has_what or state.processing:
                    os.kill(pids[address], signal.SIGKILL)
                    return address
            time.sleep(0.01)
        pytest.fail("no worker had anything to lose")

    with distributed.Client(cluster, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
        pids = client.run(os.getpid)
        found = {n: np.empty(outline.shape(n), kind) for n, (_, kind, _) in outline.large.items()}
        outline.fill(Values(found))
        (address,) = killed
        assert address not in cluster.scheduler.workers
    assert written > 60  # it went on after the worker was gone
    for name, values in found.items():
        np.testing.assert_array_equal(values, alone[name].values)


# What is too large to be held.


def test_a_cube_on_disk_is_the_one_in_memory(tmp_path, small_blocks, monkeypatch):
    study = validate("beam-arrays", ARRAYS)
    held = with_provenance(studies.run(study), study, 0.0)
    outline = studies.outline(study)
    with_attributes = replace(outline, cube=with_provenance(outline.cube, study, 0.0))
    storage.fill_in(with_attributes, tmp_path / "disk.nc", lambda: 1.5)
    assert [path.name for path in tmp_path.iterdir()] == ["disk.nc"]
    found = cube_file.read(tmp_path / "disk.nc")
    assert found.attrs["run_time_s"] == 1.5
    xr.testing.assert_equal(found, held)
    for name, values in held.variables.items():
        assert found[name].dtype == values.dtype
        assert found[name].attrs == values.attrs
    storage.write(held, tmp_path / "small.nc", compact=True)
    monkeypatch.setattr(storage, "HELD_BYTES", 2**16)
    monkeypatch.setattr(storage, "_LOADED_BYTES", 2**12)
    lazy = cube_file.read(tmp_path / "disk.nc")
    assert not lazy["measured_deflection"].variable._in_memory
    xr.testing.assert_equal(lazy, held)
    assert not lazy["measured_deflection"].variable._in_memory  # nor after it was read
    storage.write(lazy, tmp_path / "large.nc", compact=True)
    xr.testing.assert_equal(
        cube_file.read(tmp_path / "large.nc"), cube_file.read(tmp_path / "small.nc")
    )
    storage.write(lazy, tmp_path / "plain.nc")
    xr.testing.assert_equal(cube_file.read(tmp_path / "plain.nc"), held)
    assert cubes.summary(lazy).equals(cubes.summary(held))


def test_what_stops_half_way_leaves_nothing(tmp_path):
    outline = studies.outline(validate("beam-distance", {"trials": 3}))

    def stop(values: Any) -> None:
        values["mean_error"][0] = 1.0
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        storage.fill_in(replace(outline, fill=stop), tmp_path / "x.nc", lambda: 0.0)
    assert list(tmp_path.iterdir()) == []


MEMORY = """
import sys
from pathlib import Path
from thesis_lib.figure_sets.parametric.tables import claims_table, error_table
from thesis_lib.figure_sets import display as figure_sets_display
from thesis_lib.notebook import show as notebook
from thesis_lib.studies import blocks, cache, effort, storage
blocks.HELD_BYTES = storage.HELD_BYTES = 2**20
blocks.BLOCK_BYTES = 2 * 2**20
cache.cache_folder = lambda: Path(sys.argv[1])
values = {"trials": int(sys.argv[2]), "distances_mm": [500.0, 900.0]}
plate = notebook.study("plate-distance", {**values, "cube": sys.argv[1] + "/plate.nc"})
cube = notebook.study("sound-distance", {**values, "plane_shape": [15, 10]})
error_table(plate), notebook.viewer(plate), claims_table(plate)
figure_sets_display.as_svg(plate, "1", 1)
error_table(cube)
print(plate.nbytes, effort.peak_memory_mb())
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_trials(tmp_path):
    sizes, peaks = [], []
    for trials in (300, 4800):
        (tmp_path / str(trials)).mkdir()
        done = subprocess.run(
            [sys.executable, "-c", MEMORY, str(tmp_path / str(trials)), str(trials)],
            capture_output=True, text=True, timeout=600, check=False, stdin=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "MPLBACKEND": "agg"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        size, peak = map(float, done.stdout.split())
        sizes.append(size / 1e6)
        peaks.append(peak)
    assert sizes[1] - sizes[0] > 15  # MB; all of it in memory would show
    assert peaks[1] - peaks[0] < 8


# What is refused.


@pytest.mark.parametrize(
    "given",
    ["", "threads", "processes ", "tcp://", "tcp://host", "tcp://:8786", "tcp://host:0",
     "tcp://host:65536", "tcp://a b:1", "http://host:1", "tcp://host:1/x", "tcp://[::1:1"],
)  # fmt: skip
def test_malformed_schedulers_are_refused(given, monkeypatch):
    with pytest.raises(ValueError, match="allowed: processes, or tcp://HOST:PORT") as caught:
        schedulers.checked(given)
    assert repr(given) in str(caught.value)
    if given:
        monkeypatch.setenv("THESIS_SCHEDULER", given)
        with pytest.raises(ParameterError, match="THESIS_SCHEDULER: given"):
            notebook.study("beam-distance", {"trials": 0})


def closed_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def test_who_listens_but_is_no_scheduler_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(schedulers, "WAIT_S", 2.0)
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        address, start = f"tcp://127.0.0.1:{mute.getsockname()[1]}", time.monotonic()
        with pytest.raises(schedulers.SchedulerError, match=f"{address}: no scheduler answers"):
            studies.run(validate("beam-distance", {"trials": 0}), address)
        assert time.monotonic() - start < 10


def test_a_cluster_without_workers_is_named(monkeypatch):
    monkeypatch.setattr(schedulers, "WAIT_S", 2.0)
    empty = {"n_workers": 0, "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(**empty) as own:
        address = own.scheduler_address
        with pytest.raises(schedulers.SchedulerError, match=f"{address}: it has no worker"):
            schedulers.check(address)


def test_workers_with_another_library_are_named(cluster, monkeypatch):
    monkeypatch.setattr(schedulers, "library_digest", lambda: "elsewhere")
    with pytest.raises(schedulers.SchedulerError, match=r"worker tcp://.* differs from here") as e:
        schedulers.check(cluster.scheduler_address)
    assert files.library_digest()[:12] in str(e.value)
    assert "\n" not in str(e.value)


def test_workers_without_the_library_are_named(tmp_path):
    (tmp_path / "thesis_lib").mkdir()
    (tmp_path / "thesis_lib" / "__init__.py").touch()  # a library of that name, without all this
    empty = {"n_workers": 0, "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(**empty) as own:
        worker = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_worker", own.scheduler_address,
             "--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1"],
            cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path)},
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            with pytest.raises(schedulers.SchedulerError, match="No module named") as caught:
                schedulers.check(own.scheduler_address)
        finally:
            worker.kill()
            worker.wait(timeout=30)
    assert "\n" not in str(caught.value)


def late_worker(address: str, folder: Path) -> subprocess.Popen[bytes]:
    """Start a worker with the library of a folder."""
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-nanny",
         "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1"],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


@pytest.fixture
def late(tmp_path):
    """Results of work that one worker does, and another that joins with the library of a folder."""
    one = {"n_workers": 1, "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    slowly = lambda piece: (time.sleep(0.1), piece)[1]  # noqa: E731  # goes to workers by value
    joined: list[subprocess.Popen[bytes]] = []

    def pieces() -> Iterator[int]:
        """Until the other has ended, a minute at most."""
        for number in range(600):
            yield number
            if joined and joined[0].poll() is not None:
                return

    with (
        distributed.LocalCluster(**one, threads_per_worker=1) as own,
        schedulers.workers(own.scheduler_address) as client,
    ):
        found = schedulers.in_order(client, slowly, pieces())
        assert next(found) == (0, 0)
        joined.append(late_worker(own.scheduler_address, tmp_path))
        try:
            yield found, joined[0]
        finally:
            joined[0].kill()
            joined[0].wait(timeout=30)


def library_in(folder: Path) -> Path:
    library = folder / "thesis_lib"
    ours = files.project_root() / "src" / "thesis_lib"
    shutil.copytree(ours, library, ignore=shutil.ignore_patterns("__pycache__"))
    for part in ("data/thesis", "requirements"):
        shutil.copytree(files.project_root() / part, library / "_project" / part)
    return library


@pytest.fixture
def changed(tmp_path):
    with (library_in(tmp_path) / "vision" / "rounding.py").open("a") as stream:
        stream.write("\n# another line\n")


@pytest.fixture
def without(tmp_path):
    (tmp_path / "thesis_lib").mkdir()
    (tmp_path / "thesis_lib" / "__init__.py").touch()


@pytest.mark.slow
def test_a_worker_that_joins_late_with_another_library_is_refused(changed, late):
    found, _ = late
    with pytest.raises(schedulers.SchedulerError, match="differs from here") as caught:
        assert all(piece == result for piece, result in found)
    assert re.search(r"worker tcp://127.0.0.1:\d+ differs.*\(library ", str(caught.value))
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_worker_that_joins_late_without_the_library_ends_and_the_work_is_done(without, late):
    found, worker = late
    results = [result for _, result in found]
    assert results == list(range(1, len(results) + 1))
    assert worker.poll() == 0


def test_a_result_of_another_worker_is_refused_and_work_fails_as_it_is(monkeypatch):
    class Future:
        def __init__(self, value: Any) -> None:
            self.value = value

        def result(self, timeout: float) -> Any:
            if isinstance(self.value, Exception):
                raise self.value
            return self.value

    here = schedulers.standing()
    assert schedulers._result(None, Future(("tcp://a:1", here, 5))) == 5
    for key in here:
        with pytest.raises(schedulers.SchedulerError, match=f"tcp://a:1 differs.*{key}"):
            schedulers._result(None, Future(("tcp://a:1", {**here, key: "0"}, None)))
        old = {k: v for k, v in here.items() if k != key}
        with pytest.raises(schedulers.SchedulerError, match=f"{key} unknown"):
            schedulers._result(None, Future(("tcp://a:1", old, None)))


def test_without_dask_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(schedulers.SchedulerError, match=r"pip install thesis-lib\[scale\]"):
        schedulers.check("tcp://127.0.0.1:1")


def test_studies_without_pieces_say_so(monkeypatch, capsys):
    monkeypatch.setenv("THESIS_SCHEDULER", "tcp://127.0.0.1:1")
    notebook.study("cameras", {"trials": 2})  # and nothing is waited for
    assert "cameras is not cut into pieces" in capsys.readouterr().err


# The command.


@pytest.mark.slow
def test_command_with_a_cluster_makes_the_same_cube(checkout, cluster, tmp_path):
    values = {"trials": 30, "distances_mm": [500.0, 900.0]}
    done = checkout.thesis(
        "run", "beam-distance", *(f"-p{k}={json.dumps(v)}" for k, v in values.items()),
        "--scheduler", cluster.scheduler_address, "--out", tmp_path / "out", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = cube_file.read(tmp_path / "out" / "beam-distance.nc")
    study = validate("beam-distance", values)
    alone = with_provenance(studies.run(study), study, 0.0)
    xr.testing.assert_allclose(found["mean_error"], alone["mean_error"], rtol=2.0**-24, atol=0)
    xr.testing.assert_allclose(found, alone, rtol=2.0**-14)  # as cubes are rounded
    assert found.attrs["parameters_hash"] == study.digest
    assert "scheduler" not in found.attrs["parameters"]
    assert cluster.scheduler.transition_counter > 0


@pytest.mark.slow
def test_command_names_an_address_where_nothing_answers(checkout, tmp_path):
    address, start = f"tcp://127.0.0.1:{closed_port()}", time.monotonic()
    out = tmp_path / "out"
    done = checkout.thesis(
        "run", "beam-distance", "--scheduler", address, "--out", out, cwd=tmp_path
    )
    assert time.monotonic() - start < 30
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"thesis: scheduler {address}: no scheduler answers there within")
    assert len(done.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("names", "scheduler", "words"),
    [(["beam-distance"], "tcp://nowhere", "given 'tcp://nowhere', allowed: processes, or tcp://"),
     (["cameras", "claims"], "processes", "given with cameras, claims, allowed with camera and")],
)  # fmt: skip
def test_command_refuses_what_cannot_be(tmp_path, names, scheduler, words):
    assert words in refusal(thesis("run", *names, "--scheduler", scheduler, cwd=tmp_path))
    assert list(tmp_path.iterdir()) == []
