"""What ``thesis plan`` writes: cube, table of cameras, picture, page; whole or not at all."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import shlex
import time
from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.files import staging
from thesis_lib.outputs import check_outputs, put_files
from thesis_lib.planning import errors
from thesis_lib.planning.camera_table import camera_table
from thesis_lib.planning.cube import as_cube
from thesis_lib.planning.figures import front_figure, layout_figure
from thesis_lib.planning.layout_view import layout_view
from thesis_lib.planning.planner import Option, Plan, plan
from thesis_lib.planning.request import PlanRequest
from thesis_lib.planning.structure_file import read_body
from thesis_lib.plotting.style import svg
from thesis_lib.studies import storage
from thesis_lib.studies.attributes import with_provenance
from thesis_lib.web.shell import shell

# by goal: whose error a plan tells, and what it is held against
TOLD = {
    "shape": ("shape", "largest deflection of a marker"),
    "sound": ("field", "largest pressure on a plane, in a rigid wall"),
    "sound-plane": ("field", "largest pressure on the plane, in a rigid wall"),
    "sound-point": ("pressure", "pressure at the point, in a rigid wall"),
    "sound-power": ("power", "sound power in a rigid wall"),
}
FILES = ("plan.nc", "plan.csv", "plan.svg", "plan.html")


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
        Where to; nothing is written there before all is made.
    structure : pathlib.Path, optional
        File with the structure, in place of the request's beam or plate.
    tell : callable
        Is told how far it is.

    Returns
    -------
    list of str
        The summary, line by line.
    """
    check_outputs(folder, [folder / name for name in FILES], [structure] if structure else [])
    start = time.perf_counter()
    body = None if structure is None else read_body(structure, request.modes)
    made = plan(request, body, tell)
    cube = with_provenance(as_cube(made), request, time.perf_counter() - start)
    file = "" if structure is None else str(structure)
    cube.attrs["command"] = command(request, file)
    if structure is not None:
        cube.attrs["structure_file"] = structure.name
        cube.attrs["structure_sha256"] = hashlib.sha256(structure.read_bytes()).hexdigest()
    lines = summary(made, file)
    picture = svg(layout_figure(cube, made.chosen))
    with staging(folder) as part:
        storage.write(cube, part / "plan.nc", compact=True)
        (part / "plan.csv").write_text(camera_table(cube, made.chosen), encoding="utf-8")
        (part / "plan.svg").write_text(picture, encoding="utf-8")
        (part / "plan.html").write_text(page(made, cube, lines, picture), encoding="utf-8")
        put_files(part, folder)
    return lines


def study_of(request: PlanRequest, layout: Any, resolution: tuple[int, int]) -> str:
    """The command that simulates a layout (rows of `places`) as a study; empty if none can.

    The studies of chapters 3 and 4 have the thesis's structures, and one distance and one lens for
    all cameras, above the plane.
    """
    distance, focal = 1000 * layout[:, 2], request.sensor_width_mm * layout[:, 3]
    low = np.degrees(layout[:, 1].min())
    if request.plate_mm or np.ptp(distance) > 0.01 or np.ptp(focal) > 1e-9 or low <= 0:
        return ""
    angles = np.degrees(layout[:, :2])
    angles[:, 0] = np.mod(angles[:, 0] + 180, 360) - 180
    angles = np.round(angles, 3)
    values: dict[str, Any] = {
        "cases": [],
        "layouts": {"plan": [angles.tolist()]},
        "modes": request.modes,
        "distance_mm": round(float(distance[0]), 3),
        "resolution_px": list(resolution),
        "amplitude_mm": request.amplitude_mm,
        "focal_length_mm": round(float(focal[0]), 6),
        "sensor_width_mm": request.sensor_width_mm,
        "trials": request.trials,
    }
    words = [f"-p {shlex.quote(f'{k}={json.dumps(v)}')}" for k, v in values.items()]
    return " ".join([f"thesis run {request.body}-arrays", *words])


def command(request: PlanRequest, file: str = "") -> str:
    """The command that makes a plan again.

    Examples
    --------
    >>> command(PlanRequest(body="plate", target_percent=2.0))
    'thesis plan -p body=plate -p target_percent=2.0'
    """
    defaults = PlanRequest().request
    words = [
        f"-p {shlex.quote(f'{key}={value if isinstance(value, str) else json.dumps(value)}')}"
        for key, value in request.request.items()
        if value != defaults[key]
    ]
    named = [f"--structure {shlex.quote(file)}"] if file else []
    return " ".join(["thesis plan", *named, *words])


def _cost(plan_: Plan, cost: float) -> str:
    return f"{cost:g}" if plan_.request.prices else f"{cost / 1e6:.4g} million pixels/s"


def _beside(best: Option, heard: str) -> str:
    """What a plan compares with: its bound, or for sound the plan for the shape."""
    instead = best.instead
    if instead is None:
        averaged = f"averaged over amplitudes {best.expected:.3g} %"
        if best.expected < best.bound:
            return (
                f"{averaged}, less than the bound {best.bound:.3g} % for all layouts on the grid "
                "of the search, since cameras were moved off the grid"
            )
        return f"{averaged}; bound for all layouts on the grid of the search {best.bound:.3g} %"
    field, shape = float(instead.field.max()), errors.counted(best.point, "mean").max()
    return (
        f"planned for the shape as many cameras have a {heard} error of {field:.3g} %, so this is "
        f"{100 * (1 - best.error / field):.0f} % less; the shape's error is {shape:.3g} % in place "
        f"of {instead.plan.error:.3g} %"
    )


def summary(plan_: Plan, file: str = "") -> list[str]:
    """What was found, in a few lines."""
    request, best = plan_.request, plan_.options[plan_.chosen]
    found = plan_.verified[plan_.chosen].simulated
    n, (width, height) = len(best.layout), best.resolution
    kind = "mean" if request.objective == "mean" else "worst marker's"
    heard, _ = TOLD[request.goal]
    kind = heard if best.instead else kind
    which = "cheapest that reaches the target" if request.target_percent else "most accurate"
    modes = ", ".join(
        f"mode {mode}: {p:.3g} ({s:.3g})"
        for mode, p, s in zip(plan_.body.modes, best.predicted, found, strict=True)
    )
    lines = [
        f"{plan_.body.name}: {n} cameras of {width}×{height} px at {best.frame_rate:g} Hz are the "
        f"{which}: {_cost(plan_, best.cost)}",
        f"{kind} error predicted (simulated) in %: {modes}; simulated over predicted "
        f"{np.min(found / best.predicted):.3f} to {np.max(found / best.predicted):.3f}",
        _beside(best, heard),
    ]
    study = "" if file else study_of(request, best.layout, best.resolution)
    if study:
        lines.append(f"The same as a study: {study}")
    elif not (file or request.plate_mm):
        why = "its cameras differ in distance or lens, or stand below the plane."
        lines.append(f"No study takes this layout: {why}")
    return lines


def _rows(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" if cell else "<td></td>" for cell in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    whole = f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>"
    return f'<div class="scroll" tabindex="0"><table>{whole}</table></div>'


def _picture(text: str, alt: str, caption: str) -> str:
    import base64

    data = base64.b64encode(text.encode()).decode()
    image = f'<img alt="{escape(alt)}" src="data:image/svg+xml;base64,{data}">'
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def page(plan_: Plan, cube: xr.Dataset, lines: Sequence[str], picture: str) -> str:
    """The plan as one page that loads nothing."""
    header, *rows = csv.reader(io.StringIO(camera_table(cube, plan_.chosen)))
    options = []
    for i, (one, found) in enumerate(zip(plan_.options, plan_.verified, strict=True)):
        size = f"{one.resolution[0]}×{one.resolution[1]}"
        of = [f"{error:.3g}" for error in (one.expected, one.error, float(found.simulated.max()))]
        note = "proposed" if i == plan_.chosen else "on the front" if i in plan_.front else ""
        options.append([str(len(one.layout)), size, _cost(plan_, one.cost), *of, note])
    front = svg(front_figure(cube, plan_.request.target_percent))
    _, counted = TOLD[plan_.request.goal]
    parts = [
        f"<h1>{escape(plan_.request.title)}: {escape(plan_.body.name)}</h1>",
        "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>",
        _picture(
            picture,
            "The proposed cameras around the structure from three sides.",
            "The proposed layout. Lines of sight lead to the middle of the structure; dotted "
            "lines fall onto the plane of its middle.",
        ),
        layout_view([(plan_.body.name, cube, plan_.chosen)]),
        "<h2>Cameras</h2>",
        _rows([name.replace("_", " ") for name in header], rows),
        "<p>Positions are in the structure's frame. Every camera looks at the middle of the "
        "structure, the base of its picture parallel to the XY plane.</p>",
        "<h2>Accuracy and cost</h2>",
        _picture(
            front,
            "Error against cost of all options, with a stepped line along the best.",
            "Every number of cameras, best placed, with every resolution. Errors are those of "
            f"the worst mode in % of its {counted}.",
        ),
        _rows(
            ["cameras", "pixels", "cost", "averaged, %", "predicted, %", "simulated, %", ""],
            options,
        ),
        "<h2>How this was made</h2>",
        f"<pre>{escape(str(cube.attrs['command']))}</pre>",
        f"<p>{escape(cube.attrs['source'])}, commit {escape(cube.attrs['commit'].strip())}, "
        f"{escape(cube.attrs['created'])}; {plan_.candidates} places to choose from.</p>",
    ]
    return shell(f"{plan_.request.title}: {plan_.body.name}", "\n".join(parts))
