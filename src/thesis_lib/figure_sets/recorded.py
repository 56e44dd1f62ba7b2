"""Recordings of the laboratory: rendered and measured once, and from then on data.

To film chapter 5 and to follow all markers takes a quarter of an hour. What was measured, image
coordinates to :data:`STEP`, is in ``data/recordings``, beside each file the digests of itself and
of what it was made from: its request, and the code. A file that is damaged, or that other code has
made, is named, and its recordings are filmed anew; so are those of another request, whose files
``build/cache`` keeps. ``thesis record`` makes all of them anew.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib import records
from thesis_lib.asides import aside
from thesis_lib.figure_sets import keys
from thesis_lib.figure_sets.figure_set import Product
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES
from thesis_lib.files import shipped
from thesis_lib.studies import effort
from thesis_lib.studies.attributes import with_provenance
from thesis_lib.studies.cache import cached
from thesis_lib.studies.request import Study
from thesis_lib.studies.storage import opened, write

ASKING = ("studies", "thesis_lib")
"""Folders of modules that declare and refuse requests, which count by their values alone."""
STEP = 1e-4
"""Image coordinates are kept to this, in px: a hundredth of what noise does to them."""


@dataclass(frozen=True)
class Recordings:
    """Some recordings, and how they are made."""

    request: Study  #: What is filmed
    film: Callable[[Any], Any]  #: Films it and measures: request to dataset
    sources: list[Path]  #: What the result depends on besides the request

    @property
    def path(self) -> Path:
        """Where what was measured is data."""
        return folder() / f"{self.request.name}.nc"

    @property
    def made_from(self) -> str:
        """Digests of the request and of the code, in which comments do not count."""
        return f"{self.request.digest} {keys.digest(self.sources)}"

    def kept(self) -> xr.Dataset | None:
        """The data, if they are of this request and code."""
        otherwise = "rendered anew, which takes minutes"
        return trusted(self.path, self.request, self.made_from, otherwise)


def folder() -> Path:
    """Where all of the data are."""
    return shipped() / "data" / "recordings"


def recordings_of(product: Product, request: Study) -> Recordings:
    """The recordings of a request."""
    return Recordings(request, partial(product.compute, inputs={}), sources_of(product))


def sources_of(product: Product) -> list[Path]:
    """What recordings depend on besides their request: code and facts."""
    files = [file for file in keys.code_of(product.module) if file.parent.name not in ASKING]
    return [*files, *keys.facts_of(files)]


def behind(request: Study) -> list[Recordings]:
    """The recordings that a figure set is computed from, whatever its parameters."""
    needs = FIGURE_SETS[request.name].needs(request).values()
    return [recordings_of(product, asked) for product, asked in needs if product.recorded]


def every() -> list[Recordings]:
    """All recordings that there are data of."""
    found = {one.request.name: one for study in STUDIES.values() for one in behind(study())}
    return list(found.values())


def measured(of: Recordings) -> xr.Dataset:
    """What was measured on recordings: from the data, the cache, or rendered now."""
    data = of.kept()
    return cached(of.request, partial(_filmed, of.film), of.made_from) if data is None else data


def record(of: Recordings) -> Path:
    """Render recordings now and make what is measured on them the data."""
    seconds = effort.stopwatch()
    made = _filmed(of.film, of.request)
    made = with_provenance(made, of.request, seconds())
    write(made, of.path, compact=True, steps=dict.fromkeys(_coordinates(made), STEP))
    records.write(of.path.with_suffix(".json"), of.made_from, [of.path])
    return of.path


def _filmed(film: Callable[[Any], Any], request: Study) -> xr.Dataset:
    """What is measured, with coordinates as they will be read from the data."""
    data = film(request)
    return data.assign(
        {
            name: data[name].copy(data=np.rint(data[name].values.astype(float) / STEP) * STEP)
            for name in _coordinates(data)
        }
    )


def _coordinates(data: xr.Dataset) -> list[str]:
    """Variables that hold image coordinates of every frame."""
    pixels = data.filter_by_attrs(units="px").data_vars
    return [str(name) for name, values in pixels.items() if "frame" in values.dims]


def trusted(path: Path, request: Study, made_from: str, otherwise: str) -> xr.Dataset | None:
    """The data in a file, if they are of this request and code.

    What is wrong with those of the request is said, and what becomes of them `otherwise`.
    """
    beside = path.with_suffix(".json")
    record = records.read(beside)
    if record is None or not record.made_from.startswith(request.digest):
        return None
    problem = records.damage(beside, [path])
    if not problem and record.made_from != made_from:
        problem = f"{path} was measured by other code"
    if problem:
        aside(f"{problem}; it is {otherwise}")
        return None
    return opened(path)
