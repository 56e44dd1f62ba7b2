"""Will it do? What the page answers is what the commands tell, and it turns with what is asked."""

import re
import shlex

import pytest
from command import thesis

from thesis_lib.book.pieces import benchmarks, manifest as filming
from thesis_lib.measure.feasibility import assess
from thesis_lib.measure.feasibility.prediction import draft_manifest


def test_the_commands_that_are_shown_tell_what_is_shown(tmp_path):
    text = filming.answer_for_plate()
    block = re.search(r"```console\n(.*?)```", text, re.DOTALL).group(1).replace("\\\n", " ")
    commands = [shlex.split(line.removeprefix("$ "))[1:] for line in block.splitlines()]
    first, check = (thesis(*command, cwd=tmp_path) for command in commands)
    assert (first.status, check.status) == (0, 0)
    verdict, shown = re.findall(r"```text\n(.*?)\n```", text, re.DOTALL)
    assert check.out.strip() == shown.strip()
    assert check.out.strip().endswith(verdict.strip())
    assert "wrong by up to 22 %" in verdict


@pytest.mark.parametrize(
    ("film", "error_px"),
    [("H.264, crf 23", assess.COMPRESSED_ERROR_PX), ("lossless", assess.LOSSLESS_ERROR_PX)],
)
def test_errors_of_films_are_those_that_the_benchmarks_measured(film, error_px):
    rows = benchmarks.read_benchmarks()["compression"]["rows"]
    worst = max(row["motion_px"] * row["error"] for row in rows if row["film"] == film)
    assert error_px == pytest.approx(worst, rel=0.005)


def test_an_error_is_the_films_over_the_motion_of_the_camera_that_sees_least():
    found = assess.assess_manifest(draft_manifest(filming.EXAMPLE_PLATE))
    moved = min(row.motion_px for row in found.table)
    assert found.verdict.compressed == pytest.approx(assess.COMPRESSED_ERROR_PX / moved)
    line = next(
        line for line in filming.answer_for_plate().splitlines() if line.startswith("| full HD")
    )
    assert f"| {moved:.2f} | {assess.format_error_share(found.verdict.compressed)} |" in line


@pytest.mark.parametrize(
    ("deflection", "verdict"),
    [(0.05, "Four phones will not do.**"), (0.2, "will do in 4K (11 %), not in full HD (22 %).**"),
     (2.0, "will do in full HD (2.2 %) and 4K (1.1 %).**")],
)  # fmt: skip
def test_the_verdict_turns_with_the_deflection(monkeypatch, deflection, verdict):
    plate = filming.EXAMPLE_PLATE | {"excitation.amplitude_mm": deflection}
    monkeypatch.setattr(filming, "EXAMPLE_PLATE", plate)
    assert verdict in filming.answer_for_plate()
