"""The README's example runs as it stands."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from thesis_lib.vision import pinhole, triangulation

ROOT = Path(__file__).parents[1]


def run(example: int) -> dict[str, Any]:
    """The names that one of the two examples leaves."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    both = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(both) == 2
    assert len([line for line in both[example].splitlines() if line.strip()]) <= 10
    names: dict[str, Any] = {}
    exec(both[example], names)
    return names


def test_library_example_runs_and_its_prediction_is_the_law(capsys):
    run(0)
    measured, expected = map(float, re.findall(r"([\d.]+) mm", capsys.readouterr().out))
    assert abs(measured - 2) < 5 * expected


def test_law_of_the_readme_holds_for_drawn_motions(capsys):
    names = run(1)
    stated = np.array(re.findall(r"\d\.\d\d", capsys.readouterr().out), float) / 1000
    random, P = np.random.default_rng(1), names["rig"].P
    moved = random.uniform(-0.01, 0.01, (3, 4000))
    shift = random.uniform(-0.5, 0.5, (6, 2, 1, 4000))
    images = pinhole.project(P, np.stack([0 * moved, moved], axis=1)) + shift
    found = triangulation.triangulate(P, pinhole.pixelate(images) - shift)
    error = found[:, 1] - found[:, 0] - moved
    np.testing.assert_allclose(np.sqrt(np.mean(error**2, axis=1)), stated, rtol=0.05)


def test_commands_of_the_readme_exist():
    from thesis_lib.cli import cli

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = set(
        re.findall(
            r"thesis (list|run|book|record|claims|pdf|plan|measure|compare|print|sync|pack)\b", text
        )
    )
    assert commands == set(cli.commands)
