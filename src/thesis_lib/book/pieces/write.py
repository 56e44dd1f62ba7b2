"""All pieces of pages that are made of cubes, and writing them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from thesis_lib import files
from thesis_lib.book import missing
from thesis_lib.book.pieces import benchmarks as benchmark_tables
from thesis_lib.book.pieces import conclusions, findings, structures
from thesis_lib.book.pieces.opened import Cubes, Opened
from thesis_lib.figure_sets import display
from thesis_lib.figure_sets.design_law import tables as design_tables
from thesis_lib.figure_sets.optics import tables as optics_tables
from thesis_lib.figure_sets.parametric import sound, sound_turn
from thesis_lib.figure_sets.parametric import symmetry as shape_tables
from thesis_lib.figure_sets.planner import tables as planner_tables


def write_pieces(
    made: Sequence[Path], folder: Path, without: Iterable[str] = (), names: Iterable[str] = ()
) -> None:
    """Write pieces of :data:`PIECES` from the cubes `made` into `folder`, all or by their `names`.

    Pieces that need the figure sets `without` a cube say that these are missing.
    """
    opened = Opened(made, without)
    for name in names or PIECES:
        files.whole_text(folder / f"{name}.md", _render_piece(PIECES[name], opened))


def _render_piece(piece: Callable[[Cubes], str], opened: Opened) -> str:
    """Return one piece, or a sentence on the cubes that it is missing."""
    opened.forget()
    try:
        text = piece(opened)
    except Exception:
        if not opened.wanted:
            raise
        text = ""
    if opened.wanted:
        text = "\n\n".join(filter(None, [text, missing.describe_missing(opened.wanted)]))
    return text


LABORATORY_PIECES = {  # pieces: figure set, and its template
    "lab-elevation-results": ("lab-elevation", "optima"),
    "lab-layout-results": ("lab-layout", "results"),
    "lab-equal-pixels-results": ("lab-equal-pixels", "results"),
    "lab-modes-results": ("lab-modes", "results"),
    "lab-plate-results": ("lab-plate", "results"),
    "lab-radiation-results": ("lab-radiation", "results"),
    "lab-radiation-sentences": ("lab-radiation", "sentences"),
    "lab-radiation-tap": ("lab-radiation", "tap"),
}


def _fill_laboratory(figure_set: str, template: str, opened: Cubes) -> str:
    """Fill in a piece about what is rendered beyond chapter 5."""
    return display.fill_text(opened[figure_set], template)


def _fill_optics(name: str, opened: Cubes) -> str:
    """Fill in a table of chapter 2 or its appendices, from the cube of ``cameras``."""
    return optics_tables.PIECES[name](opened["cameras"])


def _fill_benchmark(name: str, _: Cubes) -> str:
    """Tabulate what the published run of the benchmarks measured."""
    return benchmark_tables.PIECES[name]()


def _fill_design(name: str, opened: Cubes) -> str:
    """Describe the law of rounding for design, from the cube of ``design-law``."""
    return design_tables.PIECES[name](opened["design-law"])


def _fill_planner(name: str, opened: Cubes) -> str:
    """Describe planned layouts, from the cube of ``planner``."""
    return planner_tables.PIECES[name](opened["planner"])


OF_LEDGER = ("home-findings", "conclusions-counted", "conclusions-stated", "conclusions-wishes")
"""Those that read the cube of the ledger, which comes after all others."""

PIECES: dict[str, Callable[[Cubes], str]] = {
    **shape_tables.PIECES,
    **{f"cameras-{name}": partial(_fill_optics, name) for name in optics_tables.PIECES},
    **{f"design-{name}": partial(_fill_design, name) for name in design_tables.PIECES},
    **{f"planner-{name}": partial(_fill_planner, name) for name in planner_tables.PIECES},
    **findings.PIECES,
    **structures.PIECES,
    **{name: partial(_fill_laboratory, *of) for name, of in LABORATORY_PIECES.items()},
    "sound-sum": sound.compare_sums,
    "sound-turn": lambda opened: sound_turn.turn_summary(opened["sound-aperture"]),
    **conclusions.PIECES,
    **{name: partial(_fill_benchmark, name) for name in benchmark_tables.PIECES},
}
