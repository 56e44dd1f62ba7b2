"""What the book finds, in five sentences with a number each: the first thing that a reader sees."""

from __future__ import annotations

import numpy as np

from thesis_lib.book.conclusions.knobs import KNOBS
from thesis_lib.book.conclusions.pixels import equal_pixels
from thesis_lib.book.conclusions.strengths import Cubes, strengths
from thesis_lib.book.pieces.results import changes, missed, over_rms
from thesis_lib.ledger.cube import from_cube

HELD = ("agrees", "within scatter", "no material change")


def findings(opened: Cubes) -> str:
    """Five sentences, each with where it is shown."""
    claims = [entry for entry in from_cube(opened["claims"]) if entry.counted]
    met = {word: sum(entry.verdict == word for entry in claims) for word in (*HELD, "differs")}
    left = {knob: left for knob, (_, _, left) in changes(opened, "beam").items()}
    ratios = np.concatenate([over_rms(opened, body) for body in ("beam", "plate")])
    pair = float(np.median([one.ratio for one in equal_pixels()]))
    shape, sound = (
        float(opened["sound-arrays"][name].isel(trial=slice(1, None)).median())
        for name in ("deflection_error", "plane_error")
    )
    heard = [
        one
        for name, knob in KNOBS.items()
        if name != "wider"
        for one in strengths(opened, knob)
        if one.group == "sound"
    ]
    held, of = sum(one.confident for one in heard), sum(len(one.factors) for one in heard)
    said = [
        f"**Most of it holds.** Of {len(claims)} statements {met['agrees']} agree, "
        f"{met['within scatter']} lie within the scatter of single runs, {met['differs']} differ, "
        f"{met['no material change']} hardly change "
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
        f"[its sound](sound.md) to {sound:.1f} % (medians). The thesis sees no trend in it; {held} "
        f"of {of} curves [show one](conclusions.md#the-sound).",
    ]
    return "".join(f"* {sentence}\n" for sentence in said)


PIECES = {"home-findings": findings}
