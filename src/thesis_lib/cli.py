"""The ``thesis`` command. Imports are lazy: a list or a refusal should answer at once."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from thesis_lib import files
from thesis_lib.measure.commands import one_line, pack, print_, sync
from thesis_lib.runs.requested import (
    FAILED,
    INTERRUPTED,
    REFUSED,
    Refused,
    assigned_values,
    check_chapter,
    is_folder,
    new_folder,
    output_folder,
    requests_of,
    use_scheduler,
)
from thesis_lib.text import message, of_error

if TYPE_CHECKING:
    from xarray import Dataset

    from thesis_lib.runs.execute import Job
_PATH = click.Path(path_type=Path)
_ASSIGNMENTS = click.option(
    "-p",
    "assignments",
    multiple=True,
    metavar="KEY=VALUE",
    help="A parameter; lists and objects as JSON.",
)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="thesis-lib", prog_name="thesis")
def cli() -> None:
    """Rerun the thesis: figure sets, chapters, the whole book."""


@cli.command("list")
@click.argument("name", required=False)
def list_(name: str | None) -> None:
    """List the figure sets, or the parameters of the set, chapter or folder NAME."""
    from thesis_lib.figure_sets import outside
    from thesis_lib.figure_sets.registry import CHAPTERS, STUDIES, validate
    from thesis_lib.studies import effort
    from thesis_lib.studies.request import ParameterError, describe

    costs = effort.read()
    if name is None:
        for study in STUDIES.values():
            number = len(study.model_construct().settings())
            settings = f"{number:>3} settings" if number else ""
            cost = costs.get(study.name)
            takes = f"{cost.time:>6}  {cost.memory:>7}" if cost else ""
            kind = cost.kind if cost else ""
            click.echo(f"{study.name:<22} {settings:<12} {kind:<7} {takes:<15}   {study.title}")
        for chapter, names in CHAPTERS.items():
            click.echo(f"{chapter:<22} {'':>36}   {', '.join(names)}")
        click.echo(
            "\nReading the book takes no run. Time and memory are those of making a set from "
            "nothing on two cores."
        )
        click.echo("`thesis list NAME` shows a set's parameters, `thesis run NAME` runs it.")
        return
    try:
        sets = outside.load(Path(name)) if is_folder(name) else CHAPTERS.get(name, [name])
        chosen = [type(validate(set_, {})) for set_ in sets]
    except ParameterError as error:
        raise Refused(str(error)) from None
    texts = ["\n".join([f"{s.name}: {s.title}\n", *_parameter_lines(describe(s))]) for s in chosen]
    click.echo("\n\n".join(texts))


@cli.command()
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@_ASSIGNMENTS
@click.option("--out", type=_PATH, help="Folder to write to.  [default: runs/NAME-HASH]")
@click.option(
    "--scheduler",
    metavar="processes|tcp://HOST:PORT",
    envvar="THESIS_SCHEDULER",
    help="Compute camera and sound studies by worker processes on this machine, or by an existing "
    "Dask cluster; the results are the same.  [default: this process]",
)
def run(
    names: Sequence[str], assignments: Sequence[str], out: Path | None, scheduler: str | None
) -> None:
    """Run figure sets, chapters (ch3) or a folder of your own with your parameters.

    Writes notebook, cube and one self-contained page of each set, and prints what changed against
    the published run.
    """
    from thesis_lib.figure_sets.registry import TITLES

    studies = requests_of(names, assigned_values(assignments))
    folder = output_folder(names, studies, out)
    if scheduler is not None:
        use_scheduler(scheduler, studies)
    from thesis_lib.runs import nursery

    nursery.ready()  # it imports while this process does
    from thesis_lib.runs import execute as runs
    from thesis_lib.runs import tasks
    from thesis_lib.studies import comparison

    jobs = [
        runs.Job(study, *(folder / f"{study.name}.{kind}" for kind in ("ipynb", "nc", "html")))
        for study in studies
    ]
    # With a scheduler one set after another: each has all the workers.
    tasks.run(runs.job_tasks(jobs), 2 if scheduler is None else 1)
    if len(jobs) > 1:
        from thesis_lib.web.page import index_page

        entries = [(job.study.title, f"{job.study.name}.html") for job in jobs]
        title = TITLES.get(names[0], "Runs") if len(names) == 1 else "Runs"
        files.whole_text(folder / "index.html", index_page(title, entries))
    for job in jobs:
        click.echo(f"\n{job.study.name}")
        click.echo("\n".join(comparison.difference_lines(_own_cube(job))))
    click.echo(
        f"\nOpen {folder / ('index.html' if len(jobs) > 1 else f'{jobs[0].study.name}.html')}"
    )


def _own_cube(job: Job) -> Dataset:
    """The cube of a job that has run, unless another run has taken its place since."""
    from thesis_lib.figure_sets import cube_file

    cube = cube_file.read(job.cube)
    if cube.attrs.get("parameters_hash") != job.study.digest:
        raise click.ClickException(
            f"{job.cube}: another run has meanwhile been written there; "
            "give each a folder of its own by --out"
        )
    return cube


@cli.command()
@_ASSIGNMENTS
@click.option(
    "--structure",
    type=_PATH,
    metavar="FILE.nc",
    help="Markers and mode shapes to measure, in place of beam or plate.",
)
@click.option("--out", type=_PATH, help="Folder to write to.  [default: runs/plan-HASH]")
@click.option("--parameters", is_flag=True, help="Only list the parameters.")
def plan(
    assignments: Sequence[str], structure: Path | None, out: Path | None, parameters: bool
) -> None:
    """Find where cameras should stand, how many of which kind, and what they reach.

    Writes the cube, a table of the cameras, a picture and one self-contained page, and says what
    was found. A plan that cannot be is answered with the limit that binds.
    """
    from thesis_lib.planning.request import PlanRequest, plan_request
    from thesis_lib.studies.request import ParameterError, describe

    if parameters:
        click.echo("\n".join(_parameter_lines(describe(PlanRequest))))
        return
    try:
        request = plan_request(assigned_values(assignments))
        for name in ("body", "plate_mm") if structure is not None else ():
            if name in request.model_fields_set:
                raise ParameterError(
                    f"plan: {name} is given beside --structure, allowed: one of them"
                )
    except ParameterError as error:
        raise Refused(str(error)) from None
    folder = output_folder([f"plan-{structure.stem}" if structure else "plan"], [request], out)
    try:
        from thesis_lib.planning.report import write_plan

        lines = write_plan(request, folder, structure, lambda line: click.echo(line, err=True))
    except ParameterError as error:
        raise Refused(str(error)) from None
    except OSError as error:
        raise click.ClickException(
            f"{error.filename or folder}: {error.strerror or error}; put that right, and run the "
            "same command again"
        ) from None
    click.echo("\n".join(lines))
    click.echo(f"Open {folder / 'plan.html'}")


def _parameter_lines(rows: Sequence[dict[str, str]]) -> list[str]:
    """Parameters with defaults, units, meanings and bounds, two lines each."""
    what, how = "{name} = {default} {unit}", "    {meaning}: {allowed}"
    return [line for row in rows for line in (what.format(**row).strip(), how.format(**row))]


@cli.command()
@click.argument("chapter", required=False)
@click.option("--publish", is_flag=True, help="Make these results the published ones.")
@click.option(
    "--from-nothing",
    is_flag=True,
    help="Render one recording of each setting; run everything anew.",
)
def book(chapter: str | None, publish: bool, from_nothing: bool) -> None:
    """Run what is stale, render the book, say where to open it.

    With a CHAPTER (ch3) its figure sets and pages alone, as a book of its own in build/CHAPTER.
    """
    files.project_root()  # refused without a clone
    if chapter is not None:
        check_chapter(chapter, "--publish" * publish or "--from-nothing" * from_nothing)
    from thesis_lib.book import unchanged

    fresh = not (publish or from_nothing or chapter)
    index = unchanged.is_unchanged() if fresh else None
    if index is None:
        click.echo("looking for what is stale", err=True)
        from thesis_lib.book import build as publishing

        if from_nothing:
            from thesis_lib.figure_sets.record import record as film

            film(many=1, say=partial(click.echo, err=True))
            publishing.forget()
        index = publishing.build(publish, chapter or "")
    else:
        click.echo("the book is up to date", err=True)
    click.echo(f"Open {index}")


@cli.command()
@click.argument("only", required=False, type=click.Choice(["example"]), metavar="[example]")
def record(only: str | None) -> None:
    """Render the recordings anew, and make what is measured on them the data of figure sets.

    Its results are computed from data/recordings, which are taken as they are while the code that
    made them is the same. One of every setting takes a quarter of an hour, all twenty take hours;
    what was stopped goes on where it stopped. `thesis record example` does so with the example
    alone, of which the book shows the report, in a minute.
    """
    files.project_root()  # refused without a clone
    if only is not None:
        from thesis_lib.figure_sets import sample

        click.echo(f"Wrote {sample.record(partial(click.echo, err=True))}")
        return
    from thesis_lib.figure_sets.record import record as film

    film(say=partial(click.echo, err=True))


@cli.command()
def pdf() -> None:
    """Print the book that `thesis book` has made as one PDF; needs Chromium."""
    root = files.project_root()
    from thesis_lib.book import pdf as printing

    click.echo(f"Open {printing.build(root)}")


@cli.command()
@click.option("--json", "as_json", is_flag=True, help="Every entry, as one JSON document.")
def claims(as_json: bool) -> None:
    """Hold every claim of the thesis against the cubes of the last `thesis book`.

    Exits 0 whatever the verdicts.
    """
    files.project_root()  # refused without a clone
    from thesis_lib.figure_sets.claims import compute
    from thesis_lib.figure_sets.claims import own_runs as ledger_runs
    from thesis_lib.figure_sets.claims.figure_set import OWN_RUNS
    from thesis_lib.figure_sets.claims.parameters import Claims
    from thesis_lib.figure_sets.cube_file import built
    from thesis_lib.figure_sets.run import made
    from thesis_lib.ledger import report as ledger_report

    own = made(OWN_RUNS, Claims().own_runs)
    found = compute.judged(built, ledger_runs.read_own(own))
    if as_json:
        click.echo(json.dumps([entry.record for entry in found], ensure_ascii=False, indent=1))
    else:
        click.echo(ledger_report.report(found))


@cli.command()
@click.argument("manifest", type=_PATH, required=False, metavar="MANIFEST.yaml")
@click.option(
    "--out", type=_PATH, help="Folder to write to.  [default: measured, beside the manifest]"
)
@click.option(
    "--check",
    is_flag=True,
    help="Only tell what the recordings could reach; with --out, draw it, too.",
)
@click.option(
    "--example",
    type=_PATH,
    metavar="DIR",
    help="Instead of measuring, write a small rendered recording into DIR.",
)
@click.option(
    "--new",
    type=_PATH,
    metavar="FOLDER",
    help="Instead of measuring, write a manifest for the videos and pictures in FOLDER; -p gives "
    "what no file shows, as -p board.tile_mm=30. With -p cameras=4, for four phones, before "
    "anything is filmed.",
)
@_ASSIGNMENTS
def measure(
    manifest: Path | None,
    out: Path | None,
    check: bool,
    example: Path | None,
    new: Path | None,
    assignments: Sequence[str],
) -> None:
    """Measure the recordings that MANIFEST.yaml names, from calibration to report.

    Interrupted, the same command goes on where it stopped.
    """
    given = sum(one is not None for one in (manifest, example, new))
    if given != 1:
        what = "neither" if not given else "both" if given == 2 else "all"
        allowed = "MANIFEST.yaml, --new FOLDER or --example DIR"
        raise Refused(f"measure: given {what}, allowed: {allowed}")
    if assignments and new is None:
        raise Refused("measure: -p is given, allowed: with --new FOLDER; else edit the manifest")
    if new is not None:
        from thesis_lib.measure.commands import start

        start(new, assigned_values(assignments))
        return
    if example is not None:
        _example(example)
        return
    assert manifest is not None
    from thesis_lib.measure.feasibility.assess import assess
    from thesis_lib.measure.feasibility.describe import describe
    from thesis_lib.measure.recordings.manifest import read_manifest

    drawn, out = out, manifest.parent / "measured" if out is None else out
    with one_line(out):
        wanted = read_manifest(manifest, check_files=not check)
        if check:  # before anything is filmed
            click.echo("\n".join(describe(assess(wanted))))
            if drawn is not None:
                from thesis_lib.measure.commands import draw

                draw(wanted, new_folder(drawn))
            return
        folder = new_folder(out)
        from thesis_lib.measure.pipeline import measure as run_measure

        report = run_measure(manifest, folder, click.echo)
    click.echo(f"Open {report}")


def _example(folder: Path) -> None:
    """Write the example and say what to do with it."""
    from thesis_lib.laboratory.example import write_example

    folder = new_folder(folder, "--example")
    with one_line(folder):
        try:
            manifest = write_example(folder, click.echo)
        except FileExistsError as error:
            raise Refused(f"--example: {error}") from None
    click.echo(f"Now run: thesis measure {shlex.quote(str(manifest))}")


@cli.command()
@click.argument("new", type=_PATH, metavar="A.nc")
@click.argument("old", type=_PATH, required=False, metavar="[B.nc]")
def compare(new: Path, old: Path | None) -> None:
    """Show how cube A differs from B, in everything, or from the published run, in errors."""
    from thesis_lib.figure_sets import cube_file
    from thesis_lib.studies import comparison, storage

    try:
        first = cube_file.read(new)
        second = cube_file.read(old) if old else first
        one, other = (cube.attrs["figure_set"] for cube in (first, second))
        if one != other:
            raise Refused(f"{old}: given a cube of {other}, allowed: one of {one}, as {new} is")
        earlier = (second, old.name) if old else (None, "")
        click.echo("\n".join(comparison.all_difference_lines(first, *earlier)))
    except storage.CubeError as error:  # the published run's, too
        raise Refused(str(error)) from None


cli.add_command(print_)
cli.add_command(sync)
cli.add_command(pack)


def _lacking(error: ModuleNotFoundError) -> str:
    """Which optional part of the project a package that is not there belongs to."""
    import importlib.metadata

    package = (error.name or "").partition(".")[0]
    wanted = package.replace("_", "-")
    for line in importlib.metadata.requires("thesis-lib") or []:
        name, _, extra = line.partition("; extra == ")
        if extra and name.startswith(wanted):
            return f"needs the package {wanted}: pip install 'thesis-lib[{extra.strip(chr(39))}]'"
    return of_error(error)


def _said(error: Exception) -> str:
    """What an error says: ours are written to be read, others may say anything."""
    if isinstance(error, ModuleNotFoundError):
        return _lacking(error)
    ours = type(error).__module__.startswith("thesis_lib")
    lines = (str(error) if ours else of_error(error)).splitlines() or [type(error).__name__]
    return "\n".join(map(message, lines))


def main() -> None:
    """Run the command; errors are lines on standard error, and nothing else is."""
    from thesis_lib.runs import ending

    try:
        ending.prepare()
        status = cli.main(standalone_mode=False)
    except (click.exceptions.Abort, KeyboardInterrupt):
        ending.stop(INTERRUPTED)
    except click.ClickException as error:
        click.echo(message(f"thesis: {error.format_message()}"), err=True)
        status = error.exit_code
    except Exception as error:
        click.echo(f"thesis: {_said(error)}", err=True)
        status = REFUSED if isinstance(error, files.NoCloneError) else FAILED
    sys.exit(status)
