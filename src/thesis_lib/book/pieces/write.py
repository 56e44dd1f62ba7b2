"""All pieces of pages that are made of cubes, and writing them."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from thesis_lib import files
from thesis_lib.book.pieces import benchmarks as benchmark_tables, conclusions, findings, structures
from thesis_lib.book.pieces.opened import Cubes, Opened
from thesis_lib.figure_sets import display
from thesis_lib.figure_sets.parametric import figures as shape_figures, sound


def write_pieces(
    made: Sequence[Path], folder: Path, without: Iterable[str] = (), names: Iterable[str] = ()
) -> None:
    """Write pieces of :data:`PIECES` from the cubes `made` into `folder`, all or by their `names`.

    Pieces that need the figure sets `without` a cube say that these are missing.
    """
    opened = Opened(made, without)
    for name in names or PIECES:
        opened.forget()
        texts = []
        try:
            texts.append(PIECES[name](opened))
        except Exception:
            if not opened.wanted:
                raise
        if opened.wanted:
            sets = ", ".join(f"`{wanted}`" for wanted in sorted(opened.wanted))
            missing = f"Missing here, since it did not run: {sets}."
            texts.append(f"*{missing} `thesis book` adds it once it does.*\n")
        files.whole_text(folder / f"{name}.md", "\n\n".join(filter(None, texts)))


CUBE_PIECES: dict[str, tuple[Any, ...]] = {
    **{
        f"cameras-{name}": ("cameras", name)
        for name in ("flow", "formats", "sensors", "lens", "pixels", "colours", "horizons")
    },
    **{f"cameras-{name}": ("cameras", name, True) for name in ("projections", "focus", "stereo")},
    **{
        f"design-{name}": ("design-law", name)
        for name in ("settings", "findings", "pairs", "estimators", "mistakes", "refined", "dither")
    },
    "design-shares": ("design-law", "few-shares"),
    "design-noisy": ("design-law", "few-noisy"),
    **{
        f"planner-{name}": ("planner", name)
        for name in ("thesis", "limits", "front", "targets", "verification", "sound")
    },
    "lab-elevation-results": ("lab-elevation", "optima"),
    "lab-layout-results": ("lab-layout", "results"),
    "lab-equal-pixels-results": ("lab-equal-pixels", "results"),
    "lab-modes-results": ("lab-modes", "results"),
    "lab-plate-results": ("lab-plate", "results"),
    "lab-radiation-results": ("lab-radiation", "results"),
    "lab-radiation-sentences": ("lab-radiation", "sentences"),
    "lab-radiation-tap": ("lab-radiation", "tap"),
    "sound-turn": ("sound-aperture", "turn-summary"),
}
"""By piece: the figure set, its template, and what it is given."""


def _fill_piece(of: tuple[Any, ...], opened: Cubes) -> str:
    """Fill in a piece from the cube of one figure set."""
    figure_set, template, *which = of
    return display.fill_text(opened[figure_set], template, *which)


def _fill_benchmark(name: str, _: Cubes) -> str:
    """Tabulate what the published run of the benchmarks measured."""
    return benchmark_tables.PIECES[name]()


OF_LEDGER = ("home-findings", "conclusions-counted", "conclusions-stated", "conclusions-wishes")
"""Those that read the cube of the ledger, which comes after all others."""

PIECES: dict[str, Callable[[Cubes], str]] = {
    **shape_figures.PIECES,
    **findings.PIECES,
    **structures.PIECES,
    **{name: partial(_fill_piece, of) for name, of in CUBE_PIECES.items()},
    "sound-sum": sound.compare_sums,
    **conclusions.PIECES,
    **{name: partial(_fill_benchmark, name) for name in benchmark_tables.PIECES},
}
