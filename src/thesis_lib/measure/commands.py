"""Actions of ``thesis measure``, and the commands ``print``, ``sync`` and ``convert``."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from thesis_lib.files import check_outputs, name_failing_path, put_files, staging
from thesis_lib.text import RefusedError, echo, print_json

if TYPE_CHECKING:
    from thesis_lib.measure.recordings.manifest import Manifest

Option = Callable[[Callable[..., None]], Callable[..., None]]


class FiniteRange(click.FloatRange):
    """A range of numbers that excludes NaN."""

    def convert(self, value: Any, *where: Any) -> float:
        """Return the number; fail if it is NaN or out of range."""
        number: float = super().convert(value, *where)
        if number != number:
            self.fail(f"{value} is no number.", *where)
        return number


class PathType(click.Path):
    """A path that must not be empty: an empty one would be the current folder."""

    def convert(self, value: Any, *where: Any) -> Any:
        """Return the path; fail if it is empty."""
        return super().convert(value, *where) if str(value) else self.fail("it is empty.", *where)


_FILE_TYPE = PathType(path_type=Path, dir_okay=False)
_LENGTH_MM = FiniteRange(0.5, 5000)
_COUNT_RANGE = click.IntRange(1, 200)
_TILE_RANGE = click.IntRange(4, 100)
_PAPER_OPTION = click.option(
    "--paper",
    type=click.Choice(("A4", "A3", "A2", "A1", "A0", "letter", "tabloid")),
    default="A4",
    show_default=True,
    help="Size of a page.",
)


class HelpGroup(click.Group):
    """A command group that prints its help when called without arguments."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments, or ``--help`` if there are none; return those not parsed."""
        return super().parse_args(ctx, args or ["--help"])


def start(folder: Path, given: Mapping[str, Any]) -> None:
    """Write a manifest of recordings in a folder, or of planned ones; print what is missing."""
    from thesis_lib.measure.feasibility.prediction import write_draft
    from thesis_lib.measure.recordings.manifest import rename_options
    from thesis_lib.measure.recordings.template import new_manifest

    given = rename_options(dict(given))
    with name_failing_path(folder):
        write = write_draft if "cameras" in given else new_manifest
        manifest, lines = write(folder, given)
    echo(*lines)
    name = shlex.quote(str(manifest))
    echo(f"Now look through {name}, and run: thesis measure --check {name}")


def check_manifest(manifest: Manifest, folder: Path, out: Path | None, as_json: bool) -> None:
    """Print the predicted performance of a manifest's recordings; plot it into `out`, if given.

    The page for clicking corners is written into `folder`, the manifest's, if all videos exist.
    """
    from thesis_lib.measure.feasibility import assess
    from thesis_lib.measure.recordings.template import PAGE_NAME, corners_page

    assessment = assess.assess_manifest(manifest)
    verdict = assess.describe_verdict(assessment)
    files = []
    if all((folder / camera.video).is_file() for camera in manifest.cameras):
        with staging(folder) as part:
            (part / PAGE_NAME).write_text(corners_page(manifest, folder), encoding="utf-8")
            put_files(part, folder)
        files.append(f"To click the structure's corners, open {folder / PAGE_NAME}")
    if out:  # camera positions and predicted errors
        from thesis_lib.measure.report.figures import draw_prediction
        from thesis_lib.plotting.style import save_figure

        figures = draw_prediction(manifest)
        with staging(out) as part:
            for name, figure in figures.items():
                (part / f"{name}.png").write_bytes(save_figure(figure, "png", dpi=140))
            put_files(part, out)
        files += [f"Wrote {out / name}.png" for name in figures]
    if as_json:
        outcome = {"outcome": assessment.verdict.outcome, "text": " ".join(verdict)}
        print_json(asdict(assessment) | outcome)
        return
    echo(*assess.describe_assessment(assessment), *files, "")
    well = assessment.verdict.outcome == "compressed" and not assessment.warnings
    failed = assessment.verdict.outcome in ("none", "unseen")
    echo(*verdict, colour="green" if well else "red" if failed else "yellow")


def run_measurement(path: Path, out: Path, as_json: bool) -> None:
    """Measure the recordings of a manifest, write the results to a folder, and print them."""
    from thesis_lib.measure.pipeline import measure_recordings

    report = measure_recordings(path, out, partial(echo, err=as_json))
    page = out / "report.html"
    if as_json:
        notes = [note._asdict() for note in report.notes]
        print_json({"report": str(page), "found": report.summary, "notes": notes})
    else:
        echo(f"Open {page}")


@click.group("print", cls=HelpGroup, short_help="Print boards, markers and stands as PDF.")
def print_() -> None:
    """Print boards, markers and camera stands to true scale, as PDF."""


def _number_option(
    name: str, default: float, what: str, allowed: click.IntRange | click.FloatRange = _LENGTH_MM
) -> Option:
    return click.option(name, type=allowed, default=default, show_default=True, help=what)


@print_.command(short_help="Draw a calibration board.")
@click.argument("file", type=_FILE_TYPE, default=Path("board.pdf"), required=False)
@_number_option("--columns", 7, "Tiles along.", _TILE_RANGE)
@_number_option("--rows", 5, "Tiles across.", _TILE_RANGE)
@_number_option("--tile-mm", 25.0, "Side of a tile.")
@click.option("--charuco", is_flag=True, help="With ArUco marks, a ChArUco board.")
@click.option("--two-sided", is_flag=True, help="With the mirror image, for the back.")
@_PAPER_OPTION
def board(file: Path, **given: Any) -> None:
    """Draw a calibration board into FILE, board.pdf if not given."""
    from thesis_lib.measure.paper import write_board

    with name_failing_path(file):
        said = write_board(file, **given)
    echo(f"{file}: print at 100 %, measure the line of 100 mm, glue the sheet on a flat plate")
    echo(*said.split("\n"))


@print_.command(short_help="Draw markers, on as many pages as needed.")
@click.argument("file", type=_FILE_TYPE, default=Path("markers.pdf"), required=False)
@_number_option("--columns", 10, "Markers along.", _COUNT_RANGE)
@_number_option("--rows", 6, "Markers across.", _COUNT_RANGE)
@_number_option("--spacing-mm", 25.0, "Distance of centres along.")
@click.option("--row-spacing-mm", type=_LENGTH_MM, help="Distance across.  [default: as along]")
@_number_option("--diameter-mm", 8.0, "Of a marker.")
@click.option("--bright", is_flag=True, help="White on black.")
@_PAPER_OPTION
def markers(file: Path, **given: Any) -> None:
    """Draw markers into FILE, markers.pdf if not given, on as many pages as they need."""
    from thesis_lib.measure.paper import write_markers

    with name_failing_path(file):
        count = write_markers(file, **given)
    echo(f"{file}: {count} pages to be printed at 100 %, cut at the corner marks, and joined")


@print_.command(short_help="Draw where the cameras of a manifest stand.")
@click.argument("manifest", type=PathType(path_type=Path), metavar="MANIFEST.yaml")
@click.argument("file", type=_FILE_TYPE, default=Path("stand.pdf"), required=False)
@_PAPER_OPTION
def stand(manifest: Path, file: Path, paper: str) -> None:
    """Draw where the cameras of MANIFEST.yaml stand into FILE, stand.pdf if not given."""
    from thesis_lib.measure.paper import write_stand
    from thesis_lib.measure.recordings.manifest import read_manifest

    with name_failing_path(file):
        write_stand(file, read_manifest(manifest, check_files=False).cameras, paper)
    echo(f"{file}: print it at 100 %, and lay it under the structure's centre")


@click.command(short_help="Find by sound when videos started.")
@click.argument("videos", nargs=-1, required=True, type=PathType(path_type=Path))
@click.option(
    "--out",
    type=PathType(path_type=Path, file_okay=False),
    default=Path("sync"),
    show_default=True,
    help="Folder to write to.",
)
def sync(videos: tuple[Path, ...], out: Path) -> None:
    """Find by their sound when VIDEOS started and how their clocks drift; change none of them."""
    if len(videos) < 2:
        raise click.UsageError("sync: given one video, allowed: two or more of one event")
    for video in videos:
        if not video.is_file():
            why = "a folder, not a file" if video.is_dir() else "no such file"
            raise click.UsageError(f"sync: given {video}, {why}")
    if len({video.resolve() for video in videos}) < len(videos):
        raise click.UsageError("sync: a video is given twice, allowed: each once")
    from thesis_lib.measure.synchronisation.alone import write_synchronisation

    with name_failing_path(out):
        lines = write_synchronisation(videos, out)
    echo(*lines)
    echo(f"Wrote {out / 'sync.csv'} and {out / 'sync.png'}")


@click.command(short_help="Convert images or raw frames to video.")
@click.argument("source", type=PathType(path_type=Path))
@click.argument("video", type=_FILE_TYPE, required=False)
@click.option("--rate-hz", type=FiniteRange(0.1, 1e6), help="Frames per second.")
def convert(source: Path, video: Path | None, rate_hz: float | None) -> None:
    """Convert images, raw frames (.cih, .cihx) or a film to a video at its true rate.

    Nothing is lost except the sound of a film; SOURCE is not changed. VIDEO is SOURCE.mov if not
    given; an existing file is not replaced.
    """
    from thesis_lib.measure.recordings.media import pack_frames
    from thesis_lib.measure.recordings.media_info import MediaError

    named = source.resolve() if source.name in ("", "..") else source  # as "." has no name
    stem = named.name if source.is_dir() else named.stem
    target = video or named.with_name(f"{stem}.mov")
    if video is None and target == source:
        target = named.with_name(f"{stem}-{rate_hz or 0:g}.mov")
    with name_failing_path(target):
        check_outputs(target.parent, [target])
        try:
            count, (width, height) = pack_frames(source, target, rate_hz)
        except MediaError as error:
            raise RefusedError(str(error)) from None
    echo(f"{target}: {count} frames of {width} × {height} px")
