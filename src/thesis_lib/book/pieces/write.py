"""All pieces of pages that are made of cubes, and writing them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

import xarray as xr

from thesis_lib import files, records
from thesis_lib.book import missing
from thesis_lib.book.pieces import benchmarks as benchmark_tables
from thesis_lib.book.pieces import conclusions, findings, rounding, structures
from thesis_lib.book.pieces.opened import Cubes, Opened
from thesis_lib.figure_sets import keys
from thesis_lib.figure_sets.design_law import tables as design_tables
from thesis_lib.figure_sets.optics import tables as optics_tables
from thesis_lib.figure_sets.parametric import sound, sound_turn
from thesis_lib.figure_sets.parametric import symmetry as shape_tables
from thesis_lib.figure_sets.planner import tables as planner_tables


def write(
    made: Sequence[Path],
    folder: Path,
    without: Iterable[str] = (),
    names: Iterable[str] = (),
    costs: Sequence[Path] = (),
) -> None:
    """Write pieces of :data:`PIECES` from the cubes `made` into `folder`, all or by their `names`.

    Those whose cubes are as they were, and the published `costs`, stay. Pieces that need the figure
    sets `without` a cube say that these are missing.
    """
    opened = Opened(made, without)
    digests = {path.stem: files.sha256(path) for path in made}
    key = f"{keys.made_by(__name__)}{files.digest_of(costs)}{','.join(sorted(digests))}"
    (folder / ".made").mkdir(exist_ok=True)
    for name in names or PIECES:
        target, record = folder / f"{name}.md", folder / ".made" / f"{name}.json"
        kept = records.read(record)
        if (
            kept is not None
            and kept.made_from == _made_from(key, used(record), digests)
            and not records.damage(record, [target])
        ):
            continue
        files.whole_text(target, _text(PIECES[name], opened))
        records.write(record, _made_from(key, opened.used, digests), [target])


def _made_from(key: str, names: Iterable[str], digests: Mapping[str, str]) -> str:
    """What a piece is made from: all code, and the cubes that it uses."""
    return " ".join([key, *(f"{name}={digests.get(name)}" for name in sorted(names))])


def used(record: Path) -> list[str]:
    """The cubes that a piece used, by its record."""
    kept = records.read(record)
    return [part.partition("=")[0] for part in kept.made_from.split()[1:]] if kept else []


def _text(piece: Callable[[Cubes], str], opened: Opened) -> str:
    """One piece, or what it is missing."""
    opened.forget()
    try:
        text = piece(opened)
    except Exception:
        if not opened.wanted:
            raise
        text = ""
    if opened.wanted:
        text = "\n\n".join(filter(None, [text, missing.sentence(opened.wanted)]))
    return text


def _lab(piece: str, cube: xr.Dataset) -> str:
    """A piece about what is rendered beyond chapter 5."""
    from thesis_lib.figure_sets.lab_equal_pixels.tables import results
    from thesis_lib.figure_sets.lab_modes.tables import modes_results
    from thesis_lib.figure_sets.lab_plate.tables import plate_results
    from thesis_lib.figure_sets.lab_radiation import tables as radiation

    made = {
        "equal": results,
        "modes_results": modes_results,
        "plate_results": plate_results,
        "radiation_results": radiation.results,
        "radiation_sentences": radiation.sentences,
        "radiation_tap": radiation.tap,
    }
    return made[piece](cube)


def _layout(name: str, cube: xr.Dataset) -> str:
    """What is said of where cameras stand, from the cube of ``lab-elevation`` or ``lab-layout``."""
    from thesis_lib.figure_sets.lab_layout import tables as lab_layout_tables

    return lab_layout_tables.RESULTS[name](cube)


def _optics(name: str, opened: Cubes) -> str:
    """A table of chapter 2 or its appendices, from the cube of ``cameras``."""
    return optics_tables.PIECES[name](opened["cameras"])


def _benchmark(name: str, _: Cubes) -> str:
    """What the published run of the benchmarks measured."""
    return benchmark_tables.PIECES[name]()


def _design(name: str, opened: Cubes) -> str:
    """What is said of the law of rounding for design, from the cube of ``design-law``."""
    return design_tables.PIECES[name](opened["design-law"])


def _planner(name: str, opened: Cubes) -> str:
    """What is said of planned layouts, from the cube of ``planner``."""
    return planner_tables.PIECES[name](opened["planner"])


OF_LEDGER = ("home-findings", "conclusions-counted", "conclusions-stated", "conclusions-wishes")
"""Those that read the cube of the ledger, which comes after all others."""

PIECES: dict[str, Callable[[Cubes], str]] = {
    **shape_tables.PIECES,
    **{f"cameras-{name}": partial(_optics, name) for name in optics_tables.PIECES},
    **{f"design-{name}": partial(_design, name) for name in design_tables.PIECES},
    **{f"planner-{name}": partial(_planner, name) for name in planner_tables.PIECES},
    **findings.PIECES,
    **structures.PIECES,
    **rounding.PIECES,
    "lab-elevation-results": lambda opened: _layout("lab-elevation", opened["lab-elevation"]),
    "lab-layout-results": lambda opened: _layout("lab-layout", opened["lab-layout"]),
    "lab-equal-pixels-results": lambda opened: _lab("equal", opened["lab-equal-pixels"]),
    "lab-modes-results": lambda opened: _lab("modes_results", opened["lab-modes"]),
    "lab-radiation-results": lambda opened: _lab("radiation_results", opened["lab-radiation"]),
    "lab-radiation-sentences": lambda opened: _lab("radiation_sentences", opened["lab-radiation"]),
    "lab-radiation-tap": lambda opened: _lab("radiation_tap", opened["lab-radiation"]),
    "lab-plate-results": lambda opened: _lab("plate_results", opened["lab-plate"]),
    "sound-sum": sound.sums,
    "sound-turn": lambda opened: sound_turn.turn_summary(opened["sound-aperture"]),
    **conclusions.PIECES,
    **{name: partial(_benchmark, name) for name in benchmark_tables.PIECES},
}
