"""List of all pieces of pages that are made from cubes, and their writer."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from thesis_lib import files
from thesis_lib.book.pieces import conclusions, findings, structures
from thesis_lib.book.pieces.opened import Cubes, MissingCubeError, Opened
from thesis_lib.figure_sets import display
from thesis_lib.figure_sets.parametric import figures as shape_figures, sound


def write_pieces(made: Sequence[Path], folder: Path, names: Iterable[str] | None = None) -> None:
    """Write pieces of :data:`PIECES` from the cubes `made` into `folder`, all or by `names`.

    A piece whose figure set has no cube is replaced by a note that this set did not run.
    """
    opened = Opened(made)
    for name in PIECES if names is None else names:
        try:
            text = PIECES[name](opened)
        except MissingCubeError as error:
            missing = f"Missing here, since it did not run: `{error.args[0]}`."
            text = f"*{missing} `thesis book` adds it once it does.*\n"
        files.whole_text(folder / f"{name}.md", text)


FIRST_AND_LAST = ("projections", "focus", "stereo")  # shown at the first and last distance
CUBE_TEXTS: dict[str, tuple[str, ...]] = {
    "cameras": (
        "flow", "formats", "sensors", "lens", "pixels", "colours", "horizons", *FIRST_AND_LAST,
    ),
    "design-law": (
        "settings", "findings", "pairs", "estimators", "mistakes", "refined", "dither",
        "few-shares", "few-noisy",
    ),
    "planner": ("thesis", "limits", "front", "targets", "verification", "sound"),
    "lab-elevation": ("optima",),
    **dict.fromkeys(("lab-layout", "lab-equal-pixels", "lab-modes", "lab-plate"), ("results",)),
    "lab-radiation": ("results", "sentences", "tap"),
    "sound-aperture": ("turn-summary",),
}  # fmt: skip
"""By figure set: those of its texts that chapters show, as ``SET-TEXT.md``."""


def _fill_piece(figure_set: str, text: str, opened: Cubes) -> str:
    """Fill in a text of a figure set from its cube."""
    return display.fill_text(opened[figure_set], text, *[True] * (text in FIRST_AND_LAST))


OF_LEDGER = ("home-findings", "conclusions-counted", "conclusions-stated", "conclusions-wishes")
"""Pieces that read the cube of the ledger, which is computed after all others."""
OF_NO_CUBE = ("planner-example", "shapes-convergence", "sound-markers", "beam-model", "plate-model")
"""Pieces that take long and read no cube."""

PIECES: dict[str, Callable[[Cubes], str]] = {
    **shape_figures.PIECES,
    **findings.PIECES,
    **structures.PIECES,
    **{
        f"{of}-{text}": partial(_fill_piece, of, text)
        for of, texts in CUBE_TEXTS.items()
        for text in texts
    },
    "sound-sum": sound.compare_sums,
    **conclusions.PIECES,
}
