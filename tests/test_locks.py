"""Check that the locks have hashes and no addresses, and fulfil the project on every platform."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
ALL, BOOK = "requirements.lock", "requirements/book.txt"
UV, NPM = "requirements/uv.txt", "requirements/npm.txt"
PLATFORMS = [
    default_environment()
    | {
        "python_version": python,
        "python_full_version": f"{python}.5",
        "sys_platform": system,
        "platform_machine": machine,
    }
    for python in ("3.11", "3.12", "3.13", "3.14")
    for system, machine in (
        ("linux", "x86_64"),
        ("linux", "aarch64"),
        ("win32", "AMD64"),
        ("darwin", "arm64"),
        ("darwin", "x86_64"),
    )
]


def read_pins(lock: str) -> list[tuple[Requirement, frozenset[str]]]:
    """Return the requirements of a lock, each with its hashes."""
    text = (ROOT / lock).read_text(encoding="utf-8")
    lines = re.sub(r"\\\n", "", re.sub(r"^ *#.*\n", "", text, flags=re.MULTILINE)).splitlines()
    parts = [line.split("--hash=") for line in lines if line.strip()]
    return [(Requirement(one), frozenset(map(str.strip, hashes))) for one, *hashes in parts]


def find_unmet(needed: list[str], lock: str) -> list[str]:
    """Return the requirements that a lock does not fulfil on one of the platforms."""
    locked = [one for one, _ in read_pins(lock)]
    unmet = []
    for wanted in map(Requirement, needed):
        for platform in PLATFORMS:
            if wanted.marker and not wanted.marker.evaluate(platform):
                continue
            versions = [
                next(iter(one.specifier)).version
                for one in locked
                if canonicalize_name(one.name) == canonicalize_name(wanted.name)
                and (one.marker is None or one.marker.evaluate(platform))
            ]
            if len(versions) != 1 or versions[0] not in wanted.specifier:
                unmet.append(f"{wanted} on {platform['sys_platform']}: {versions}")
    return unmet


@pytest.mark.parametrize("lock", [ALL, BOOK, UV, NPM])
def test_every_package_has_one_version_and_hashes_and_no_address(lock):
    assert not re.search(r"://|/|~| @ ", (ROOT / lock).read_text(encoding="utf-8"))
    for requirement, hashes in read_pins(lock):
        assert re.fullmatch(r"==[^*,]+", str(requirement.specifier)), requirement
        assert hashes, requirement
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", one) for one in hashes), requirement


def test_the_book_installs_a_part_of_the_whole_lock():
    whole = {(one.name, str(one.specifier)): hashes for one, hashes in read_pins(ALL)}
    for requirement, hashes in read_pins(BOOK):
        assert whole[requirement.name, str(requirement.specifier)] == hashes, requirement


def test_locks_fulfil_the_project_on_every_platform():
    project = PROJECT["project"]
    extras = project["optional-dependencies"]
    every = [one for extra in extras.values() for one in extra]
    assert find_unmet([*project["dependencies"], *every], ALL) == []
    assert find_unmet([*project["dependencies"], *extras["book"]], BOOK) == []
    assert find_unmet(PROJECT["dependency-groups"]["install"], UV) == []
    assert find_unmet(PROJECT["dependency-groups"]["npm"], NPM) == []
    assert find_unmet(["numpy<2", "left-pad>=1"], ALL)  # what is not fulfilled is found
