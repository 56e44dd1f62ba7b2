"""Reports of measurements: self-contained pages, their figures, and lines for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from markupsafe import Markup
from matplotlib.figure import Figure

from thesis_lib.arrays import Array, Image
from thesis_lib.measure.exchange.files import marker_edges, marker_faces
from thesis_lib.measure.feasibility.assess import assess_manifest, describe_assessment
from thesis_lib.measure.fitting.result import known_rms
from thesis_lib.measure.messages import ALL_MESSAGES, Note
from thesis_lib.measure.radiation.of_measurement import absolute_pressure, format_point
from thesis_lib.measure.radiation.radiated import ALL_TONES
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.report import figures as draw, warnings
from thesis_lib.plotting.selection import encode_field
from thesis_lib.plotting.style import DIVERGING_COLORS, MATH_STYLE, save_figure
from thesis_lib.studies.cubes import complex_of, iterate_slices
from thesis_lib.web import html

_TEMPLATE_FOLDER = "measure/report/templates/"


def view_shape(data: xr.Dataset, extent: tuple[float, float]) -> str:
    """Return an animated surface of the measured markers as a self-contained HTML fragment.

    It starts at the maximum of the deflection. `extent` is the structure's length and width, m.
    """
    turned = data["deflection"].values + 1j * data["quadrature"].values
    known = np.isfinite(turned)
    x, y = data["x"].values[known], data["y"].values[known]
    long, wide = (1e3 * side / 2 for side in extent)
    state = {
        "points": np.column_stack([1e3 * x - long, 1e3 * y - wide]).tolist(),
        "real": (1e3 * turned.real[known]).tolist(),
        "imag": (1e3 * turned.imag[known]).tolist(),
        "error": (1e3 * np.nan_to_num(data["standard_error"].values[known])).tolist(),
        "faces": marker_faces(x, y).tolist(),
        "edges": marker_edges(x, y).tolist(),
        "frequency": float(data["frequency"]),
        "colormap": list(DIVERGING_COLORS),
        "outline": [[-long, -wide], [long, -wide], [long, wide], [-long, wide]],
    }
    css = html.VIEWER_CSS + html.read_asset("measured.css")
    still = "This figure needs JavaScript to move; the figure below shows the same shape."
    return html.static_html(html.join_modules("measured"), css, {"data": state}, still)


def view_sound(one: xr.Dataset, manifest: Manifest) -> str:
    """Return the animated sound field of one sine as a self-contained HTML fragment."""
    u, z = 1000 * one["u"].values, 1000 * one["z"].values
    field = complex_of(one, "field")
    names = [str(name) for name in one["plane"].values]
    halves = {"X": manifest.structure.length_mm / 2, "Y": manifest.structure.width_mm / 2}
    share = float(np.sqrt(np.mean(one["field_error"].values ** 2)) / np.abs(field).max())
    extent = {
        "u_mm": [float(u[0]), float(u[-1])],
        "z_mm": [float(z[0]), float(z[-1])],
        "shape": [len(u), len(z)],
    }
    state = {
        "planes": [{"name": name, **extent} for name in names],
        "fields": [encode_field(part) for part in field],
        "halves": [halves[name[0]] for name in names],
        "frequency": float(one["frequency"]),
        "colormap": list(DIVERGING_COLORS),
        "words": f"Sound pressure at {float(one['frequency']):.4g} Hz above the structure in a "
        "rigid wall, in two planes through its centre. Its standard error is "
        f"{100 * share:.2g} % of the largest pressure (rms).",
    }
    still = "This figure needs JavaScript; radiated.nc has the same field."
    return html.static_html(html.join_modules("radiated"), html.VIEWER_CSS, {"data": state}, still)


@dataclass(frozen=True)
class Report:
    """A report, or a section of one."""

    page: str
    summary: list[str]  #: The main results, in a few lines
    notes: list[Note]  #: Messages to consider before trusting a result
    pictures: Mapping[str, html.Picture]

    def write_files(self, folder: Path) -> None:
        """Write ``report.html`` and the folder ``figures`` into a folder."""
        html.write_pictures(folder, self.pictures.items())
        (folder / "report.html").write_text(self.page, encoding="utf-8")


def _assemble(
    template: str,
    data: xr.Dataset,
    manifest: Manifest,
    summary: list[str],
    notes: list[Note],
    pictures: Mapping[str, html.Picture],
    parts: Mapping[str, Report | None],
    **values: object,
) -> Report:
    """Fill in a template with the common contents, and the sections on sound and response."""
    known = [part for part in parts.values() if part]
    pictures = dict(pictures)
    for part in known:
        pictures |= part.pictures
    page = html.render_html(
        _TEMPLATE_FOLDER + template,
        title=data.attrs.get("title", ""),
        data=data,
        manifest=manifest,
        summary=summary,
        notes=notes,
        messages=ALL_MESSAGES,
        pictures=pictures,
        **{name: Markup(part.page if part else "") for name, part in parts.items()},
        **values,
    )
    summary = summary + [line for part in known for line in part.summary]
    return Report(page, summary, notes + [note for part in known for note in part.notes], pictures)


def _save_svgs(figures: Mapping[str, Figure], style: Any = None) -> dict[str, html.Picture]:
    """Return figures as SVG, by name."""
    return {name: ("svg", save_figure(figure, "svg", style)) for name, figure in figures.items()}


def build_shape(
    data: xr.Dataset,
    seen: xr.Dataset,
    manifest: Manifest,
    firsts: Sequence[Image],
    sound: Report | None = None,
) -> Report:
    """Return the report on the shape at one frequency, with the section on sound, if any.

    `seen` is what :func:`~thesis_lib.measure.report.figures.collect_diagnostics` returns;
    `firsts` the first frame of each camera, (height, width).
    """
    figures = {
        "shape": draw.draw_shape(data, manifest),
        "cameras": draw.draw_cameras(data, manifest),
        "motion": draw.draw_motion(data, seen),
        "residuals": draw.draw_residuals(seen),
    }
    if data["shots_used"].any():
        figures["corners"] = draw.draw_corners(data)
    pictures = _save_svgs(figures)
    for i, first in enumerate(firsts):
        one = seen.isel(camera=i)
        photo = draw.draw_photograph(first, one["found"].values, one["outline"].values)
        pictures[f"camera-{i:02d}"] = ("png", save_figure(photo, "png", dpi=140))
    centre = data["camera_centre"]
    distance = np.sqrt((centre**2).sum(str(centre.dims[1])))
    placed = data.assign(
        distance=distance,
        azimuth=np.degrees(np.arctan2(centre[:, 0], centre[:, 1])),
        elevation=np.degrees(np.arcsin(centre[:, 2] / distance)),
        scatter=("camera", [known_rms(one) for one in data["centre_scatter"].values]),
    )
    assessment = assess_manifest(manifest)
    order = np.argsort(-np.nan_to_num(data["mac"].values))[:6]
    return _assemble(
        "shape.html.j2",
        data,
        manifest,
        summarise_shape(data),
        warnings.check_shape(data),
        pictures,
        {"sound": sound},
        viewer=Markup(view_shape(data, manifest.structure.extent)),
        numbers=tabulate_shape(data),
        candidates=[data.isel(candidate=k) for k in order],
        cameras=list(iterate_slices(placed, "camera")),
        feasibility="\n".join(describe_assessment(assessment)),
        warned=list(dict.fromkeys(warning.code for warning in assessment.warnings)),
        excess=max(float(np.nan_to_num(data["in_plane_excess"])), 1.0),
    )


def tabulate_shape(data: xr.Dataset) -> pd.DataFrame:
    """Return the result marker by marker, in mm and degrees."""
    own = "x", "y", "deflection", "standard_error", "quadrature"
    names = {f"{name}_mm": name for name in own} | {"model_mm": "reference_deflection"}
    table = {"marker": np.arange(1, data["x"].size + 1)}
    table |= {name: np.round(1e3 * data[key].values, 6) for name, key in names.items()}
    table |= {
        "phase_deg": np.round(data["phase"].values, 3),
        "cameras": data["cameras_seen"].values,
    }
    return pd.DataFrame(table)


def summarise_shape(data: xr.Dataset) -> list[str]:
    """Return the main results, in a few lines."""
    w, error = data["deflection"].values, data["standard_error"].values
    most = int(np.nanargmax(np.abs(np.where(np.isfinite(error), w, np.nan))))
    return html.render_lines(
        _TEMPLATE_FOLDER + "shape.txt.j2",
        data=data,
        largest=data.isel(marker=most),
        measured=np.count_nonzero(np.isfinite(w)),
        error=known_rms(error),
    )


def build_modes(
    data: xr.Dataset, manifest: Manifest, response: Report | None, sound: Report | None
) -> Report:
    """Return the report on several modes, with the sections on response and sound, if any."""
    figures = {
        "stabilisation": draw.draw_stabilisation(data),
        "assurance": draw.draw_assurance(data),
    }
    modes, extent = tabulate_modes(data), manifest.structure.extent
    rows = modes.to_dict("records")
    return _assemble(
        "modes.html.j2",
        data,
        manifest,
        html.render_lines(_TEMPLATE_FOLDER + "modes.txt.j2", rows=rows, data=data),
        list(warnings.check_modes(data, manifest)),
        _save_svgs(figures),
        {"sound": sound, "response": response},
        modes=modes,
        shapes=tabulate_mode_shapes(data),
        viewers=[Markup(view_shape(one, extent)) for one in iterate_slices(data, "mode")],
    )


def tabulate_modes(data: xr.Dataset) -> pd.DataFrame:
    """Return the modes as a table of texts."""
    size = 1e3 * np.nanmax(np.abs(complex_of(data, "amplitude")), axis=1)
    error = 1e3 * np.sqrt((data["standard_error"] ** 2).mean("marker").values)
    damped = data["damping"].values != 0
    table = {
        "mode": np.arange(1, len(size) + 1),
        "frequency in Hz": _texts(data["frequency"].values, "#.6g"),
        "± Hz": _texts(data["frequency_deviation"].values, ".1g"),
        "damping in %": _texts(np.where(damped, 100 * data["damping"].values, np.nan), "#.4g"),
        "± %": _texts(np.where(damped, 100 * data["damping_deviation"].values, np.nan), ".1g"),
        "largest amplitude in mm": _texts(size, "#.4g"),
        "± mm, a marker": _texts(error, ".2g"),
    }
    if data.sizes["candidate"]:
        best = np.argmax(np.nan_to_num(data["mac"].values), axis=1)
        table["most similar"] = data["candidate"].values[best]
        table["MAC"] = _texts(data["mac"].values[np.arange(len(best)), best], ".5f")
    return pd.DataFrame(table)


def _texts(values: Array, form: str) -> list[str]:
    return [html.format_number(value, form) for value in values]


def tabulate_mode_shapes(data: xr.Dataset) -> pd.DataFrame:
    """Return every marker's complex amplitudes and their errors, in mm."""
    table = {"marker": np.arange(1, data["x"].size + 1)}
    table |= {f"{name}_mm": np.round(1e3 * data[name].values, 6) for name in ("x", "y")}
    for k in range(data.sizes["mode"]):
        for part in ("amplitude_real", "amplitude_imag", "standard_error"):
            name = f"mode_{k + 1}_{part.removeprefix('amplitude_')}_mm"
            table[name] = np.round(1e3 * data[part].isel(mode=k).values, 7)
    return pd.DataFrame(table)


def build_response(data: xr.Dataset, manifest: Manifest) -> Report:
    """Return the report on receptances, or its section if modes are measured, too.

    It shows the drive point, and the markers with the least and the largest relative error.
    """
    size, drive = np.abs(complex_of(data, "receptance")[0]), int(data["drive"]) - 1
    error, markers = data["standard_error"].values[0], {"drive": drive}
    typical = np.nanmedian(error / size, axis=1)
    if np.isfinite(typical).any():
        markers |= {"surest": int(np.nanargmin(typical)), "least": int(np.nanargmax(typical))}
    top = int(np.nanargmax(size[drive]))
    summary = html.render_lines(
        _TEMPLATE_FOLDER + "response.txt.j2",
        data=data,
        peak=size[drive, top],
        error=error[drive, top],
        hertz=data["frequency"].values[top],
    )
    figures = {f"response-{role}": draw.draw_response(data, k) for role, k in markers.items()}
    part = _assemble(
        "response_section.html.j2",
        data,
        manifest,
        summary,
        list(warnings.check_response(data, manifest)),
        _save_svgs(figures, MATH_STYLE),
        {},
        markers=markers,
        roles={"drive": "nearest to the force", "surest": "surest", "least": "least sure"},
    )
    if manifest.excitation.behaviour.result != "response":
        return part
    return _assemble("response.html.j2", data, manifest, [], [], {}, {"response": part})


def build_sound(data: xr.Dataset, manifest: Manifest) -> Report:
    """Return the section of a report on radiated sound: levels, fields, modes, assumptions."""
    tones = list(iterate_slices(data, "tone"))
    points = [one for tone in tones for one in iterate_slices(tone, "point")]
    bands = [data.sel(band=band) for band in data["band"].values]
    way = float(np.linalg.norm(data["place"].values, axis=1).max())
    decay = data.get("decay", xr.zeros_like(data["frequency"]))
    common: dict[str, Any] = {"tones": tones, "whole": data.sel(band=ALL_TONES)}
    bare = []  # estimated level without a wall and its standard error
    for one in tones:
        level = float(one["power_level"]) + float(one["no_wall_change"])
        std = float(np.hypot(one["no_wall_change_std"], one["power_level_error"]))
        bare.append((level, std) if np.isfinite(level) else None)
    summary = html.render_lines(
        _TEMPLATE_FOLDER + "sound.txt.j2", data=data, wall=data.attrs["wall"], bare=bare, **common
    )
    return _assemble(
        "sound.html.j2",
        data,
        manifest,
        summary,
        list(warnings.check_sound(data)),
        {},
        {},
        no_wall_change=warnings.format_no_wall_change,
        viewers=[Markup(view_sound(one, manifest)) for one in tones],
        place=format_point,
        points=[one.assign(pressure=absolute_pressure(one)) for one in points],
        bands=[{"data": one, "points": list(iterate_slices(one, "point"))} for one in bands],
        way=way,
        lost=float(decay.max()) * way / float(data.attrs["speed_of_sound"]),
        **common,
    )
