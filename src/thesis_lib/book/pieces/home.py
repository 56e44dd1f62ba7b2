"""What the book finds, in five sentences with a number each: the first thing that a reader sees."""

from __future__ import annotations

import numpy as np

from thesis_lib.book.conclusions.pixels import equal_pixels
from thesis_lib.book.conclusions.strengths import Cubes
from thesis_lib.book.conclusions.tables import sound_trends
from thesis_lib.book.pieces.results import changes, missed, over_rms
from thesis_lib.ledger.entries import from_cube
from thesis_lib.ledger.verdicts import VERDICTS


def findings(opened: Cubes) -> str:
    """Five sentences, each with where it is shown."""
    claims = [entry for entry in from_cube(opened["claims"]) if entry.counted]
    met = {word: sum(entry.verdict == word for entry in claims) for word in VERDICTS}
    left = {knob: left for knob, (_, _, left) in changes(opened, "beam").items()}
    ratios = np.concatenate([over_rms(opened, body) for body in ("beam", "plate")])
    pair = float(np.median([one.ratio for one in equal_pixels()]))
    shape, sound = (
        float(opened["sound-arrays"][name].isel(trial=slice(1, None)).median())
        for name in ("deflection_error", "plane_error")
    )
    held, of = sound_trends(opened)
    words = {
        "agrees": "agree",
        "within scatter": "lie within the scatter of single runs",
        "differs": "differ",
        "no material change": "change by a tenth at most",
    }
    counts = ", ".join(f"{met[word]} {said}" for word, said in words.items() if met[word])
    said = [
        f"**Most of it holds.** Of {len(claims)} statements {counts} "
        "({doc}`the ledger <executed/claims>`). " + missed(opened),
        f"**It can be foretold.** [The law of rounding](law-of-rounding), without any simulation, "
        f"gives all {len(ratios)} errors of beam and plate, by setting and mode, to within "
        f"{100 * max(np.abs(ratios - 1)):.0f} %.",
        "**Nearer and finer count in proportion, wider hardly.** For the beam a third of the "
        f"distance leaves {left['closer']} of the error, six times the pixels across "
        f"{left['finer']}, opening a pair tenfold {left['wider']} "
        "([conclusions](conclusions.md)).",
        f"**Many cameras do what their pixels do.** Twelve leave {left['more']} of the "
        f"error of two. An array's best pair with all its pixels has {pair:.2f} of its error, at "
        "fewer frames a second "
        "([many or sharp](design-law.md#many-coarse-cameras-or-few-sharp-ones)).",
        f"**Sound is easier than shape.** Arrays that measure the plate to {shape:.1f} % know "
        f"[its sound](sound.md) to {sound:.1f} % (medians). The thesis saw no trend in it; "
        f"[{held} of {of} curves](conclusions.md#the-sound) show one, aperture aside.",
    ]
    return "".join(f"* {sentence}\n" for sentence in said)


PIECES = {"home-findings": findings}
