"""Files of ``thesis plan``: cube, table of cameras, figure, page; all of them or none."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from markupsafe import Markup

from thesis_lib.files import staging
from thesis_lib.outputs import check_outputs, put_files
from thesis_lib.planning import errors
from thesis_lib.planning.figures import front_figure, layout_figure, layout_view
from thesis_lib.planning.planner import Plan, plan
from thesis_lib.planning.request import PlanRequest
from thesis_lib.planning.results import as_cube, camera_table
from thesis_lib.planning.structure_file import read_body
from thesis_lib.plotting.style import figure_svg
from thesis_lib.studies import storage
from thesis_lib.studies.request import changed_parameters, join_command
from thesis_lib.studies.schema import with_provenance
from thesis_lib.web.html import render_html, render_lines

#: By goal: the quantity whose error a plan gives, and what that is a percentage of
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
        Where to write; nothing is written there before all is made.
    structure : pathlib.Path, optional
        File with the structure, instead of the request's beam or plate.
    tell : callable
        Called with lines about the progress.

    Returns
    -------
    list of str
        The summary, line by line.
    """
    check_outputs(folder, [folder / name for name in PLAN_FILES], [structure] if structure else [])
    start = time.perf_counter()
    body = None if structure is None else read_body(structure, request.modes)
    made = plan(request, body, tell)
    cube = with_provenance(as_cube(made), request, time.perf_counter() - start)
    file = "" if structure is None else str(structure)
    cube.attrs["command"] = plan_command(request, file)
    if structure is not None:
        cube.attrs["structure_file"] = structure.name
        cube.attrs["structure_sha256"] = hashlib.sha256(structure.read_bytes()).hexdigest()
    lines = summarise_plan(made, file)
    picture = figure_svg(layout_figure(cube, made.chosen))
    with staging(folder) as part:
        storage.write_netcdf(cube, part / "plan.nc", compact=True)
        (part / "plan.csv").write_text(camera_table(cube, made.chosen), encoding="utf-8")
        (part / "plan.svg").write_text(picture, encoding="utf-8")
        (part / "plan.html").write_text(build_page(made, cube, lines, picture), encoding="utf-8")
        put_files(part, folder)
    return lines


def plan_record(folder: Path) -> dict[str, Any]:
    """Return the proposed option of a plan's files: cost, cameras, errors in %, by mode."""
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
    """Return the command that makes a plan again.

    Examples
    --------
    >>> plan_command(PlanRequest(body="plate", target_percent=2.0))
    'thesis plan -p body=plate -p target_percent=2.0'
    """
    structure = ["--structure", file] if file else []
    return join_command(["thesis", "plan", *structure], changed_parameters(request))


def study_of(request: PlanRequest, layout: Any, resolution: tuple[int, int]) -> str:
    """Return the command that simulates a layout (rows of `places`) as a study; empty if none can.

    The studies of chapters 3 and 4 have the thesis's structures, and one distance and one lens for
    all cameras, above the plane.
    """
    distance, focal = 1000 * layout[:, 2], request.sensor_width_mm * layout[:, 3]
    low = np.degrees(layout[:, 1].min())
    if request.plate_mm or np.ptp(distance) > 0.01 or np.ptp(focal) > 1e-9 or low <= 0:
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
    }
    return join_command(["thesis", "run", f"{request.body}-arrays"], values)


def _format_cost(plan_: Plan, cost: float) -> str:
    return f"{cost:g}" if plan_.request.prices else f"{cost / 1e6:.4g} million pixels/s"


def summarise_plan(plan_: Plan, file: str = "") -> list[str]:
    """Return what was found, in a few lines."""
    request, best = plan_.request, plan_.options[plan_.chosen]
    simulated = plan_.verified[plan_.chosen].simulated
    quantity, _ = QUANTITY_WORDS[request.goal]
    kind = "mean" if request.objective == "mean" else "worst marker's"
    return render_lines(
        "planning/templates/plan.txt.j2",
        plan=plan_,
        request=request,
        best=best,
        simulated=simulated,
        ratios=simulated / best.predicted,
        kind=quantity if best.instead else kind,
        quantity=quantity,
        shape_error=errors.objective_error(best.point, "mean").max() if best.instead else None,
        cost=partial(_format_cost, plan_),
        study="" if file else study_of(request, best.layout, best.resolution),
        file=file,
    )


def build_page(plan_: Plan, cube: xr.Dataset, lines: Sequence[str], picture: str) -> str:
    """Return the plan as one page that loads nothing."""
    header, *rows = csv.reader(io.StringIO(camera_table(cube, plan_.chosen)))
    front = figure_svg(front_figure(cube, plan_.request.target_percent))
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
        options=list(zip(plan_.options, plan_.verified, notes, strict=True)),
        cost=partial(_format_cost, plan_),
    )
