"""Benchmarks beside the peers: they run, count rightly, and the page says what was measured."""

import json

import numpy as np
import pytest

from benchmarks import compression, limits, peers, publish, rayleigh, tracking
from thesis_lib.book.pieces import benchmarks as benchmark_tables
from thesis_lib.measure.messages import CHECK_LIMITS


@pytest.fixture(scope="module")
def timed():
    """Few points; peers of which some need seconds to start are left out."""
    absent = ("aniposelib", *peers.missing())
    return {n: list(peers.compare(n, 2, most=200, absent=absent)) for n in (2, 3)}


def test_contenders_estimate_the_same_points(timed):
    names = {t.name for t in timed[2]}
    assert {"thesis_lib, NumPy", "SciPy least_squares, each point"} <= names
    assert "OpenCV triangulatePoints" in names
    assert "OpenCV triangulatePoints" not in {t.name for t in timed[3]}
    for rows in timed.values():
        for t in rows:
            assert len(t.rates) == 2
            assert min(t.rates) > 0
            # 600 coordinates of 200 points: a relative scatter of 1/√(2 · 200) or a little more.
            assert 0.8 * t.bound_um < t.error_um < (1.25 if t.refined else 2) * t.bound_um
        refined = [t.error_um for t in rows if t.refined]
        np.testing.assert_allclose(refined, refined[0], rtol=1e-4)


def test_transfers_agree():
    rows = rayleigh.compare(repetitions=1, shape=(13, 9))
    assert rows[0].difference == 0
    assert all(0 < row.difference < 1e-12 for row in rows[1:3])
    assert all(row.rate > 0 for row in rows)


def test_a_run_is_written_and_told(timed, tmp_path):
    measured = limits.Limits(100.0, 20.0, "a guess")
    every = [t for rows in timed.values() for t in rows]
    data = publish.run(measured, every, rayleigh.compare(repetitions=1, shape=(5, 3)))
    path = tmp_path / "benchmarks.json"
    publish.write(data, path)
    stored = json.loads(path.read_text(encoding="utf-8"))
    assert benchmark_tables.read_benchmarks(path) == data == stored
    for part in ("machine", "targets", "comparison", "needs", "rayleigh", "plan"):
        _, rule, *rows = benchmark_tables.tabulate_benchmarks(part, data).splitlines()
        assert rows
        assert {row.count("|") for row in rows} == {rule.count("|")}
    assert data["machine"]["processor"] in benchmark_tables.tabulate_benchmarks("machine", data)
    (own,) = [t for t in every if (t.name, t.cameras, t.refined) == ("thesis_lib, NumPy", 2, False)]
    row = benchmark_tables.tabulate_benchmarks("comparison", data).splitlines()[2].split("|")
    assert float(row[4]) == pytest.approx(own.rate, rel=1e-2)


def left(motion_px, film):
    """Share of an amplitude that a published film has wrong, between those that were measured."""
    every = benchmark_tables.read_benchmarks()["compression"]["rows"]
    rows = [row for row in every if row["film"] == film]
    known, errors = (np.log([row[name] for row in rows]) for name in ("motion_px", "error"))
    return float(np.exp(np.interp(np.log(motion_px), known, errors)))


def test_the_warning_of_small_motion_comes_where_a_phones_film_takes_a_tenth():
    least = CHECK_LIMITS["small-motion"]
    assert 0.05 < left(least, "H.264, crf 23") < 0.1 < left(least, "H.264, crf 28") < 0.12
    assert left(least / 10, "lossless") < 0.1  # as its remedy says
    assert left(1, "H.264, crf 18") < left(0.7, "H.264, crf 18") < left(0.5, "H.264, crf 18")


@pytest.mark.nightly
def test_compression_takes_more_of_a_smaller_motion(monkeypatch):
    monkeypatch.setattr(compression, "FILMS", {"lossless": None, "H.264, crf 23": 23})
    monkeypatch.setattr(compression, "TIPS", (0.0012, 0.0004))
    found = {(one.film, one.motion_px): one for one in compression.compare(steady=30)}
    assert all(found["H.264, crf 23", px].error > found["lossless", px].error for px in (0.2, 1.0))
    assert found["H.264, crf 23", 0.1].error > 0.3 > 0.1 > found["H.264, crf 23", 1.0].error
    assert found["lossless", 0.5].error < 0.03


@pytest.mark.nightly
def test_trackers_find_the_amplitudes_of_the_same_film():
    found = list(tracking.compare(steady=15, rounds=1))
    assert {one.film for one in found} == set(tracking.FILMS)
    own = {one.film: one for one in found if one.by == "thesis_lib"}
    assert own["with noise"].amplitude_error < 0.015
    for film, one in own.items():
        assert one.untold == 0
        assert (one.told > 0.1) if film == "markers covered" else (one.told < 0.02)
