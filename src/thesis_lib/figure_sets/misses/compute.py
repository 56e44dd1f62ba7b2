"""The cube of the search: what every change does to the score, and what chance would do."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.figure_sets.misses import model as chapter
from thesis_lib.figure_sets.misses import scores
from thesis_lib.figure_sets.misses.changes import Change
from thesis_lib.figure_sets.misses.model import Model
from thesis_lib.figure_sets.misses.parameters import Misses
from thesis_lib.figure_sets.misses.scores import Ends
from thesis_lib.ledger.verdicts import meets
from thesis_lib.studies.cubes import BAND
from thesis_lib.studies.variables import declared, labelled

OWN_TRIALS = 200  # of what this book takes, as in the chapter's cubes
PER_CHANGE = 20  # theses invented from each change, to see whether the search names it

VARIABLES = declared("""
    statement(statement) [1] stated value
    of_case(statement) [1] case of the thesis
    of_mode(statement) [1] mode number
    kind(statement) [1] mean or largest error
    cameras(statement) [1] fewest, most, or another parameter, where the setting has it
    stated(statement) [percent] middle of what is stated, or the bound
    median(statement) [percent] median of the trials where it is farthest off
    met(statement) [1] whether the band of the trials meets it
    chance(statement) [1] chance of the stated value under what this book takes
    best_chance(statement) [1] the same under the best of all models
    change(change) [1] what is done otherwise
    topic(change) [1] what it is about
    gain(change) [1] logarithm of the likelihood over that of what this book takes
    literal(change) [1] stated values that the literal run meets
    named(change) [1] share of theses invented by it of which the search names its topic
    pair(pair) [1] two changes
    pair_gain(pair) [1] logarithm of the likelihood over that of what this book takes
    pair_literal(pair) [1] stated values that the literal run meets
    score() [1] logarithm of the likelihood of what this book takes
    literal_adopted() [1] stated values that its literal run meets
    own_score(thesis) [1] the same of theses invented by it
    chance_gain(thesis) [1] largest gain of any change or pair, for theses invented by what this
        book takes
    best_own_score(thesis) [1] score by the best model of theses that it invents
    quantity(quantity) [1] what is found
    value(quantity) [1] its value
    unit(quantity) [1] its unit
""")


class _Search:
    """Draws of models, of which many share their images."""

    def __init__(self, asked: Misses) -> None:
        self.asked = asked
        self._simulated = lru_cache(maxsize=8)(self._simulate)  # the amplitudes of one model

    def _simulate(self, model: Model, trials: int, first: int) -> tuple[Array, Array]:
        reference, measured = chapter.simulate(model, self.asked.seed, trials, first)
        return reference, measured.astype("float32")

    def _images(self, model: Model, trials: int, first: int) -> tuple[Array, Array]:
        """Those of a model; modes know nothing of each other, so each has its amplitude's."""
        peaks = model.peaks_mm
        if isinstance(peaks, str) or len(set(peaks)) == 1:
            return self._simulated(model, trials, first)
        each = [model.changed({"peaks_mm": (peak,) * len(peaks)}) for peak in peaks]
        made = [self._simulated(one, trials, first) for one in each]
        reference = np.stack([own[mode] for mode, (own, _) in enumerate(made)])
        return reference, np.stack([own[:, :, mode] for mode, (_, own) in enumerate(made)], axis=2)

    def of_all(self, models: Sequence[Model]) -> Ends:
        """What claims speak of under some models, (models, ...)."""

        def but_for_amplitudes(number: int) -> str:
            return repr(models[number].simulated.changed({"peaks_mm": ()}))

        order = sorted(range(len(models)), key=but_for_amplitudes)
        found = {number: self.ends(models[number]) for number in order}
        return scores.together([found[number] for number in range(len(models))])

    def ends(self, model: Model) -> Ends:
        """What claims speak of, in the literal run and the trials."""
        return scores.ends(model, *self._images(model.simulated, self.asked.trials, 0))

    def theses(self, model: Model, many: int) -> list[tuple[Array, Array]]:
        """The bounds of theses that a model invents, by trials beyond those of the search."""
        after = self.asked.trials
        draws = scores.ends(model, *self._images(model.simulated, after + many, after + 1))
        low, high = scores.invented(draws)
        return list(zip(low.T, high.T, strict=True))


def run(asked: Misses) -> xr.Dataset:
    """The cube of the search.

    Returns
    -------
    xarray.Dataset
        :data:`VARIABLES`.
    """
    search, own, changes = _Search(asked), Model(), asked.changes
    pairs = [
        (one, other)
        for one, other in (combinations(changes, 2) if asked.together > 1 else ())
        if one.topic != other.topic
    ]
    single = [own.changed(change.values) for change in changes]
    models = [own, *single, *(own.changed(one.values, other.values) for one, other in pairs)]
    every = search.of_all(models)
    literal, drawn = every.of(slice(1)), every.of(slice(1, None))
    stated = scores.bounds(chapter.claims())
    reached, met = scores.score(drawn, stated), scores.met(literal, stated).sum((-2, -1))
    best = int(np.argmax(reached))
    by_own = np.array([scores.score(drawn, thesis) for thesis in search.theses(own, asked.theses)])
    by_best = search.theses(models[best], asked.theses)
    alone, pair = slice(1, 1 + len(changes)), slice(1 + len(changes), None)
    values = {
        "gain": reached[alone] - reached[0],
        "literal": met[alone],
        "named": _named(search, single, changes, drawn.models(slice(1 + len(changes)))),
        "pair_gain": reached[pair] - reached[0],
        "pair_literal": met[pair],
        "score": reached[0],
        "literal_adopted": met[0],
        "own_score": by_own[:, 0],
        "chance_gain": by_own.max(1) - by_own[:, 0],
        "best_own_score": [scores.score(drawn.models(best), thesis) for thesis in by_best],
        "chance": scores.chances(drawn.models(0), stated),
        "best_chance": scores.chances(drawn.models(best), stated),
        **_of_claims(asked.seed),
    }
    names = [change.name for change in changes]
    quantities = {
        "misses": float(np.sum(~np.array(values["met"], bool))),
        "log-likelihood": reached[0],
        "largest gain": reached[best] - reached[0],
        **{f"gain: {name}": gain for name, gain in zip(names, values["gain"], strict=True)},
    }
    values |= {"value": list(quantities.values()), "unit": ["1"] * len(quantities)}
    coords = {
        "quantity": list(quantities),
        "statement": [claim.id for claim in chapter.claims()],
        "change": names,
        "topic": [change.topic for change in changes],
        "pair": np.array([f"{one.name} + {other.name}" for one, other in pairs], str),
    }
    return xr.Dataset(labelled(values, VARIABLES), labelled(coords, VARIABLES))


def _named(
    search: _Search, models: Sequence[Model], changes: Sequence[Change], drawn: Ends
) -> list[float]:
    """How often theses that a change invents score best by its own topic; `drawn` adopts first."""
    topics = np.array(["", *(change.topic for change in changes)])
    found = []
    for model, change in zip(models, changes, strict=True):
        best = [np.argmax(scores.score(drawn, one)) for one in search.theses(model, PER_CHANGE)]
        found.append(float(np.mean(topics[best] == change.topic)))
    return found


def _of_claims(seed: int) -> dict[str, list[object]]:
    """What the claims speak of, and what this book gets, as in the ledger."""
    model = Model()
    found = chapter.errors(model, *chapter.simulate(model, seed, OWN_TRIALS))
    rows = []
    for claim in chapter.claims():
        drawn = chapter.of_claim(claim, found)[:, 1:]
        bands = np.quantile(drawn, BAND, axis=1)
        low, high = claim.ends
        off = [
            max(a - (np.inf if high is None else high), (-np.inf if low is None else low) - b)
            for a, _, b in bands.T
        ]
        rows.append(
            {
                "of_case": claim.case,
                "of_mode": claim.mode,
                "kind": "mean" if claim.quantity == "mean_error" else "largest",
                "cameras": _place(claim.id),
                "stated": np.mean([end for end in claim.ends if end is not None]),
                "median": bands[1, int(np.argmax(off))],
                "met": all(meets(claim, a, b) for a, _, b in bands.T),
            }
        )
    return {name: [row[name] for row in rows] for name in rows[0]}


def _place(name: str) -> str:
    return next((word for word in ("first", "last") if f"-{word}" in name), "all")
