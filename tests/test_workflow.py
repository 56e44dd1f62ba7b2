"""Continuous integration and Binder: what they run, upload and install."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
MAIN = "github.ref == 'refs/heads/main' && github.event_name == 'push'"


def read(name):
    text = (ROOT / ".github" / "workflows" / name).read_text(encoding="utf-8")
    return yaml.load(text, Loader=yaml.BaseLoader)  # where `on` is a word


@pytest.fixture(scope="module")
def workflow():
    return read("ci.yml")


def steps(workflow, job, start):
    return [one for one in workflow["jobs"][job]["steps"] if one.get("uses", "").startswith(start)]


def test_every_action_has_a_version(workflow):
    used = [one["uses"] for job in workflow["jobs"].values() for one in job["steps"]
            if "uses" in one]  # fmt: skip
    assert len(used) >= 5
    for action in used:
        assert re.fullmatch(r"actions/[\w-]+@v\d+", action), action


def test_the_book_is_uploaded_after_the_tests_and_deployed_from_main_alone(workflow):
    every = workflow["jobs"]["book-and-tests"]["steps"]
    (upload,) = steps(workflow, "book-and-tests", "actions/upload-pages-artifact")
    (tests,) = [one for one in every if one.get("run") == "bash .ci/run"]
    assert every.index(tests) < every.index(upload)
    assert upload["with"]["path"] == "build/html"
    assert upload["if"] == MAIN  # and, as for any condition without a status, if all went well
    deploy = workflow["jobs"]["deploy"]
    assert deploy["needs"] == "book-and-tests"
    assert deploy["if"] == MAIN
    (step,) = steps(workflow, "deploy", "actions/deploy-pages")
    assert deploy["environment"]["url"] == f"${{{{ steps.{step['id']}.outputs.page_url }}}}"


def test_what_takes_hours_runs_at_night_alone(workflow):
    nightly = read("nightly.yml")
    assert set(nightly["on"]) == {"schedule", "workflow_dispatch"}
    assert "schedule" not in workflow["on"]
    assert nightly["permissions"] == {"contents": "read"}
    (job,) = nightly["jobs"].values()
    assert job["steps"][-1] == {"run": "make ${{ matrix.target }}"}
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in job["strategy"]["matrix"]["target"]:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target
    assert re.search(r"^test-nightly: book ", makefile, flags=re.MULTILINE)  # or half is skipped


def test_nothing_but_the_deployment_may_write(workflow):
    assert workflow["permissions"] == {"contents": "read"}
    assert "permissions" not in workflow["jobs"]["book-and-tests"]
    assert workflow["jobs"]["deploy"]["permissions"] == {"pages": "write", "id-token": "write"}


def test_the_uploaded_folder_is_where_the_book_is_built():
    from thesis_lib.book.plan import Plan

    plan = Plan(ROOT, [])
    assert plan.index.parent == ROOT / "build" / "html"


def test_binder_installs_what_the_book_needs():
    folder = ROOT / "binder"
    lines = (folder / "requirements.txt").read_text(encoding="utf-8").split("\n")
    wheels, hashes, lock_line = filter(None, lines)
    assert [wheels, hashes] == ["--only-binary :all:", "--require-hashes"]
    assert lock_line == "-r ../requirements/book.txt"
    lock = folder / lock_line.removeprefix("-r ")  # pip counts paths from the file they stand in
    locked = lock.read_text(encoding="utf-8")
    for package in ("ipykernel", "ipywidgets", "anywidget", "hatchling", "editables"):
        assert re.search(rf"^{package}==", locked, flags=re.MULTILINE), package
    python = (folder / "runtime.txt").read_text(encoding="utf-8").strip()
    assert re.fullmatch(r"python-3\.\d+", python)
    least = re.search(r'requires-python = ">=([\d.]+)"', (ROOT / "pyproject.toml").read_text())[1]
    assert python == f"python-{least}"
    script = folder / "postBuild"
    assert "--no-deps" in script.read_text(encoding="utf-8")
    assert script.stat().st_mode & 0o100
    assert subprocess.run(["bash", "-n", script], check=False).returncode == 0
