"""Tables and figures of ``planner``, from its cube."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import HTML, Markdown

from thesis_lib.figure_sets.planner.compute import cheapest
from thesis_lib.figure_sets.planner.parameters import THESIS
from thesis_lib.planning.errors import AMPLITUDES
from thesis_lib.planning.lattice import TIE
from thesis_lib.planning.layout_view import layout_view
from thesis_lib.studies.cubes import percent_text
from thesis_lib.web.markdown import columns, table

FRONT = "beam: nearer or farther, too"  # of which the front is drawn
DRAWN = 4  # cameras of the layouts that are drawn, or the number next to it


def asked(cube: xr.Dataset, name: str) -> Any:
    """A parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def coarse(cube: xr.Dataset, question: str) -> xr.Dataset:
    """The options of a question with the first of the resolutions."""
    one = cube.sel(question=question)
    return one.isel(option=np.flatnonzero(one["width_px"] == asked(cube, "resolutions_px")[0][0]))


def _text(value: float) -> str:
    return "—" if np.isnan(value) else percent_text(value)


def _best_of_thesis(cube: xr.Dataset, body: str) -> list[tuple[str, float, float]]:
    """Case with the least averaged error, that error, and the simulated one, for each count."""
    found = []
    part = cube.sel(structure=body)
    for i in range(cube.sizes["count"]):
        expected = part["thesis_expected"].values[:, i]
        if np.isnan(expected).all():
            found.append(("—", np.nan, np.nan))
            continue
        best = int(np.nanargmin(expected))
        found.append(
            (
                str(cube["thesis_case"].values[best]),
                float(expected[best]),
                float(part["thesis_simulated"].values[best, i]),
            )
        )
    return found


def against_thesis(cube: xr.Dataset) -> str:
    """Planned layouts beside the best of the thesis with as many cameras."""
    rows = []
    for body, question in THESIS.items():
        one = coarse(cube, question)
        for i, (case, own, drawn) in enumerate(_best_of_thesis(cube, body)):
            expected, bound = (float(one[name][i]) for name in ("expected_error", "bound"))
            simulated = float(one["simulated_error"][i].max())
            rows.append(
                [
                    body,
                    str(int(cube["count"][i])),
                    case,
                    _text(own),
                    _text(expected),
                    _text(100 * (1 - expected / own)),
                    _text(bound),
                    _text(drawn),
                    _text(simulated),
                ]
            )
    header = [
        "",
        "cameras",
        "best case of the thesis",
        "its error",
        "planned",
        "less by, %",
        "bound",
        "simulated: thesis",
        "planned",
    ]
    width, height = asked(cube, "resolutions_px")[0]
    return table(header, rows) + (
        f"\nErrors of the worst mode in % of its largest deflection, {width}×{height} px, averaged "
        "over amplitudes. No layout on the grid of the search is below the *bound*; one off the "
        "grid may be, by little. The last two columns are simulated at the amplitude asked for. "
        "Here markers are read from any side.\n\n" + with_readable(cube)
    )


def with_readable(cube: xr.Dataset) -> str:
    """Return sentences on the plan whose markers can be read against the thesis's best."""
    worse, pairs, read = 0, 0, []
    for body in THESIS:
        plan = coarse(cube, f"{body}: markers that can be read")["expected_error"].values
        own = cube.sel(structure=body)
        for i, planned in enumerate(plan):
            expected = own["thesis_expected"].values[:, i]
            if np.isnan([planned, np.nanmin([*expected, np.inf])]).any():
                continue
            pairs, best = pairs + 1, int(np.nanargmin(expected))
            worse += bool(planned > expected[best])
            read.append(100 * float(own["thesis_read_fraction"].values[best, i]))
    if not pairs:
        return ""
    return (
        f"With markers that are read up to {asked(cube, 'tilt_deg'):g}° from their normal the plan "
        f"has a larger error than the thesis's best in {worse} of {pairs}. The thesis's best "
        f"layouts are no alternative then: their cameras read {min(read):.0f} to {max(read):.0f} % "
        "of the markers on average.\n"
    )


def limits(cube: xr.Dataset) -> str:
    """What limits on places cost."""
    counts = [int(n) for n in cube["count"].values]
    rows = []
    for question in cube["question"].values.tolist():
        body = str(question).partition(":")[0]
        free = coarse(cube, THESIS[body])["expected_error"].values
        own = coarse(cube, question)["expected_error"].values
        cells = [
            _text(e) + ("" if np.isnan(more) or abs(more) < TIE else f" ({_change(more)})")
            for e, more in zip(own, own / free - 1, strict=True)
        ]
        rows.append([str(question), *cells])
    tilt = asked(cube, "tilt_deg")
    return (
        "Errors in %, averaged over amplitudes, and how much more than in the first row of the "
        "structure. In the first row a marker is read from any side; in all others up to "
        f"{tilt:g}° from its normal. With a wall or a machine cameras may stand nearer or farther, "
        "too.\n\n"
    ) + table(["", *(f"{n} cameras" for n in counts)], rows)


def _change(share: float) -> str:
    """A change as a share, in percent with its sign."""
    return f"{100 * share:+.0f} %".replace("-", "−")


def front(cube: xr.Dataset) -> str:
    """The options on the front of one question."""
    one = cube.sel(question=FRONT)
    order = np.argsort(one["cost"].values, kind="stable")
    rows = [
        {
            "cameras": str(int(one["n_cameras"][i])),
            "pixels": f"{int(one['width_px'][i])}×{int(one['height_px'][i])}",
            "million pixels/s": f"{float(one['cost'][i]) / 1e6:.0f}",
            "averaged, %": _text(float(one["expected_error"][i])),
            "predicted, %": _text(float(one["predicted_error"][i].max())),
            "simulated, %": _text(float(one["simulated_error"][i].max())),
        }
        for i in order
        if one["on_front"].values[i] == 1
    ]
    return columns(rows)


def targets(cube: xr.Dataset) -> str:
    """The cheapest layout that reaches the target, question by question."""
    target = asked(cube, "target_percent")
    rows = []
    for question in cube["question"].values.tolist():
        one = cube.sel(question=question)
        best = cheapest(one, target)
        if best is None:
            rows.append([str(question), "none", "", "", "", ""])
            continue
        at = one.isel(option=best)
        rows.append(
            [
                str(question),
                str(int(at["n_cameras"])),
                f"{int(at['width_px'])}×{int(at['height_px'])}",
                f"{float(at['cost']) / 1e6:.0f}",
                _text(float(at["predicted_error"].max())),
                _text(float(at["simulated_error"].max())),
            ]
        )
    header = ["", "cameras", "pixels", "million pixels/s", "predicted, %", "simulated, %"]
    return table(header, rows) + f"\nThe target is {target:g} % in the worst mode.\n"


def verification(cube: xr.Dataset) -> str:
    """Simulated over predicted errors, over all options and modes of a structure."""
    rows = []
    for body in THESIS:
        some = [q for q in cube["question"].values.tolist() if str(q).startswith(body)]
        part = cube.sel(question=some)
        ratio = (part["simulated_error"] / part["predicted_error"]).values.ravel()
        ratio = ratio[np.isfinite(ratio)]
        rows.append(
            {
                "simulated over predicted": body,
                "layouts × modes": str(len(ratio)),
                "least": f"{ratio.min():.3f}",
                "median": f"{np.median(ratio):.3f}",
                "largest": f"{ratio.max():.3f}",
            }
        )
    planned, own = (
        cube[name].values[np.isfinite(cube[name].values)]
        for name in ("averaged_law_ratio", "thesis_averaged_law_ratio")
    )
    low, high = AMPLITUDES
    return columns(rows) + (
        "\nThe averaged error, by which layouts are searched, gives every coordinate σ². By the "
        f"law of rounding, averaged over {low:g} to {high:g} times the amplitude, errors are "
        f"×{planned.min():.2f} to ×{planned.max():.2f} of it for the planned layouts (median "
        f"×{np.median(planned):.2f}) and ×{own.min():.2f} to ×{own.max():.2f} for the thesis's, "
        "least for narrow pairs.\n"
    )


def for_sound(cube: xr.Dataset) -> str:
    """Field errors of layouts for the shape and for the sound, and what that costs the shape."""
    rows = []
    for i, count in enumerate(cube["count"].values.tolist()):
        one = cube.isel(count=i)
        before, after = one["sound_error"].max("mode").values
        drawn = one["sound_simulated"].max("mode").values
        shape = one["sound_shape_error"].values
        cells = [f"{_text(a)} ({_text(b)})" for a, b in zip((before, after), drawn, strict=True)]
        gain = "—" if np.isnan(after) else _change(after / before - 1)
        rows.append([str(count), *cells, gain, *map(_text, shape)])
    kinds = ("planned for the shape", "planned for the sound")
    header = ["cameras", *(f"field, {one}" for one in kinds), "change"]
    header += [f"shape, {one}" for one in kinds]
    width, height = asked(cube, "resolutions_px")[0]
    return (
        "Errors of the field as predicted (simulated), for the plate's worst mode on its worse "
        f"plane in a rigid wall, in % of the largest pressure there, {width}×{height} px; then "
        "errors of the shape, in % of its largest deflection.\n\n"
    ) + table(header, rows)


def near(cube: xr.Dataset, question: str, count: int) -> int:
    """The option of a question with about as many cameras."""
    counts = cube.sel(question=question)["n_cameras"].values
    return int(np.argmin(np.abs(counts - count)))


TABLES: dict[str, Callable[[xr.Dataset], str]] = {
    "thesis": against_thesis,
    "limits": limits,
    "front": front,
    "targets": targets,
    "verification": verification,
    "sound": for_sound,
}
PIECES = TABLES


def show(cube: xr.Dataset, name: str) -> Markdown:
    """One of :data:`TABLES`, for a notebook."""
    return Markdown(TABLES[name](cube))


def view(cube: xr.Dataset) -> HTML:
    """Every planned layout, to be turned, for a notebook."""
    plans = []
    for question in cube["question"].values.tolist():
        one = cube.sel(question=question)
        found = np.flatnonzero(np.isfinite(one["cost"].values))
        first = int(np.searchsorted(found, near(cube, question, DRAWN)))
        plans.append((str(question), one.isel(option=found), first))
    return HTML(layout_view(plans))
