"""Other recordings of every setting: of each only the deflections that were fitted are data.

A figure set of rendered vibrations begins with the tracks of one recording
(:mod:`thesis_lib.figure_sets.recorded`). How much its result depends on that one, others tell:
cameras put up again, other starts, other noise, rendered and measured in the same way. Of these
``data/recordings`` keeps the deflections of every setting, with their standard deviations, in
``NAME-others.nc``, to :data:`STEP`, beside it the digests of the file and of what it was made
from. A file is written anew after each recording, so that rendering goes on where it was stopped.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib import records
from thesis_lib.asides import aside
from thesis_lib.figure_sets import keys, recorded
from thesis_lib.figure_sets.figure_set import Product
from thesis_lib.figure_sets.registry import FIGURE_SETS, STUDIES
from thesis_lib.files import workplace
from thesis_lib.studies.attributes import with_origin
from thesis_lib.studies.request import Study
from thesis_lib.studies.storage import write

FEW = 8
"""Others that say how an error scatters at least; of fewer, a figure set draws trials instead."""
STEP = 1e-9
"""Deflections are kept to this, in m: a hundredth of the errors of the best of them."""


@dataclass(frozen=True)
class Others:
    """The other recordings of a request, and where they are kept."""

    product: Product  #: Its module has ``film(request, number)``
    request: Study  #: What is rendered, without trials
    folder: Path

    @property
    def path(self) -> Path:
        """Where they are kept."""
        return self.folder / f"{self.request.name}-others.nc"

    @property
    def made_from(self) -> str:
        """Digests of the request and of the code, in which comments do not count."""
        return f"{self.request.digest} {keys.digest(recorded.sources_of(self.product))}"

    def kept(self) -> xr.Dataset | None:
        """What there is of this request and code; of other code, or damaged, it is told."""
        otherwise = "left out until `thesis record` has rendered it anew"
        return recorded.trusted(self.path, self.request, self.made_from, otherwise)

    @property
    def count(self) -> int:
        """How many are kept."""
        data = self.kept()
        return 0 if data is None else data.sizes["recording"]

    def made(self, number: int) -> xr.Dataset:
        """Render recording `number` now, see ``film`` of the product."""
        made: xr.Dataset = import_module(self.product.module).film(self.request, number)
        rounded = {name: np.rint(each.values / STEP) * STEP for name, each in made.items()}
        return made.assign({name: made[name].copy(data=each) for name, each in rounded.items()})

    def film(self) -> None:
        """Render one more, and keep it with those before."""
        before, number = self.kept(), self.count + 1
        words = {"long_name": "recording, 0 for the one in full", "units": "1"}
        every = self.made(number).expand_dims(recording=[number])
        every["recording"].attrs = words
        if before is not None:
            every = xr.concat([before.load(), every], "recording")
        every = with_origin(every, f"other recordings for {self.request.name}")
        write(every, self.path, compact=True, steps=dict.fromkeys(map(str, every.data_vars), STEP))
        records.write(self.path.with_suffix(".json"), self.made_from, [self.path])

    def forget(self) -> None:
        """Begin anew."""
        self.path.with_suffix(".json").unlink(missing_ok=True)


def data_of(product: Product, request: Study) -> Others:
    """Those that are data."""
    return Others(product, request, recorded.folder())


def asked_for(product: Product, asked: Any) -> Study:
    """The request for as many others as a figure set is to have: that many trials.

    Of what is kept all are taken, if they are not too :data:`FEW`.
    """
    request: Study = getattr(asked, "others", asked.recordings)
    if asked.repeats == "kept":
        many = data_of(product, request).count
        many = many if many >= FEW else 0
    else:
        many = asked.repeats - 1
    return request.model_copy(update={"trials": min(many, asked.trials)})


def deflections(product: Product, asked: Study) -> xr.Dataset:
    """As many other recordings as the trials of a request, from the data or rendered now."""
    request = asked.model_copy(update={"trials": 0})
    others = data_of(product, request)
    if others.count < asked.trials:
        others = Others(product, request, workplace() / "build" / "cache")
    while others.count < asked.trials:
        aside(f"{request.name}: recording {others.count + 2} of {asked.trials + 1} is rendered")
        others.film()
    data = others.kept()
    assert data is not None
    return data.isel(recording=slice(asked.trials))


def every() -> list[Others]:
    """Those of all figure sets, each once."""
    found: dict[str, Others] = {}
    for name, study in STUDIES.items():
        if product := FIGURE_SETS[name].others:
            request = asked_for(product, study(trials=0))
            found[request.name] = data_of(product, request)
    return list(found.values())
