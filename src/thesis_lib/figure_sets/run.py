"""The cube of a request: first what it needs, then its own; what is kept is computed once."""

from __future__ import annotations

import xarray as xr

from thesis_lib.figure_sets import keys, recorded, repeated
from thesis_lib.figure_sets.figure_set import Product
from thesis_lib.figure_sets.registry import FIGURE_SETS
from thesis_lib.studies import effort
from thesis_lib.studies.attributes import with_provenance
from thesis_lib.studies.blocks import Outline
from thesis_lib.studies.cache import cached
from thesis_lib.studies.request import Study


def cube_of(asked: Study, scheduler: str = "") -> xr.Dataset:
    """The cube of a figure set.

    Parameters
    ----------
    asked : Study
        A validated request.
    scheduler : str
        Workers that compute what can be cut into pieces
        (:func:`thesis_lib.studies.schedulers.checked`); empty computes here.
    """
    return made(FIGURE_SETS[asked.name], asked, scheduler)


def made(product: Product, asked: Study, scheduler: str = "") -> xr.Dataset:
    """A product for a request, with its provenance."""

    def compute(_: object = None) -> xr.Dataset | Outline:
        needs = product.needs(asked)
        inputs = {role: made(*needed, scheduler) for role, needed in needs.items()}
        return product.compute(asked, inputs, scheduler)

    if product.recorded:
        return recorded.measured(recorded.recordings_of(product, asked))
    if product.repeated:
        return repeated.deflections(product, asked)
    library = keys.library(product, asked)
    if product.kept:
        return cached(asked, compute, keys.key(product, asked), library)
    seconds = effort.stopwatch()
    result = compute()
    if isinstance(result, Outline):
        if not result.is_held:
            return cached(asked, lambda _: result, keys.key(product, asked), library)
        result = result.in_memory()
    return with_provenance(result, asked, seconds(), library)
