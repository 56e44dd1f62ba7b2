"""Studies by many workers: the same cube, and what is refused."""

import re
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
import xarray as xr
from command import thesis

from conftest import PROJECT
from thesis_lib.figure_sets.parametric import compute as studies, sound
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.notebook import show as notebook
from thesis_lib.studies import workers
from thesis_lib.studies.request import ParameterError

sys.path.append(str(PROJECT / ".venv" / "scale"))  # where the Makefile puts Dask
distributed = pytest.importorskip("distributed", reason="Dask is not installed")
dask = pytest.importorskip("dask")

ARRAYS = {"trials": 60, "cases": ["4a"], "amplitude_mm": 4.0}
PLATE = {"trials": 60, "distances_mm": [500.0, 900.0]}
SOUND = {**PLATE, "plane_shape": [15, 10]}


@pytest.fixture
def small_blocks(monkeypatch):
    """Blocks so small that every setting needs several."""
    monkeypatch.setattr(workers, "BLOCK_BYTES", 2**18)


# How a study is cut.


@pytest.mark.parametrize("trial_bytes", [1, 5 * 2**20, 2**26])
def test_runs_of_trials_are_whole_bounded_and_in_order(trial_bytes):
    runs = list(workers.runs_of_trials(100, trial_bytes))
    assert [t for run in runs for t in range(run.start, run.stop)] == list(range(101))
    for run in runs:
        n = run.stop - run.start
        assert n == 1 or n * trial_bytes <= workers.BLOCK_BYTES


@pytest.mark.parametrize(("estimator", "noise_px"), [("least-squares", 0.0), ("interval", 0.1)])
def test_smaller_blocks_change_the_last_bits_alone(monkeypatch, estimator, noise_px):
    few = {**ARRAYS, "trials": 15}  # of two cameras 9 fill a block
    study = validate_request("beam-arrays", {**few, "estimator": estimator, "noise_px": noise_px})
    whole = studies.run(study)
    monkeypatch.setattr(workers, "BLOCK_BYTES", 2**15)
    cut = studies.run(study)
    for name in ("measured_deflection", "mean_error", "max_point_error", "mac"):
        np.testing.assert_allclose(cut[name], whole[name], rtol=1e-7, atol=1e-15)
    for name in ("predicted_error", "in_view", "ground_sample_distance"):
        np.testing.assert_array_equal(cut[name], whole[name])


# The same cube whoever computes it.


@pytest.mark.nightly
def test_a_cluster_with_tls_gives_the_same_cube_bit_for_bit(tmp_path, small_blocks, monkeypatch):
    """Of deflections and of sound; a worker with another library is named."""
    key, certificate = (str(tmp_path / name) for name in ("key.pem", "certificate.pem"))
    request = "req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=localhost"
    subprocess.run(
        ["openssl", *request.split(), "-keyout", key, "-out", certificate],
        check=True, capture_output=True,
    )  # fmt: skip
    parts = [(who, what) for who in ("client", "scheduler", "worker") for what in ("cert", "key")]
    files = {"cert": certificate, "key": key}
    tls = {f"distributed.comm.tls.{who}.{what}": files[what] for who, what in parts}
    tls["distributed.comm.tls.ca-file"] = certificate
    with (
        dask.config.set(tls),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, protocol="tls://", host="127.0.0.1",
            security=distributed.Security(require_encryption=True),
            dashboard_address="127.0.0.1:0",
        ) as cluster,
    ):  # fmt: skip
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        plate = validate_request("plate-distance", PLATE)
        sound_request = validate_request("sound-distance", SOUND)
        alone = studies.run(plate)
        xr.testing.assert_identical(studies.run(plate, address), alone)
        heard = sound.run(sound_request, alone)
        xr.testing.assert_allclose(sound.run(sound_request, alone, address), heard, rtol=1e-12)
        monkeypatch.setattr(workers, "library_digest", lambda: "elsewhere")
        with pytest.raises(workers.SchedulerError, match=r"worker tls://.* here .*elsewhere"):
            workers.check_scheduler(address)


@pytest.mark.slow
def test_processes_of_this_machine_give_the_same_cube_without_a_port(small_blocks, monkeypatch):
    """Where nothing can listen: no stranger on this machine can send them code."""
    study = validate_request("beam-distance", {"trials": 60})
    alone = studies.run(study)

    def refuse(*_):
        raise PermissionError("a port")

    monkeypatch.setattr(socket.socket, "listen", refuse)
    xr.testing.assert_identical(studies.run(study, "processes"), alone)


# What is refused.


def test_a_study_that_memory_would_not_hold_is_refused_with_what_it_needs():
    with pytest.raises(ParameterError, match=r"trials: given 1000000.* GB of memory, allowed: 2.1"):
        validate_request("sound-distance", {"trials": 1_000_000})


@pytest.mark.parametrize(
    "given", ["threads", "tcp://host", "tcp://host:65536", "http://host:1", "tcp://[::1:1"]
)
def test_malformed_schedulers_are_refused(given, monkeypatch):
    allowed = f"from: given {given!r}, allowed: processes, or tcp://HOST:PORT"
    with pytest.raises(ParameterError, match=re.escape(allowed)):
        workers.check_address(given, "from")
    monkeypatch.setenv("THESIS_SCHEDULER", given)
    with pytest.raises(ParameterError, match="THESIS_SCHEDULER: given"):
        notebook.study("beam-distance", {"trials": 0})


# The command.


@pytest.mark.slow
def test_an_address_where_no_scheduler_answers_is_named(tmp_path, monkeypatch):
    """Whether something listens there or nothing does."""
    monkeypatch.setattr(workers, "MAX_WAIT_S", 2.0)
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        address, start = f"tcp://127.0.0.1:{mute.getsockname()[1]}", time.monotonic()
        with pytest.raises(workers.SchedulerError, match=f"{address}: no scheduler answers"):
            studies.run(validate_request("beam-distance", {"trials": 0}), address)
    done = thesis("run", "beam-distance", "--scheduler", address, "--out", "out", cwd=tmp_path)
    assert time.monotonic() - start < 30
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith(f"thesis: scheduler {address}: no scheduler answers there within")
    assert len(done.err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
