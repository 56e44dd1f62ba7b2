"""The README's example runs as it stands, and the project is cited as the format asks."""

import datetime
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from scenes.sounds import claps, later, write_film

from thesis_lib import __version__
from thesis_lib.cli import cli
from thesis_lib.vision import pinhole, triangulation

ROOT = Path(__file__).parents[1]


def run(example):
    """The names that one of the two examples leaves."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    both = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(both) == 2
    names = {}
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


def readme_commands():
    """Lines that begin with a dollar sign, without comments and without the two of ``make``."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\$ (.+?)(?: +#.*)?$", text, re.MULTILINE)
    named = re.findall(r"`(\.venv/bin/thesis \w+)`", text)
    return named + [line for line in lines if not line.startswith("make ")]


def test_commands_of_readme_and_pages_exist():
    commands = {line.split()[1] for line in readme_commands()}
    assert len(commands) > 10
    for page in (ROOT / "book").glob("*.md"):
        text = page.read_text(encoding="utf-8")
        commands |= {*re.findall(r"^\$ (?:\S*/)?thesis ([\w-]+)", text, re.MULTILINE)}
    assert commands <= set(cli.commands)


@pytest.mark.nightly
def test_commands_of_the_readme_run_and_leave_nothing_behind(tmp_path):
    """In their order, in a clone of the last commit; own recordings are claps and a board."""
    clone, home = tmp_path / "clone", tmp_path / "home"
    subprocess.run(["git", "clone", "-q", ROOT, clone], check=True)
    program = clone / ".venv" / "bin" / "thesis"
    program.parent.mkdir(parents=True)
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m thesis_lib "$@"\n')
    program.chmod(0o755)
    home.mkdir()
    environment = {**os.environ, "HOME": str(home), "PYTHONPATH": str(clone / "src")}
    for line in readme_commands():
        if "~/recording" in line and not (home / "recording").exists():
            (home / "recording" / "frames").mkdir(parents=True)
            room = claps(1)
            for name, start in (("A", 0.0), ("B", 1.3)):
                sound = later(room, start, 9)
                write_film(home / "recording" / f"{name}.mkv", [sound], 16000, codec="pcm_s16le")
            for k, image in enumerate(sorted((clone / "example" / "board").glob("A-*"))):
                shutil.copy(image, home / "recording" / "frames" / f"{k}{image.suffix}")
        done = subprocess.run(
            ["bash", "-c", line], cwd=clone, env=environment, capture_output=True, text=True,
            timeout=1800,
        )  # fmt: skip
        assert done.returncode == 0, (line, done.stdout, done.stderr)
    left = subprocess.run(
        ["git", "status", "--porcelain"], cwd=clone, capture_output=True, text=True, check=True
    ).stdout
    assert left == ""


def test_citation_file_is_valid():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(cited)
    assert str(cited["version"]) == __version__
    assert isinstance(cited["date-released"], datetime.date)
    assert cited["license"] == "MIT"
    for author in cited["authors"]:  # a group: no person's name is known
        assert "name" in author
