"""Pictures of the search: what is missed, and what each change gains."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.plotting.style import COLORS, REFERENCE, subplots


def missed(cube: xr.Dataset) -> Figure:
    """Median over stated error of every stated value, mean and largest, met and missed."""
    drawing, both = subplots(1, 2, figsize=(7.6, 3.4), layout="constrained", sharey=True)
    quantities = {"mean": "mean errors", "largest": "largest errors"}
    met = cube["met"].values.astype(bool)
    for axes, (quantity, words) in zip(both, quantities.items(), strict=True):
        here = cube["kind"].values == quantity
        for inside, color, shape, name in (
            (met, COLORS[0], "o", "met"),
            (~met, COLORS[4], "^", "missed"),
        ):
            part = cube.isel(statement=np.flatnonzero(here & inside))
            axes.plot(
                part["stated"],
                part["median"] / part["stated"],
                shape,
                color=color,
                markersize=4,
                label=f"{name} ({part.sizes['statement']})",
            )
        axes.axhline(1, color=REFERENCE, linewidth=1)
        axes.set(xscale="log", yscale="log", title=words, xlabel="stated, %")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.legend(loc="upper right")
    both[0].set_ylabel("median here over stated")
    both[0].set_yticks([0.25, 0.5, 1, 2, 3], ["0.25", "0.5", "1", "2", "3"])
    both[0].minorticks_off()
    return drawing


def gains(cube: xr.Dataset) -> Figure:
    """Gains of all changes by topic, and what theses of this book gain by chance."""
    topics = list(dict.fromkeys(cube["topic"].values.tolist()))
    drawing, axes = subplots(figsize=(7.6, 0.8 + 0.24 * len(topics)), layout="constrained")
    place = {topic: len(topics) - 1 - i for i, topic in enumerate(topics)}
    chance = cube["chance_gain"].values
    low, high = np.quantile(chance, [0.05, 0.95])
    axes.axvspan(low, high, color=REFERENCE, alpha=0.25, label="best of all, by chance (5–95 %)")
    axes.axvline(0, color=REFERENCE, linewidth=1)
    rows = [place[topic] for topic in cube["topic"].values]
    axes.plot(cube["gain"], rows, "o", color=COLORS[0], markersize=4, label="one change")
    if cube.sizes["pair"]:
        best = float(cube["pair_gain"].max())
        axes.axvline(best, color=COLORS[4], linestyle="--", label="the best pair of changes")
    needed = float(cube["own_score"].mean() - cube["score"])
    axes.axvline(needed, color="#222222", linestyle=":", label="what would be expected")
    axes.set_yticks(list(place.values()), list(place))
    axes.set(xlabel="gain in log-likelihood")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)
    return drawing
