"""The interactive viewer of a parametric study, with or without a kernel.

`Viewer` is an anywidget for live notebooks. Beside its widget view it offers `static_html`, which
carries the same JavaScript and the data, and so runs in a page without a server or a network.
"""

import hashlib
import html
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import anywidget
import traitlets

__all__ = ["VIEWER_CSS", "Viewer", "joined", "static_html"]

_ASSETS = Path(__file__).parent / "assets"
VIEWER_CSS = (_ASSETS / "viewer.css").read_text(encoding="utf-8")
_KINDS = ("beam", "plate", "sound")
_IMPORT = re.compile(r'^import (?:\{[^}]*\} from )?"\./(\w+)\.js";\n', re.MULTILINE)

WITHOUT = "This viewer needs JavaScript; the figures below show the same results."
_FRAGMENT = """\
<div class="tl-fragment" data-tl-fragment="%(id)s"%(prints)s>
<noscript>%(without)s</noscript>
</div>
<style>%(css)s</style>
<script type="module">
%(esm)s
const state = %(state)s;
function createModel(values = { ...state }, handlers = {}) {
  const of = (event) => (handlers[event] ??= new Set());
  return {
    get: (name) => values[name],
    set(name, value) {
      if (values[name] === value) return;
      values[name] = value;
      [...of(`change:${name}`)].forEach((handler) => handler());
    },
    on: (event, handler) => of(event).add(handler),
    off: (event, handler) => (handler ? of(event).delete(handler) : of(event).clear()),
    save_changes() {}, send() {},
  };
}
for (const el of document.querySelectorAll('[data-tl-fragment="%(id)s"]:not([data-mounted])')) {
  el.dataset.mounted = "";
  widget.render({ model: createModel(), el });
}
</script>
"""


def joined(front: str, *kinds: str) -> str:
    """Write a front end and what it imports as one module, without the panels of other kinds."""
    modules = {kind: "" for kind in _KINDS if kind not in kinds}

    def add(name: str) -> None:
        if name in modules:
            return
        modules[name] = ""  # a part stands behind those it needs, also if they need each other
        text = (_ASSETS / f"{name}.js").read_text(encoding="utf-8")
        for needed in _IMPORT.findall(text):
            add(needed)
        del modules[name]
        modules[name] = re.sub(r"^export (?!default )", "", _IMPORT.sub("", text), flags=re.M)

    add(front)
    return "".join(modules.values())


_ESM = joined("viewer", *_KINDS)


def plain(value: object) -> Any:
    """Copy JSON data: floats to 6 significant digits, NaN and infinities to None."""
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


def static_html(
    esm: str,
    css: str,
    state: Mapping[str, object],
    without: str = WITHOUT,
    prints: bool = False,
) -> str:
    """Write a widget as a self-contained HTML fragment that needs no kernel, server or network.

    Parameters
    ----------
    esm, css : str
        The front end, an ES module whose one ``export default`` has `render`, and its styles.
    state : Mapping[str, object]
        The traits it reads. Floats are written with 6 digits, NaN and infinities as null.
    without : str
        What is said where there is no JavaScript.
    prints : bool
        Whether it is worth printing as it first stands; else the printed book has a line instead.

    Returns
    -------
    str
        A function of the arguments alone; it may stand on a page more than once.

    Raises
    ------
    ValueError
        If `esm` has not one ``export default``, or if `esm` or `css` would end its element.
    TypeError
        If `state` is not JSON-serialisable.
    """
    body, exports = re.subn(r"^export default ", "const widget = ", esm, flags=re.MULTILINE)
    if exports != 1:
        raise ValueError(f"esm: {exports} lines start with 'export default', 1 expected")
    if re.search(r"</?script|<!--", esm, re.I) or re.search(r"</style", css, re.I):
        raise ValueError("esm or css: holds a tag or comment that would break out of its element")
    text = json.dumps(plain(state), allow_nan=False, separators=(",", ":"))  # ASCII only
    text = re.sub("[<>&]", lambda match: f"\\u{ord(match[0]):04x}", text)  # no tag can begin or end
    key = hashlib.sha256("\0".join((esm, css, text)).encode()).hexdigest()[:16]
    parts = {"id": key, "css": css.strip(), "esm": body.strip(), "state": text}
    printed = " data-tl-print" if prints else ""
    return _FRAGMENT % {**parts, "without": html.escape(without), "prints": printed}


class Viewer(anywidget.AnyWidget):
    """Linked panels for one study: the cameras, what they measured, and the error of each setting.

    The reader chooses the case and the mode, sees the best and the worst setting, and highlights
    any setting by pointing at its bar. A beam shows curves, a plate maps of its markers, a sound
    study the pressure on two planes at any instant of the period. Where no kernel runs, the view of
    `static_html` is shown.

    Parameters
    ----------
    data : dict
        The study, JSON-serialisable; a number that does not exist is None or NaN. Keys:

        ``structure``
            ``{"kind": "beam", "length_mm": 623, "width_mm": 30}``, clamped at −X; the kind may also
            be ``plate`` or ``sound`` (of a plate), which differ as said below. A plate that is no
            rectangle has ``contours_mm``, closed curves [[X, Y], …] about the box's centre: the
            outline, then holes the other way round.
        ``parameter``
            The varied one: ``{"name": "aperture_deg", "label": "aperture", "unit": "°"}``. A name
            that begins with aperture, distance or width is drawn into the camera sketch.
        ``words``
            What the key says: ``{"draws": what differs from trial to trial, "predicts": what
            ``predicted`` stands for}``.
        ``x_mm``, ``colors``
            Lists: marker positions from the clamp; a hexadecimal colour per setting of a case.
        ``modes``
            List of ``{"mode": 1, "frequency_hz": 6.31, "reference_mm": [one per marker]}``.
        ``cases``
            List of ``{"name": "2a", "title": str, "figures": {"1": "3.7"}, "settings": […]}``;
            ``figures`` maps a mode to the figure of the thesis. A setting is ``{"label": "16°",
            "value": 16, "cameras": [[distance_mm, azimuth_deg, elevation_deg]], "resolution":
            [320, 180], "in_view": share of marker images on the sensor, "modes": [one per mode]}``,
            and each of its modes ``{"measured_mm": [one per marker], "point_error": [one per
            marker], "mean", "median", "low", "high", "predicted", "stated": None | [low, high]}``:
            errors in percent of the largest reference deflection, ``mean`` of trial 0, ``low`` and
            ``high`` the 5 and 95 % quantiles; an end of ``stated`` is None where it is open.

        Only a plate has ``grid``, ``[15, 10]`` markers along X and Y; its ``x_mm`` and ``y_mm`` are
        the coordinates of the columns and rows from the plate's corner, and a list with one entry
        per marker runs along X first. ``point_error`` may be missing. Plate and sound have
        ``colormap``, hexadecimal colours from −max to max, the middle one for 0.

        A sound study has no ``x_mm``, ``reference_mm``, ``measured_mm`` and ``point_error``, but:

        ``planes``
            List of ``{"name": "XZ" | "YZ", "u_mm": [min, max], "z_mm": [min, max], "shape": [nu,
            nz]}``; u is X or Y from the plate's centre, the outermost points lie at min and max.
        ``pressure_unit``, ``nodal_note``
            The unit for the colour bar; the words for a plane without reference pressure.
        ``modes[…]["fields"]``
            The ideal field, ``{"XZ": F, "YZ": F}``, where F is ``{"scale": Pa per 127, "re":
            base64 of int8, "im": …}`` with the index ``iu * nz + iz``; drawn is Re(p e^{jωt}).
        ``cases[…]["extremes"]``
            ``{"1": {"best": {"index": i, "fields": {"XZ": F, "YZ": F}}, "worst": …}}``, by mode:
            the settings with the least and the largest mean error of the deflection.
        ``cases[…]["settings"][…]["modes"][…]``
            ``{"planes": {"XZ": E, "YZ": E}, "deflection": {"mean": 3.1}}``, where E has ``mean`` to
            ``stated`` as above, or is None on a nodal plane.
    case : str, optional
    mode : int, optional
        What to show first; the first case or mode of the data if unknown.
    """

    _esm = _ESM
    _css = VIEWER_CSS
    data = traitlets.Dict().tag(sync=True)
    case = traitlets.Unicode().tag(sync=True)
    mode = traitlets.Int(1).tag(sync=True)

    @traitlets.validate("data")
    def _plain_data(self, proposal: Mapping[str, Any]) -> Any:
        return plain(proposal["value"])

    def __repr__(self) -> str:
        cases = ", ".join(str(one["name"]) for one in self.data.get("cases", [])) or "none"
        label, case = self.data.get("parameter", {}).get("label"), self.case or "first"
        return f"Viewer(varied: {label}; cases: {cases}; shown: {case}, mode {self.mode})"

    def _repr_mimebundle_(self, **kwargs: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        data, metadata = super()._repr_mimebundle_(**kwargs) or ({}, {})
        kind = self.data.get("structure", {}).get("kind")
        esm = joined("viewer", kind) if kind in _KINDS else _ESM
        page = static_html(
            esm, VIEWER_CSS, {"data": self.data, "case": self.case, "mode": self.mode}
        )
        return {**data, "text/plain": repr(self), "text/html": page}, metadata
