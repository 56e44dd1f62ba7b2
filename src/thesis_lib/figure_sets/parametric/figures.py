"""Figures and tables of the parametric studies; modes without symmetry, and mirror symmetry.

If cameras and plate are symmetric about X = 0, two markers at ±x have mirrored images, whole pixels
included, and measured deflections of the same size: the nominal run then has half as many
independent errors as markers. Random shifts of the pixel grids break this symmetry.
"""

import json
from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import Markdown
from matplotlib.figure import Figure

from thesis_lib.facts import claims, setups
from thesis_lib.figure_sets.parametric import figure_set, sound
from thesis_lib.ledger import verdicts
from thesis_lib.plotting import panels as figures, selection, style
from thesis_lib.plotting.panels import beam_figure as beam_figure
from thesis_lib.studies import cubes, schema
from thesis_lib.templates import render
from thesis_lib.vibration import finite_elements, polygons


def error_table(cube: xr.Dataset) -> Markdown:
    """List errors by setting and mode: trial 0, median, 5–95 % band, law of rounding."""
    columns = {}  # the errors of each mode, and of each plane of the sound, setting by setting
    table = cubes.summarise_errors(cube).set_index(["error", "mode"])
    for mode, (error, (_, plane)) in product(
        cube["mode"].values.tolist(), cubes.ERROR_VARIABLES.items()
    ):
        if (error, mode) not in table.index or error == "max_point_error":
            continue
        predicted = cubes.predicted_value(cube, error).sel(mode=mode).values
        cells = table.loc[[(error, mode)]].assign(predicted=predicted)
        if plane and cells["trial_0"].isna().any():  # nodal: relative to the other's pressure
            larger = cube["plane_error_of_larger"].sel(mode=mode, plane=plane)
            cells = cells.assign(of_larger=cubes.typical_error(larger))
        columns[f"mode {mode}" + (f", {plane}" if plane else "")] = cells.to_dict("records")
    rows = [
        {
            "case": str(cube["case"].values[i]),
            "label": str(cube["label"].values[i]),
            "cells": [cells[i] for cells in columns.values()],
            "in_view": float(cube["in_view"].values[i]),
            "missing": float(cube["missing"].values[i, 0, 0]) if "missing" in cube else 0.0,
        }
        for i in range(cube.sizes["setting"])
    ]
    text = render(
        __file__,
        "errors",
        said=cube.attrs,
        trials=cubes.trials_are(cube),
        columns=list(columns),
        rows=rows,
        sound="plane_error" in cube,
        piston_size=float(cube["piston_size"].max()) if "piston_size" in cube else 0.0,
    )
    return Markdown(text)


def claims_table(cube: xr.Dataset, only_misses: bool = True) -> Markdown:
    """Compare the thesis's claimed values with the band of the trials."""
    checks = []
    if cube.sizes["trial"] > 1:
        checks = verdicts.check_claims(cube, claims.claims_of(cube.attrs["figure_set"]))
    by_word = {
        word: [check.inside for check in checks if check.claim.quantity == quantity]
        for quantity, word in cubes.SHORT_LABELS.items()
    }
    text = render(
        __file__,
        "claims",
        trials=cubes.trials_are(cube) if cube.sizes["trial"] > 1 else "",
        counts={word: inside for word, inside in by_word.items() if inside},
        checks=[check for check in checks if not (only_misses and check.inside)],
        only_misses=only_misses,
        short=cubes.SHORT_LABELS,
    )
    return Markdown(text)


PLATE_SET = "plate-arrays"
SHAPE_NAMES = {PLATE_SET: "rectangle", "shape-l": "L", "shape-holes": "holes"}
MIRRORED_CASES = ("4a", "4a'", "4b", "4d")  # whose cameras are their own mirror image in X = 0
MAX_ROUNDING_M = 1e-7  # m: float32 on disk rounds 10 mm to less
SIZES_MM = (40.0, 20.0, 10.0)


def compare_frequencies(cube: xr.Dataset) -> dict[str, Any]:
    """Compare frequencies with those of the thesis's plate, and list the markers' mean motion."""
    asked = figure_set.camera_study(cube.attrs["figure_set"], json.loads(cube.attrs["parameters"]))
    modes, plate = cube["mode"].values.tolist(), setups.thesis_plate()
    rectangle = plate.angular_frequencies(max(modes)) / (2 * np.pi)
    rows = [
        {
            "one": one,
            "rectangle": rectangle[mode - 1],
            "peak": asked.structure.shape_peak(mode),
            "mean": _mean_deflection(one),
        }
        for mode, one in zip(modes, cubes.iterate_slices(cube, "mode"), strict=True)
    ]
    return {"rows": rows}


def _mean_deflection(one: xr.Dataset) -> float:
    """Return the mean deflection of the markers in one mode in % of the largest."""
    moved = np.abs(one["reference_deflection"].values)
    return float(100 * np.mean(moved) / np.max(moved))


def compare_with_law(cube: xr.Dataset, case: str) -> dict[str, float]:
    """Compare errors of a case of a plate with the law, and those of mirrored markers.

    Returns the share of nominal deflections with the `same` size as that of the mirrored marker,
    among markers that have one, the rms of ln(error / law) of the nominal (`literal`) runs and of
    the trials (`drawn`), and the share of trials that are at least as far off (`farther`).
    """
    part = cube.isel(setting=np.flatnonzero(cube["case"].values == case))
    half = np.array(schema.structure_extent(part)) / 2
    x, y = (part[axis].values - h for axis, h in zip("xy", half, strict=True))  # from the middle
    mirrored = (np.abs(x[:, None] + x) < 1e-9) & (np.abs(y[:, None] - y) < 1e-9)
    one, other = np.nonzero(mirrored & (x[:, None] < -1e-9))
    size = np.abs(part["measured_deflection"].isel(trial=0).values)
    off = np.log(part["mean_error"].values / part["predicted_error"].values[..., None])
    literal, *drawn = np.sqrt(np.mean(off**2, axis=(0, 1)))
    return {
        "same": float(np.mean(np.abs(size[..., one] - size[..., other]) < MAX_ROUNDING_M)),
        "literal": float(literal),
        "drawn": float(np.sqrt(np.mean(off[..., 1:] ** 2))),
        "farther": float(np.mean(np.array(drawn) >= literal)),
    }


def list_mirrors(opened: Mapping[str, xr.Dataset]) -> str:
    """List the effect of mirror symmetry in every case, for rectangle, L and plate with holes."""
    rows = []
    for case in dict.fromkeys(opened[PLATE_SET]["case"].values.tolist()):
        found = [compare_with_law(opened[name], case) for name in SHAPE_NAMES]
        rows.append({"case": case, "mirrored": case in MIRRORED_CASES, "found": found})
    return render(__file__, "symmetries", rows=rows, names=SHAPE_NAMES.values())


def compare_accuracy(opened: Mapping[str, xr.Dataset]) -> str:
    """Compare errors of the shapes with those of the rectangle, and with the law, by mode."""
    plate, rows = opened[PLATE_SET], []
    for name, word in list(SHAPE_NAMES.items())[1:]:
        slices = (cubes.iterate_slices(cube, "mode") for cube in (opened[name], plate))
        for both in zip(*slices, strict=True):
            rms = [selection.trial_rms(c["mean_error"]).values for c in both]
            laws = [c["predicted_error"].values for c in both]
            ratio, off = rms[0] / rms[1], rms[0] / laws[0] - 1
            rows.append(
                {
                    "shape": word,
                    "mode": both[0]["mode"].item(),
                    "mean": [_mean_deflection(one) for one in both],
                    "ratio": np.median(ratio),
                    "law": np.median(laws[0] / laws[1]),
                    "ratios": (ratio.min(), ratio.max()),
                    "off": (100 * off.min(), 100 * off.max()),
                }
            )
    return render(__file__, "accuracies", rows=rows, settings=plate.sizes["setting"])


def compare_convergence(_: Mapping[str, xr.Dataset]) -> str:
    """Compare finite elements of the rectangle with its closed form; fit the convergence order."""
    plate = setups.thesis_plate()
    outline = ((0.0, 0.0), (plate.length, 0.0), plate.extent, (0.0, plate.width))
    ratio, off = plate.bending_stiffness / plate.mass_per_area, []
    for size in SIZES_MM:
        mesh = polygons.mesh_outline(outline, (), size / 1000)
        edge = mesh.boundary_facets()
        found = finite_elements.plate_modes(mesh, edge[:0], edge, plate.poisson, 3)
        off.append(1 - np.sqrt(found.eigenvalues * ratio) / plate.angular_frequencies(3))
    orders = np.polyfit(np.log(SIZES_MM), np.log(np.array(off)), 1)[0]
    return render(__file__, "convergence", sizes=SIZES_MM, errors=off, orders=orders)


PIECES = {
    "shapes-convergence": compare_convergence,
    "shapes-accuracy": compare_accuracy,
    "shapes-symmetry": list_mirrors,
}


TEXTS = {
    "turn": lambda cube: {"audible": sound.audible_planes(cube)},
    "turn-summary": sound.turn_summary,
    "modes": compare_frequencies,
}


def turn(cube: xr.Dataset) -> Figure:
    """Plot field errors against the turn: lines by the law, dots simulated."""
    pairs = sound.audible_planes(cube)
    size, how = (2.1 * len(pairs) + 1, 3.1), {"squeeze": False, "sharey": True}
    drawing, axes = style.subplots(1, len(pairs), figsize=size, **how)
    for panel, (mode, plane) in zip(axes[0], pairs, strict=True):
        one = cube.sel(mode=mode, plane=plane)
        inks = style.ordered_colors(cube.sizes["elevation"])
        for part, ink in zip(cubes.iterate_slices(one, "elevation"), inks, strict=True):
            law, words = part["turned_law_error"], f"elevation {part['elevation'].item():g}°"
            panel.plot(cube["law_turn"], law, color=ink, lw=1, label=words)
            panel.plot(cube["turn"], part["turned_simulated"], "o", color=ink, ms=4)
        panel.set(title=f"mode {mode}, {plane}", xlabel="turned by, °")
    axes[0, 0].set(ylabel="field error, %", ylim=(0, None))
    style.legend_below(drawing, axes[0, 0], 4)
    return drawing


def plate_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the setup, ideal shape, best and worst measured shape, and bars."""
    part = selection.select_settings(cube, case, mode)
    grid = {"left": 0.073, "right": 0.896, "bottom": 0.089, "top": 0.946, "wspace": 0.43}
    how: Any = {"gridspec_kw": grid | {"hspace": 0.37}, "height_ratios": (1.5, 1)}
    drawing, axes = style.make_mosaic("abb;cde", (8.2, 5.6), None, **how)
    figures.setup_panel(axes["a"], cube, part)
    figures.bar_panel(axes["b"], part, [selection.error_bars(cube, case, mode)])
    axes["b"].set(title="(d) mean (rms) error", ylabel="% of the largest deflection")
    x, y, place = schema.marker_cells(cube)
    x, y, middle = 1000 * x, 1000 * y, np.array(schema.structure_extent(cube)) / 2
    shapes = [("(b) ideal", part["reference_deflection"].values * 1000)]
    for one, word, _ in selection.rank_settings(part):
        measured = one["measured_deflection"].isel(trial=0).values * 1000
        shapes.append((f"(c) {word}: {one['label'].item()}", measured))
    limit = max(float(np.max(np.abs(values))) for _, values in shapes)
    maps = [
        (title, schema.fill_cells(values, place, x.size * y.size).reshape(y.size, x.size), limit)
        for title, values in shapes
    ]
    row = [axes[name] for name in "cde"]
    pictures = style.draw_maps(row, maps, x, y, "xy")
    for panel in row:
        if cube["outline"].attrs["structure"] == "panel":
            for curve in schema.structure_contours(cube):
                panel.fill(*(1000 * (curve + middle)).T, fill=False, edgecolor=style.INK_COLOR)
        panel.plot(part["x"] * 1000, part["y"] * 1000, ".", color=style.INK_COLOR, ms=1.2)
    style.add_colorbar(axes["e"], pictures[0], "w in mm")
    return drawing


def sound_figure(cube: xr.Dataset, case: str, mode: int) -> Figure:
    """Draw the setup, bars of both planes, and on both the ideal field, best and worst error."""
    part = selection.select_settings(cube, case, mode)
    grid = {"left": 0.073, "right": 0.909, "bottom": 0.063, "top": 0.963, "wspace": 0.76}
    how: Any = {"gridspec_kw": grid | {"hspace": 0.43}, "height_ratios": (1.6, 1, 1)}
    drawing, axes = style.make_mosaic("abb;cde;fgh", (8.2, 8.0), None, **how)
    figures.setup_panel(axes["a"], cube, part)
    bars = [selection.error_bars(cube, case, mode, f"plane_error_{p}") for p in ("xz", "yz")]
    figures.bar_panel(axes["b"], part, bars)
    axes["b"].set(title="(d) rms error of the field", ylabel="% of the largest pressure")
    u, z = cube["u"].values * 1000, cube["z"].values * 1000
    of = {"case": cube["case_name"].values.tolist().index(case)}
    first = int(np.flatnonzero(cube["case"].values == case)[0])
    ends = part["best_and_worst"].isel(of).values.astype(int) - first
    names = part["label"].values[ends]
    ideal = part["pressure_reference_real"]
    loudest = float(abs(ideal).max())
    scale, unit = (1000, "kPa") if loudest >= 1000 else (1, "Pa")
    for letter, row, plane in zip("bc", ("cde", "fgh"), ("XZ", "YZ"), strict=True):
        silent = bool(part["independent_ratio"].isnull().sel(plane=plane))
        true = ideal.sel(plane=plane)
        wrong = (part["pressure_measured_real"].isel(of).sel(plane=plane) - true).values
        limit = float(np.abs(wrong).max())
        top = loudest if silent else float(abs(true).max())
        title = f"({letter}) {plane}, ideal{' (nodal)' if silent else ''}"
        maps = [(title, true.values.T / scale, top / scale)]
        for name, word, error in zip(names, ("best", "worst"), wrong, strict=True):
            maps.append((f"error, {word} shape:\n{name}", error.T, limit))
        panels = [axes[name] for name in row]
        pictures = style.draw_maps(panels, maps, u, z, (plane[0], "Z"))
        style.add_colorbar(panels[0], pictures[0], f"Re p in {unit}")
        style.add_colorbar(panels[2], pictures[2], "error in Pa")
    return drawing
