"""What the page of the search shows, from its cube."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from IPython.display import Markdown
from scipy.stats import binomtest, fisher_exact

from thesis_lib.web.markdown import markdown_table

SHOWN = 10  # of pairs
RARE = 0.05
CLOSE = 10  # in log-likelihood
SMALL = 5  # %


def _groups(cube: xr.Dataset) -> Iterator[tuple[str, np.ndarray]]:
    """Sets of claims that may have something in common, with their names."""
    words = {"mean": "mean errors", "largest": "errors of one marker, the largest"}
    for name in ("mean", "largest"):
        yield words[name], cube["kind"].values == name
    many = np.char.startswith(cube["of_case"].values.astype(str), "4")
    last = cube["cameras"].values == "last"
    yield "with all cameras of a case", many & last
    yield "with the first two cameras of a case", many & (cube["cameras"].values == "first")
    yield "of pairs", ~many
    yield f"stated as {SMALL} % or less", cube["stated"].values <= SMALL
    for mode in np.unique(cube["of_mode"]):
        yield f"mode {mode}", cube["of_mode"].values == mode
    for case in dict.fromkeys(cube["of_case"].values.tolist()):
        yield f"case {case}", cube["of_case"].values == case


def common(cube: xr.Dataset) -> Markdown:
    """Misses by what stated values have in common, corrected for the number of groups."""
    missed = ~cube["met"].values.astype(bool)
    less = cube["stated"].values < cube["median"].values
    groups = list(_groups(cube))
    rows, chances = [], []
    for name, inside in groups:
        here, other = missed[inside], missed[~inside]
        counts = [[here.sum(), (~here).sum()], [other.sum(), (~other).sum()]]
        chances.append(fisher_exact(counts).pvalue)
        rows.append(
            [
                name,
                f"{here.sum()} of {here.size}",
                f"{here.mean():.0%}",
                f"{other.mean():.0%}",
                str(int((less & missed & inside).sum())),
            ]
        )
    for row, chance in zip(rows, _holm(np.array(chances)), strict=True):
        row.append(f"{chance:.2g}")
    note = (
        "*Less*: misses of which the thesis states less than the median here. *p*: how likely so "
        "unlike shares are by chance (Fisher's exact test), times the number of groups that are "
        "left (Holm's correction)."
    )
    header = ["stated values", "missed", "share", "of all others", "less", "p"]
    return markdown_table(header, rows, note)


def _holm(chances: np.ndarray) -> np.ndarray:
    """Chances corrected for how many there are, in their order."""
    order = np.argsort(chances)
    times = len(chances) - np.arange(len(chances))
    corrected = np.empty(len(chances))
    corrected[order] = np.minimum(1, np.maximum.accumulate(chances[order] * times))
    return corrected


def _shares(cube: xr.Dataset) -> np.ndarray:
    """Largest over mean error of the same setting, stated and here: (2, settings)."""
    of: dict[tuple[str, ...], dict[str, tuple[float, float]]] = {}
    columns = ("of_case", "of_mode", "cameras", "kind", "stated", "median", "statement")
    for row in zip(*(cube[name].values.tolist() for name in columns), strict=True):
        case, mode, cameras, quantity, stated, median, name = row
        if cameras != "all" and "singlepoint" not in name:
            of.setdefault((case, str(mode), cameras), {})[quantity] = (stated, median)
    both = [one for one in of.values() if len(one) == 2]
    return np.array([np.divide(one["largest"], one["mean"]) for one in both]).T


def largest_over_mean(cube: xr.Dataset) -> Markdown:
    """How much larger the largest error is than the mean, in a sentence."""
    stated, here = _shares(cube)
    lower = int((stated < here).sum())
    chance = binomtest(lower, len(stated)).pvalue
    return Markdown(
        f"In the thesis the largest error of the {len(stated)} settings with both is "
        f"{np.median(stated):.1f} times the mean one (median); here it is {np.median(here):.1f} "
        f"times. In {lower} of {len(stated)} the thesis's ratio is the smaller one; were either as "
        f"likely, so uneven a split would have a chance of {chance:.1g}."
    )


def singles(cube: xr.Dataset) -> Markdown:
    """Every change alone, the best first."""
    order = np.argsort(-cube["gain"].values, kind="stable")
    rows = [
        [
            str(cube["topic"].values[i]),
            str(cube["change"].values[i]),
            f"{round(cube['gain'].values[i]):+d}",
            f"{cube['literal'].values[i]}",
            f"{cube['named'].values[i]:.0%}",
        ]
        for i in order
    ]
    note = (
        "*Gain*: change of the log-likelihood. *Literal*: stated values, of "
        f"{cube.sizes['statement']}, that the run without shifts of the grid meets; as adopted "
        f"{int(cube['literal_adopted'])}. *Named*: of theses that were invented with this change, "
        "the share of which the search names its topic."
    )
    return markdown_table(["topic", "change", "gain", "literal", "named"], rows, note)


def doubles(cube: xr.Dataset) -> Markdown:
    """The best pairs of changes."""
    order = np.argsort(-cube["pair_gain"].values, kind="stable")[:SHOWN]
    rows = [
        [
            str(cube["pair"].values[i]),
            f"{round(cube['pair_gain'].values[i]):+d}",
            f"{cube['pair_literal'].values[i]}",
        ]
        for i in order
    ]
    note = f"The best {len(rows)} of {cube.sizes['pair']} pairs of changes of different topics."
    return markdown_table(["pair", "gain", "literal"], rows, note)


def _chance(found: np.ndarray, at_least: float) -> str:
    """How often invented theses do as much, in words; never 0, since they are counted."""
    count = int((found >= at_least).sum())
    n = found.size
    return f"{count} of {n}" if count else f"none of {n}"


def verdict(cube: xr.Dataset) -> Markdown:
    """What the search found, in sentences."""
    alone = cube["gain"].values
    names = [*cube["change"].values.tolist(), *cube["pair"].values.tolist()]
    gains = np.concatenate([alone, cube["pair_gain"].values])
    literal = np.concatenate([cube["literal"].values, cube["pair_literal"].values])
    best, score = int(np.argmax(gains)), float(cube["score"])
    own, best_own = cube["own_score"].values, cube["best_own_score"].values
    by_chance = cube["chance_gain"].values
    rare = float(np.quantile(by_chance, 1 - RARE))
    beyond = "Beyond chance" if gains[best] > rare else "Not beyond chance"
    enough = np.mean(best_own <= score + gains[best]) >= RARE
    clear = [str(cube["change"].values[i]) for i in np.argsort(-alone) if alone[i] > rare]
    lines = [
        f"**What this book takes** has a log-likelihood of {score:.0f}. Theses invented by it have "
        f"{own.mean():.0f} ± {own.std():.0f} (standard deviation), and {_chance(-own, -score)} "
        "so little.",
        f"**The best of {len(names)} models** is *{names[best]}*: it gains {gains[best]:.0f}. "
        f"{int((gains > gains[best] - CLOSE).sum()) - 1} others come within {CLOSE} of it.",
        f"**{beyond}**: of theses invented by this book the best of as many models gains "
        f"{np.median(by_chance):.0f} in the middle and {by_chance.max():.0f} at most, and "
        f"{_chance(by_chance, gains[best])} so much. Changes that alone gain more than nineteen in "
        f"twenty such searches find: {', '.join(f'*{name}*' for name in clear) or 'none'}.",
        f"**{'It would be enough' if enough else 'It is not enough'}**: the best model has "
        f"{score + gains[best]:.0f}, where theses invented by it have {best_own.mean():.0f} ± "
        f"{best_own.std():.0f}, and {_chance(-best_own, -(score + gains[best]))} so little.",
        "**No literal run fits.** Had the thesis computed one of these models, with the pixels "
        f"where this book has them, the literal run would meet all {cube.sizes['statement']} "
        f"stated values. The most that any meets is {literal.max()}.",
    ]
    return Markdown("\n".join(f"* {line}" for line in lines))
