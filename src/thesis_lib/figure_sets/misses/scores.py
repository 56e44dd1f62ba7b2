"""How likely the stated values are under a model: counted, claim by claim, over its draws.

A claim's chance is the share of draws that it would call true, by the rule of the ledger; half a
draw is added, so that what never happened counts as rare and not as impossible. The score of a
model is the sum of their logarithms, a *composite* likelihood: claims of one picture depend on each
other, so that differences of scores are held against invented theses, not against a table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thesis_lib.arrays import Array, Mask
from thesis_lib.facts.claims import Claim
from thesis_lib.figure_sets.misses import model as chapter
from thesis_lib.figure_sets.misses.model import Model
from thesis_lib.ledger.verdicts import margin, printed


@dataclass(frozen=True)
class Ends:
    """Least and largest errors in % over the settings of each claim, (..., claims, draws) each."""

    least: Array
    most: Array

    def of(self, draws: slice | int) -> Ends:
        """The same of some draws."""
        return Ends(self.least[..., draws], self.most[..., draws])

    def models(self, which: slice | int) -> Ends:
        """The same of some models."""
        return Ends(self.least[which], self.most[which])


def together(found: Sequence[Ends]) -> Ends:
    """Those of several models, (models, claims, draws)."""
    return Ends(np.stack([o.least for o in found]), np.stack([o.most for o in found]))


def ends(model: Model, reference: Array, measured: Array) -> Ends:
    """What the claims speak of in all draws of a model."""
    found = chapter.errors(model, reference, measured)
    spoken = [chapter.of_claim(claim, found, model.turned) for claim in chapter.claims()]
    return Ends(np.array([e.min(0) for e in spoken]), np.array([e.max(0) for e in spoken]))


def bounds(claims: Sequence[Claim]) -> tuple[Array, Array]:
    """What the ledger's rule lets claims be: the least and the largest error in %."""
    return _widened(claims, [(claim.low, claim.high) for claim in claims])


def _widened(
    claims: Sequence[Claim], stated: Sequence[tuple[ArrayLike, ArrayLike]]
) -> tuple[Array, Array]:
    """The same of claims that state other numbers, one or many, (claims, ...)."""
    low, high = (np.array(ends, float) for ends in zip(*stated, strict=True))
    wider = margin(high)
    low, high = low - wider, high + wider
    low[[claim.ends[0] is None for claim in claims]] = -np.inf
    high[[claim.ends[1] is None for claim in claims]] = np.inf
    return low, high


def met(draws: Ends, allowed: tuple[Array, Array]) -> Mask:
    """Which claims which draws call true, (..., claims, draws)."""
    low, high = (end[:, None] for end in allowed)
    return np.asarray((draws.least >= low) & (draws.most <= high))


def chances(draws: Ends, allowed: tuple[Array, Array]) -> Array:
    """Chance of each claim, (..., claims), from draws (..., claims, draws)."""
    true = met(draws, allowed)
    return np.asarray((true.sum(-1) + 0.5) / (true.shape[-1] + 1))


def score(draws: Ends, allowed: tuple[Array, Array]) -> Array:
    """Sum of the logarithms of all chances; the order of the sum decides nothing."""
    return np.round(np.log(chances(draws, allowed)).sum(-1), 9)


def invented(draws: Ends) -> tuple[Array, Array]:
    """The bounds of theses that printed draws, (claims, ...), as the real one would have."""
    every = zip(chapter.claims(), draws.least, draws.most, strict=True)
    return _widened(chapter.claims(), [printed(*one) for one in every])
