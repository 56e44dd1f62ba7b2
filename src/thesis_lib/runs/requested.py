"""What a command asks for: figure sets, parameters, folders, workers."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from thesis_lib.text import has_hidden, one_line, parse_json

if TYPE_CHECKING:
    from thesis_lib.studies.request import Study

REFUSED_STATUS, FAILED_STATUS, INTERRUPTED_STATUS = 2, 1, 130
LONGEST_FILE = 80  # characters of the names of files in the folders that are written


class Refused(click.ClickException):
    """The request was wrong: one line, exit status 2, nothing written."""

    exit_code = REFUSED_STATUS


def parse_assignments(assignments: Sequence[str]) -> dict[str, Any]:
    """Return the values of parameters from ``KEY=VALUE`` texts, as JSON or else as text."""
    values: dict[str, Any] = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals or not key:
            raise Refused(f"-p: given {assignment!r}, allowed: KEY=VALUE")
        if key in values:
            raise Refused(f"-p: {key!r} is given twice, allowed: once")
        if key == "cube":
            raise Refused("-p: cube is where a notebook writes; use --out to choose the folder")
        try:
            values[key] = parse_json(text)
        except KeyError as error:
            repeated = one_line(repr(error.args[0]))
            raise Refused(f"-p: {key}: {repeated} is given twice, allowed: once") from None
    return values


def is_folder(name: str) -> bool:
    """Return whether what is asked for is a folder of figure sets, there or not."""
    return os.sep in name or name in (".", "..")


def sets_of(name: str) -> list[str]:
    """Return the figure sets that a set, a chapter or a folder stands for."""
    from thesis_lib.figure_sets.registry import CHAPTER_SETS, load_sets

    return load_sets(Path(name)) if is_folder(name) else CHAPTER_SETS.get(name, [name])


def requests_of(names: Sequence[str], values: dict[str, Any]) -> list[Study]:
    """Return validated studies of sets and chapters; each set takes the parameters that it has.

    A name that is a folder's stands for the figure sets in it.
    """
    from thesis_lib.figure_sets.registry import model_of
    from thesis_lib.studies.request import ParameterError, check_names, validate_values

    studies, notes = [], []
    try:
        expanded = [one for name in names for one in sets_of(name)]
        models = [model_of(name) for name in dict.fromkeys(expanded)]
        known = {key for model in models for key in model.model_fields}
        check_names(models[0], (key for key in values if key not in known))
        for model in models:
            own = {key: value for key, value in values.items() if key in model.model_fields}
            studies.append(validate_values(model, own))
            notes += [
                f"{model.name} has no {key}: it runs without" for key in values if key not in own
            ]
    except ParameterError as error:
        raise Refused(str(error)) from None
    for note in notes:
        click.echo(note, err=True)
    return studies


def use_scheduler(scheduler: str, studies: Sequence[Study]) -> None:
    """Check that a scheduler can be used, and have the notebooks' kernels use it."""
    from thesis_lib.figure_sets.registry import FIGURE_SETS
    from thesis_lib.studies import schedulers

    try:
        schedulers.check_address(scheduler)
    except ValueError as error:
        raise Refused(f"--scheduler: {error}") from None
    others = [study.name for study in studies if not FIGURE_SETS[study.name].in_pieces]
    if len(others) == len(studies):
        raise Refused(
            f"--scheduler: given with {', '.join(others)}, allowed with camera and sound studies "
            "(beam-…, plate-…, sound-…, shape-…), which can be cut into pieces"
        )
    for name in others:
        click.echo(schedulers.describe_alone(name), err=True)
    schedulers.check_scheduler(scheduler)
    os.environ[schedulers.SCHEDULER_VARIABLE] = scheduler


def output_folder(names: Sequence[str], studies: Sequence[Study], out: Path | None) -> Path:
    """Return the folder of a run: the given one, or one named by the requests."""
    import hashlib

    from thesis_lib.files import workplace

    if out is None:
        words = [Path(name).resolve().name if is_folder(name) else name for name in names]
        digest = studies[0].digest
        if len(studies) > 1:
            joined = " ".join(study.digest for study in studies)
            digest = hashlib.sha256(joined.encode()).hexdigest()[:10]
        out = workplace() / "runs" / f"{'+'.join(dict.fromkeys(words))}-{digest}"
    return new_folder(out)


def new_folder(out: Path, option: str = "--out") -> Path:
    """Check a folder to write to: no file stands in its way, writing is allowed."""
    if str(out) in ("", "."):
        raise Refused(f"{option}: given no folder of its own, allowed: a folder, new or not")
    folder = out.absolute()
    if has_hidden(str(folder)):
        raise Refused(f"{option}: given {str(out)!r}, allowed: a visible name")
    try:
        (folder / ("x" * LONGEST_FILE)).lstat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise Refused(
                f"{option}: given {one_line(str(out))}, but a file in it would have too long a "
                "name; allowed: a shorter one"
            ) from None
    there = next(place for place in (folder, *folder.parents) if os.path.lexists(place))
    problem = "" if os.access(there, os.W_OK | os.X_OK) else "cannot be written to"
    if not there.is_dir():
        problem = "is a file" if there.exists() else "leads nowhere"
    if problem:
        raise Refused(
            f"{option}: given {out}, but {there} {problem}; allowed: a folder, new or not"
        )
    return folder
