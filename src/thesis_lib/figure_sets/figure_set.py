"""What a figure set is: a request, what it is computed from, its cube, figures and page.

Each folder beside this file holds one figure set, or a family of them, and tells in its module
``figure_set`` what they are: a list ``FIGURE_SETS``. What takes long to import is named there by
its module, and imported when it is used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

from thesis_lib.studies.request import Study

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from thesis_lib.studies.blocks import Outline

Inputs = Mapping[str, "tuple[Product, Any]"]


def _nothing(_: Any) -> Inputs:
    return {}


@dataclass(frozen=True, kw_only=True)
class Product:
    """Something that is computed once for a request."""

    #: The module that computes it: ``run(request, **inputs)`` gives a dataset or, of what is cut
    #: into pieces, ``outline(request, **inputs, scheduler=...)`` a cube to be filled in
    module: str
    # What it is computed from: the request to a product and its request, by parameter of ``run``
    needs: Callable[[Any], Inputs] = field(default=_nothing)
    # The requests whose cubes it is made from, as they stand in the book, after all of these
    reads: Callable[[], Sequence[Study]] = field(default=tuple)
    #: Whether ``build/cache`` keeps it, for what takes long or serves others, too
    kept: bool = False
    #: Whether it is filmed, and kept as data (:mod:`thesis_lib.figure_sets.recorded`)
    recorded: bool = False
    #: Whether it is rendered again and again, and what comes out kept as data
    #: (:mod:`thesis_lib.figure_sets.repeated`)
    repeated: bool = False
    in_pieces: bool = False  #: Whether workers can compute it together, piece by piece

    def compute(
        self, asked: Study, inputs: Mapping[str, xr.Dataset], scheduler: str = ""
    ) -> xr.Dataset | Outline:
        """The result for a request, from what it needs."""
        module = import_module(self.module)
        if self.in_pieces:
            outline: Outline = module.outline(asked, **inputs, scheduler=scheduler)
            return outline
        cube: xr.Dataset = module.run(asked, **inputs)
        return cube


@dataclass(frozen=True, kw_only=True)
class FigureSet(Product):
    """A product with a notebook and a page."""

    request: type[Study]  #: Its parameters, whose name is its name
    #: Where it belongs: a key of :data:`thesis_lib.figure_sets.registry.TITLES`, or empty
    chapter: str
    #: ``module:function`` that draws one case and mode of its cube, if it has cases
    figure: str = ""
    others: Product | None = None  #: Other recordings of what it is made from, if it is rendered

    def draw(self, cube: xr.Dataset, case: str, mode: int) -> Figure:
        """The figure of one case and mode of a cube."""
        module, function = self.figure.split(":")
        drawing: Figure = getattr(import_module(module), function)(cube, case, mode)
        return drawing


def filmed(package: str, **how: Any) -> FigureSet:
    """A figure set that is computed from recordings; `how` is the rest of :class:`FigureSet`.

    The module ``recordings`` of its package renders what the request's own ``recordings`` asks for,
    and ``compute`` takes that as `data`; its module ``others``, where requests say
    how many ``repeats`` they want, renders the same again, and ``compute`` takes what comes out,
    if there is any, as `others`.
    """
    recordings = Product(module=f"{package}.recordings", recorded=True)
    others = None
    if "repeats" in how["request"].model_fields:
        others = Product(module=f"{package}.others", repeated=True)

    def needs(asked: Any) -> Inputs:
        from thesis_lib.figure_sets import repeated

        if others is None:
            return {"data": (recordings, asked.recordings)}
        again = repeated.asked_for(others, asked)
        return {"data": (recordings, asked.recordings)} | (
            {"others": (others, again)} if again.trials else {}
        )

    return FigureSet(module=f"{package}.compute", needs=needs, others=others, **how)
