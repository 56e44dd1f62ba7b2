"""Figures, 3-D viewer and output files of a camera plan (``thesis plan``)."""

import csv
import hashlib
import io
import json
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from markupsafe import Markup
from matplotlib.axes import Axes

from thesis_lib.arrays import Array
from thesis_lib.files import check_outputs, put_files, staging
from thesis_lib.planning import errors, structure_file
from thesis_lib.planning.planner import Plan, as_cube, camera_table, plan
from thesis_lib.planning.request import PlanRequest
from thesis_lib.plotting import panels, style
from thesis_lib.plotting.style import HIGHLIGHT_COLOR, cycle_color, in_style, subplots
from thesis_lib.studies import cubes, schema, storage
from thesis_lib.studies.request import changed_parameters, join_command
from thesis_lib.web.html import VIEWER_CSS, join_modules, render_html, render_lines, static_html

LAYOUT_VIEWS = ("from a corner", 155.0, 28.0), ("from above", 180.0, 90.0), ("along Y", 180.0, 0.0)
NO_SCRIPT_TEXT = (
    "This figure needs JavaScript to be turned; the ones next to it show the same cameras."
)


def layout_panel(axes: Axes, part: xr.Dataset, azimuth: float, elevation: float) -> None:
    """Draw the cameras of one option in a parallel projection from a direction in degrees."""

    def to_plane(points: Any) -> Array:
        return 1000 * panels.project_parallel(points, azimuth, elevation)

    outline, where = (_finite(part[name].values) for name in ("outline", "camera_position"))
    centre = (outline.max(axis=0) + outline.min(axis=0)) / 2
    if len(outline) == 4:
        axes.fill(*to_plane(outline).T, color="#9a9a9a", zorder=1)
    else:
        axes.plot(*to_plane(outline).T, color="#9a9a9a", linewidth=0.8, zorder=1)
    if "marker" in part:
        dots = to_plane(part["marker"].values)
        axes.plot(*dots.T, ".", color=style.INK_COLOR, markersize=1.5, zorder=2)
    for i, place in enumerate(where):
        sight, foot = to_plane([place, centre]), to_plane([place, [place[0], place[1], centre[2]]])
        axes.plot(*sight.T, color=cycle_color(i), linewidth=0.6, alpha=0.6)
        axes.plot(*foot.T, ":", color=style.REFERENCE_COLOR, linewidth=0.6)
        axes.plot(*sight[0], "o", color=cycle_color(i), markersize=9, zorder=4, clip_on=False)
        n = str(i + 1)
        axes.annotate(n, sight[0], color="white", size=6.5, ha="center", va="center", zorder=5)
    size = max(np.ptp(where, axis=0).max(), np.ptp(outline, axis=0).max()) / 3
    for axis, name in zip(np.eye(3), "XYZ", strict=True):
        line = to_plane([centre, centre + size * axis])
        if np.linalg.norm(line[1] - line[0]) > 1:
            axes.plot(*line.T, color="#777777", linewidth=0.8, zorder=3)
            axes.annotate(name, line[1], color="#777777", fontsize=8, ha="center", va="bottom")
    axes.set_aspect("equal")
    axes.margins(0.1)
    axes.axis("off")


def front_panel(axes: Axes, cube: xr.Dataset, target: float | None = None) -> None:
    """Draw the error of every option against its cost, and the Pareto front.

    Colours show numbers of cameras, symbols resolutions.
    """
    priced = cube.attrs.get("cost_is") == "price"
    cost = cube["cost"].values / (1.0 if priced else 1e6)
    predicted, simulated = (
        cube[f"{name}_error"].max("mode").values for name in ("predicted", "simulated")
    )
    counts = cube["n_cameras"].values
    sizes = [*zip(cube["width_px"].values.tolist(), cube["height_px"].values.tolist(), strict=True)]
    front = np.flatnonzero(cube["on_front"].values)
    front = front[np.argsort(cost[front], kind="stable")]
    line: Any = {"color": style.REFERENCE_COLOR, "linewidth": 1.2, "where": "post"}
    axes.step(cost[front], predicted[front], label="nothing cheaper is as accurate", **line)
    numbers = np.unique(counts)
    symbols = dict(zip(sorted(set(sizes)), cycle("osD^vP*X"), strict=False))
    inks = dict(zip(numbers, style.ordered_colors(len(numbers)), strict=True))
    for n, ink in inks.items():
        for size, symbol in symbols.items():
            at = (counts == n) & [one == size for one in sizes]
            axes.plot(cost[at], predicted[at], symbol, color=ink, markersize=6)
    dots: dict[str, dict[str, Any]] = {
        f"{n} cameras": {"color": ink, "marker": "s"} for n, ink in inks.items()
    }
    dots |= {f"{w:g}×{h:g} px": {"marker": symbol} for (w, h), symbol in symbols.items()}
    style.name_styles(axes, {label: {"ls": "none", "ms": 5, **own} for label, own in dots.items()})
    axes.plot(cost, simulated, "_", color=style.BLACK_COLOR, markersize=9, label="simulated")
    if target is not None:
        axes.axhline(target, color=HIGHLIGHT_COLOR, linestyle="--", linewidth=1, label="target")
        at = cost[int(cube["chosen"])], predicted[int(cube["chosen"])]
        ring: Any = {"markersize": 14, "markerfacecolor": "none", "color": HIGHLIGHT_COLOR}
        axes.plot(*at, "o", label="cheapest that reaches it", **ring)
    for axis, values in ((axes.xaxis, cost), (axes.yaxis, predicted)):
        low, high = values.min() / 2, 2 * values.max()
        style.make_logarithmic(axis, [tick for tick in style.TICK_STEPS if low < tick < high])
    axes.set_xlabel("price of all cameras" if priced else "million pixels per second, all cameras")
    axes.set_ylabel("error of the worst mode, %")
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=7)


def layout_view(plans: Sequence[tuple[str, xr.Dataset, int]]) -> str:
    """Return plans as a self-contained HTML fragment.

    Each is a name, a cube with options and their cameras, and the index of the option shown first.
    """
    described = []
    for name, cube, chosen in plans:
        outline = _finite(cube["outline"].values)
        described.append(
            {
                "name": name,
                "chosen": chosen,
                "centre": ((outline.max(axis=0) + outline.min(axis=0)) / 2).tolist(),
                "outline": outline.tolist(),
                "markers": cube["marker"].values.tolist() if "marker" in cube else [],
                "options": [_describe_option(cube, i) for i in range(cube.sizes["option"])],
            }
        )
    data = {"plans": described, "tints": list(style.CYCLE_COLORS)}
    return static_html(join_modules("layout"), VIEWER_CSS, {"data": data}, NO_SCRIPT_TEXT)


def _describe_option(cube: xr.Dataset, index: int) -> dict[str, Any]:
    one = cube.isel(option=index)
    label = f"{int(one['n_cameras'])} of {int(one['width_px'])}×{int(one['height_px'])} px"
    error, simulated = (
        cubes.percent_text(float(one[f"{name}_error"].max())) for name in ("predicted", "simulated")
    )
    errors = f"{error} % predicted, {simulated} % simulated, in the worst mode."
    words = f"{label} at {float(one['frame_rate']):g} Hz: {errors}"
    return {"label": label, "words": words, "table": camera_table(cube, index)}


def _finite(points: Array) -> Array:
    """Return the points (points, 3) without padding rows."""
    return points[np.isfinite(points).all(axis=1)]


#: By goal: the quantity whose error a plan reports, and the reference of the percentage
QUANTITY_WORDS = {
    "shape": ("shape", "largest deflection of a marker"),
    "sound": ("field", "largest pressure on a plane, in a rigid wall"),
    "sound-plane": ("field", "largest pressure on the plane, in a rigid wall"),
    "sound-point": ("pressure", "pressure at the point, in a rigid wall"),
    "sound-power": ("power", "sound power in a rigid wall"),
}
PLAN_FILES = ("plan.nc", "plan.csv", "plan.svg", "plan.html")


def write_plan(
    request: PlanRequest,
    folder: Path,
    structure: Path | None = None,
    tell: Callable[[str], object] = lambda _: None,
) -> list[str]:
    """Make a plan and write its four files into a folder.

    Parameters
    ----------
    request : PlanRequest
        Validated parameters.
    folder : pathlib.Path
        Output folder; nothing is written there before all files are complete.
    structure : pathlib.Path, optional
        File with the structure, instead of the request's beam or plate.
    tell : callable
        Called with lines about the progress.

    Returns
    -------
    list of str
        The summary, line by line.
    """
    start = time.perf_counter()
    body = None if structure is None else structure_file.read_body(structure, request.modes)
    check_outputs(folder, [folder / name for name in PLAN_FILES], [structure] if structure else [])
    made = plan(request, body, tell)
    cube = schema.with_provenance(as_cube(made), request, time.perf_counter() - start)
    file = "" if structure is None else str(structure)
    cube.attrs["command"] = plan_command(request, file)
    if structure is not None:
        cube.attrs["structure_file"] = structure.name
        cube.attrs["structure_sha256"] = hashlib.sha256(structure.read_bytes()).hexdigest()
    lines = summarise_plan(made, file)
    size, ratios = (7.6, 3.1), [1.3, 1, 1]
    with in_style():
        drawing, axes = subplots(1, 3, figsize=size, width_ratios=ratios)
        for axis, (words, azimuth, elevation) in zip(axes, LAYOUT_VIEWS, strict=True):
            layout_panel(axis, cube.isel(option=made.chosen), azimuth, elevation)
            axis.set_title(words)
    picture = style.figure_svg(drawing)
    with staging(folder) as part:
        storage.write_netcdf(cube, part / "plan.nc", compact=True)
        (part / "plan.csv").write_text(camera_table(cube, made.chosen), encoding="utf-8")
        (part / "plan.svg").write_text(picture, encoding="utf-8")
        (part / "plan.html").write_text(build_page(made, cube, lines, picture), encoding="utf-8")
        put_files(part, folder)
    return lines


def plan_record(folder: Path) -> dict[str, Any]:
    """Read the proposed option from a plan's files: cost, cameras, errors in %, by mode."""
    cube = storage.open_netcdf(folder / "plan.nc")
    best = cube.isel(option=int(cube["chosen"]))
    names = ["frequency", "predicted_error", "simulated_error", "simulated_low", "simulated_high"]
    return {
        "structure": cube.attrs["structure"],
        "parameters": json.loads(cube.attrs["parameters"]),
        "page": folder / "plan.html",
        "cost": float(best["cost"]),
        "cost_is": cube.attrs["cost_is"],
        "cameras": pd.read_csv(folder / "plan.csv").to_dict("records"),
        "errors": best[names].to_dataframe()[names].reset_index().to_dict("records"),
    }


def plan_command(request: PlanRequest, file: str = "") -> str:
    """Return the command that reproduces a plan.

    Examples
    --------
    >>> plan_command(PlanRequest(body="plate", target_percent=2.0))
    'thesis plan -p body=plate -p target_percent=2.0'
    """
    structure = ["--structure", file] if file else []
    return join_command(["thesis", "plan", *structure], changed_parameters(request))


def format_study_command(request: PlanRequest, layout: Any, resolution: tuple[int, int]) -> str:
    """Return the command that simulates a layout (rows of `places`) as a study; empty if none can.

    The studies of chapters 3 and 4 have the thesis's structures, and one distance and one focal
    length for all cameras, which stand above the plane and see all markers.
    """
    distance, focal = 1000 * layout[:, 2], request.sensor_width_mm * layout[:, 3]
    low = np.degrees(layout[:, 1].min())
    alike = np.ptp(distance) <= 0.01 and np.ptp(focal) <= 1e-9 and low > 0
    if request.plate_mm or request.in_view < 1 or not alike:
        return ""
    angles = np.degrees(layout[:, :2])
    angles[:, 0] = np.mod(angles[:, 0] + 180, 360) - 180
    values: dict[str, Any] = {
        "cases": [],
        "layouts": {"plan": [np.round(angles, 3).tolist()]},
        "modes": request.modes,
        "distance_mm": round(float(distance[0]), 3),
        "resolution_px": list(resolution),
        "amplitude_mm": request.amplitude_mm,
        "focal_length_mm": round(float(focal[0]), 6),
        "sensor_width_mm": request.sensor_width_mm,
        "trials": request.trials,
        "seed": request.seed,
        "estimator": request.estimator,
    }
    return join_command(["thesis", "run", f"{request.body}-arrays"], values)


def _format_cost(plan_: Plan, cost: float) -> str:
    return f"{cost:g}" if plan_.request.prices else f"{cost / 1e6:.4g} million pixels/s"


def summarise_plan(plan_: Plan, file: str = "") -> list[str]:
    """Summarise a plan in a few lines."""
    request, best = plan_.request, plan_.options[plan_.chosen]
    quantity, _ = QUANTITY_WORDS[request.goal]
    kind = "mean" if request.objective == "mean" else "worst marker's"
    return render_lines(
        "planning/templates/plan.txt.j2",
        plan=plan_,
        request=request,
        best=best,
        ratios=best.simulated / best.predicted,
        kind=quantity if best.shape_plan else kind,
        quantity=quantity,
        shape_error=errors.objective_error(best.point, "mean").max() if best.shape_plan else None,
        cost=partial(_format_cost, plan_),
        study="" if file else format_study_command(request, best.layout, best.resolution),
        file=file,
    )


def build_page(plan_: Plan, cube: xr.Dataset, lines: Sequence[str], picture: str) -> str:
    """Return the plan as a self-contained HTML page."""
    header, *rows = csv.reader(io.StringIO(camera_table(cube, plan_.chosen)))
    with in_style():
        drawing, axes = subplots(figsize=(7.2, 3.8))
        front_panel(axes, cube, plan_.request.target_percent)
    front = style.figure_svg(drawing)
    notes = ["on the front" if i in plan_.front else "" for i in range(len(plan_.options))]
    notes[plan_.chosen] = "proposed"
    return render_html(
        "planning/templates/plan.html.j2",
        title=f"{plan_.request.title}: {plan_.body.name}",
        plan=plan_,
        cube=cube,
        lines=lines,
        layout=("svg", picture.encode()),
        viewer=Markup(layout_view([(plan_.body.name, cube, plan_.chosen)])),
        header=[name.replace("_", " ") for name in header],
        rows=rows,
        front=("svg", front.encode()),
        reference=QUANTITY_WORDS[plan_.request.goal][1],
        options=list(zip(plan_.options, notes, strict=True)),
        cost=partial(_format_cost, plan_),
    )
