"""Viewer of results, as a widget."""

from collections.abc import Mapping
from typing import Any

import anywidget
import traitlets

from thesis_lib.web import html

FORM_CSS = html.VIEWER_CSS + html.read_asset("rerun.css")


class Viewer(anywidget.AnyWidget):
    """Linked panels for one study: the cameras, their measurements, and the error of each setting.

    The reader chooses the case and the mode, sees the best and the worst setting, and highlights
    any setting by pointing at its bar. A beam shows curves, a plate maps of its markers, a sound
    study the pressure on two planes at any instant of the period. Where no kernel runs, the view of
    `static_html` is shown.

    Parameters
    ----------
    data : dict
        The study, JSON-serialisable; a number that does not exist is None or NaN. Keys:

        ``structure``
            ``{"kind": "beam", "plate" or "sound" (of a plate), "length_mm": 623, "width_mm": 30}``,
            clamped at −X. A plate that is no rectangle has ``contours_mm``, closed curves [[X, Y],
            …] about the box's centre: the outline, then holes the other way round.
        ``parameter``
            The varied parameter: ``{"name": "aperture_deg", "label": "aperture", "unit": "°"}``. A
            name that begins with aperture is drawn into the camera sketch.
        ``words``
            ``{"draws": what differs from trial to trial, "predicts": what ``predicted`` means}``.
        ``x_mm``, ``colors``
            Lists: marker positions from the clamp; a hexadecimal colour per setting of a case.
        ``modes``
            List of ``{"mode": 1, "frequency_hz": 6.31, "reference_mm": [one per marker]}``.
        ``cases``
            List of ``{"name": "2a", "title": str, "figures": {"1": figure of the thesis, by mode},
            "settings": […]}``. A setting is ``{"label": "16°", "value": 16, "cameras":
            [[distance_mm, azimuth_deg, elevation_deg]], "resolution": [320, 180], "in_view": share
            of marker images on the sensor, "modes": [one per mode]}``, and each of its modes
            ``{"measured_mm": [one per marker], "point_error": [one per marker], "mean", "median",
            "low", "high", "predicted", "stated": None | [low, high]}``: errors in percent of the
            largest reference deflection, ``mean`` of the nominal run, ``low`` and ``high`` the 5
            and 95 % quantiles; an end of ``stated`` is None where it is open.

        Only a plate has ``grid``, ``[15, 10]`` markers along X and Y; its ``x_mm`` and ``y_mm`` are
        the coordinates of the columns and rows from the plate's corner, and a list with one entry
        per marker runs along X first. ``point_error`` may be missing. Plate and sound have
        ``colormap``, hexadecimal colours from −max to max, the middle one for 0.

        A sound study has no ``x_mm``, ``reference_mm``, ``measured_mm`` and ``point_error``, but
        ``planes``, a list of ``{"name": "XZ" | "YZ", "u_mm": [min, max], "z_mm": [min, max],
        "shape": [nu, nz]}``, where u is X or Y from the plate's centre; ``pressure_unit``; and
        ``nodal_note``, the words for a plane without reference pressure. Its modes have ``fields``,
        ideal ones by plane: ``{"scale": Pa per 127, "re": base64 of int8, "im": …}`` with the index
        ``iu * nz + iz``; Re(p e^{jωt}) is drawn. Its cases have ``extremes``, by mode ``{"best":
        {"index": i, "fields": …}, "worst": …}``, the settings with the least and the largest error
        of the deflection, and the errors of their fields; modes of its settings have ``planes``,
        ``mean`` to ``stated`` by plane or None on a nodal one, and ``deflection``.

        Only a study whose cameras have ideal lenses and whole pixels has ``lens``,
        ``{"focal_length_mm", "sensor_width_mm", "principal_offset_px"}``; next to the cameras the
        viewer then shows the image of one of them.
    case : str, optional
    mode : int, optional
        The initial case and mode; the first ones of the data if unknown. In a page, its URL takes
        precedence, ``?case=2a&mode=3&compare=all&setting=2``, and follows the selection.
    form : dict, optional
        Where no kernel runs, the form above the viewer to change parameters and compute again, by
        :func:`thesis_lib.notebook.show.form_of`.
    """

    _esm = html.join_modules("viewer", *html.VIEWER_KINDS)
    _css = html.VIEWER_CSS
    data = traitlets.Dict().tag(sync=True)
    case = traitlets.Unicode().tag(sync=True)
    mode = traitlets.Int(1).tag(sync=True)
    form = traitlets.Dict()

    @traitlets.validate("data")
    def _plain_data(self, proposal: Mapping[str, Any]) -> Any:
        return html.copy_plain(proposal["value"])

    def __repr__(self) -> str:
        cases = ", ".join(str(one["name"]) for one in self.data.get("cases", [])) or "none"
        label, case = self.data.get("parameter", {}).get("label"), self.case or "first"
        return f"Viewer(varied: {label}; cases: {cases}; shown: {case}, mode {self.mode})"

    def _repr_mimebundle_(self, **kwargs: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        data, metadata = super()._repr_mimebundle_(**kwargs) or ({}, {})
        kind = self.data["structure"]["kind"]
        esm, css = html.join_modules("viewer", kind), html.VIEWER_CSS
        state = {"data": self.data, "case": self.case, "mode": self.mode, "page": True}
        if self.form:
            esm, css, state["form"] = html.join_modules("rerun", kind), FORM_CSS, self.form
        page = html.static_html(esm, css, state)
        return {**data, "text/plain": repr(self), "text/html": page}, metadata
