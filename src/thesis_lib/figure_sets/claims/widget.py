"""The ledger of claims as a table to filter, search and sort, with or without a kernel."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import anywidget
import traitlets

from thesis_lib.ledger.verdicts import VERDICTS
from thesis_lib.web.fragment import asset, joined, plain, static_html

__all__ = ["LedgerTable"]

_ESM = joined("ledger")
_CSS = asset("ledger.css")
WITHOUT = "This table needs JavaScript; `thesis claims` prints the same."


class LedgerTable(anywidget.AnyWidget):
    """A table of claims with their verdicts.

    The reader filters by chapter, case, mode, verdict and kind, searches and sorts. On a page
    without a kernel the filters stand in the address, as in ``claims.html?chapter=3&mode=1``, and
    ``claims.html#claim-ID`` shows and marks one claim whatever the filters.

    Parameters
    ----------
    data : dict
        ``{"rows": [row, …], "folded": n}``, JSON-serialisable, one row per claim in the order to
        show; the last n, 0 by default, are shown only if asked for. Keys of a row:

        ``id``, ``what``, ``stated``, ``got``
            A unique name; short texts such as ``"mean error at d = 500 mm"``, ``"10 %"``,
            ``"10.4 (8.1–12.9)"``.
        ``kind``, ``chapter``, ``case``, ``modes``
            ``figure``, ``trend`` or ``number``; a number; ``"4a'"``, ``"2a, 2b"`` or ``""``; a
            list of numbers.
        ``verdict``, ``ratio``, ``counted``
            One of ``verdicts.VERDICTS``; a number or None; whether the totals count
            the claim.
        ``place``, ``href``
            Where it stands, ``"figure 3.4"``, and a relative link or ``""``.
        ``step_back``
            The step against a trend that is not monotonic, or ``""``.
        ``note``, ``note_href``, ``command``
            Texts for the second line of a row, and a relative link; may be ``""``.
    """

    _esm = _ESM
    _css = _CSS
    data = traitlets.Dict().tag(sync=True)

    @traitlets.validate("data")
    def _plain(self, proposal: Mapping[str, Any]) -> Any:
        return plain(proposal["value"])

    def __repr__(self) -> str:
        rows = self.data.get("rows", [])
        found = Counter(row["verdict"] for row in rows if row["counted"])
        counts = ", ".join(f"{found[one]} {one}" for one in VERDICTS)
        return f"LedgerTable({len(rows)} claims, {found.total()} counted: {counts})"

    def _repr_mimebundle_(self, **kwargs: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        data, metadata = super()._repr_mimebundle_(**kwargs) or ({}, {})
        page = static_html(_ESM, _CSS, {"data": self.data, "page": True}, WITHOUT, prints=True)
        return {**data, "text/plain": repr(self), "text/html": page}, metadata
