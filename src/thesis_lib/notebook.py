"""What the notebooks call: parameters in, cube out, tables and figures to show."""

from __future__ import annotations

import ast
import base64
import html
import sys
import warnings
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from IPython.display import HTML, SVG, Markdown, display

from thesis_lib import (
    claims,
    cubes,
    design_study,
    effort,
    figures,
    files,
    optics_study,
    schedulers,
    sound,
    storage,
    studies,
)
from thesis_lib.design_request import DesignLaw
from thesis_lib.experiment.lab_layouts import Layouts
from thesis_lib.experiment.lab_motions import LabModes
from thesis_lib.experiment.lab_plates import LabPlate
from thesis_lib.experiment.requests import Experiment
from thesis_lib.ledger_requests import Claims
from thesis_lib.markdown import escape, markdown_table
from thesis_lib.optics_request import Cameras
from thesis_lib.parameters import (
    STUDIES,
    CameraStudy,
    ParameterError,
    Study,
    camera_study,
    validate,
)
from thesis_lib.planning import planner_study
from thesis_lib.planning.questions import Planner
from thesis_lib.viewer_data import viewer_data
from thesis_lib.widgets import Viewer


def study(name: str, namespace: Mapping[str, Any]) -> xr.Dataset:
    """Run a figure set with the parameters found in a notebook's namespace.

    Parameters
    ----------
    name : str
        Name of the figure set.
    namespace : mapping
        The notebook's ``globals()``.

    Returns
    -------
    xarray.Dataset
        The cube; also written to the file that the parameter `cube` names, if any.

    Raises
    ------
    ParameterError
        If a value is refused, or papermill has injected a parameter that there is not.
    """
    fields = STUDIES[name].model_fields
    for variable in _injected(namespace.get("In", [])):
        if variable not in fields:
            validate(name, {variable: None})  # which says what is wrong with the name
    request = validate(name, {field: namespace[field] for field in fields if field in namespace})
    scheduler = _scheduler(request)
    if isinstance(request, CameraStudy):
        result = camera_cube(request, scheduler)
    else:
        seconds = effort.stopwatch()
        result = _computed(request)
        result = cubes.with_provenance(result, request, seconds())
    if request.cube:  # an absolute path stands
        storage.write(result, files.project_root() / request.cube, compact=True)
    return result


def _injected(inputs: Iterable[str]) -> list[str]:
    """Names that the cell which papermill injects has set, from a kernel's history of inputs."""
    return [
        target.id
        for source in inputs
        if source.startswith("# Parameters\n")
        for statement in ast.parse(source).body
        if isinstance(statement, ast.Assign)
        for target in statement.targets
        if isinstance(target, ast.Name)
    ]


def _scheduler(request: Study) -> str:
    """What ``THESIS_SCHEDULER`` asks for, if the study can be cut into pieces."""
    try:
        scheduler = schedulers.from_environment()
    except ValueError as error:
        raise ParameterError(str(error)) from None
    if scheduler and not isinstance(request, CameraStudy):
        print(schedulers.alone(request.name), file=sys.stderr)
        return ""
    return scheduler


def _computed(request: Study) -> xr.Dataset:
    if isinstance(request, Experiment | Layouts | LabModes | LabPlate):
        return _of_recordings(request)
    if isinstance(request, Claims):
        return ledger_of(request)
    if isinstance(request, Cameras):
        return optics_study.run(request)
    if isinstance(request, DesignLaw):
        return design_study.run(request)
    if isinstance(request, Planner):
        return planner_study.run(request)
    assert isinstance(request, CameraStudy)
    return camera_cube(request)


def _of_recordings(request: Study) -> xr.Dataset:
    """A figure set of chapter 5, whose modules need video and picture libraries."""
    from thesis_lib.experiment import (
        lab_layout_study,
        lab_modes_study,
        lab_plate_study,
        recorded,
        study,
    )

    data = recorded.measured(recorded.laboratory(request))
    if isinstance(request, Experiment):
        return study.run(request, data)
    if isinstance(request, Layouts):
        return lab_layout_study.run(request, data)
    if isinstance(request, LabModes):
        return lab_modes_study.run(request, data)
    assert isinstance(request, LabPlate)
    return lab_plate_study.run(request, data)


def camera_cube(request: CameraStudy, scheduler: str = "") -> xr.Dataset:
    """The cube of a camera study or, from the plate's deflections, of a sound study.

    What is too large to be held, and the plate's cubes, which sound needs, are kept in a cache.
    """
    if request.subject == "plate":
        return cubes.cached(request, partial(studies.outline, scheduler=scheduler))
    seconds = effort.stopwatch()
    if request.subject == "sound":
        plate = camera_study(request.name.replace("sound", "plate"), request.plate_request)  # type: ignore[attr-defined]
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "k times the size of a piston")  # the table says so
            made = sound.outline(request, camera_cube(plate, scheduler), scheduler)
    else:
        made = studies.outline(request, scheduler)
    if not made.is_held:
        return cubes.cached(request, lambda _: made)
    cube = made.in_memory()
    return cubes.with_provenance(cube, request, seconds())


def ledger_of(request: Claims) -> xr.Dataset:
    """The ledger's cube, from the book's cubes; one that is missing or outdated is made here."""
    from thesis_lib import ledger, ledger_cube, ledger_power, ledger_runs, readings

    opened: dict[str, xr.Dataset] = {}

    def open_cube(study: Study) -> xr.Dataset:
        if study.name not in opened:
            made = ledger.built(study)
            if isinstance(made, str):
                made = cubes.with_provenance(_computed(study), study, 0.0)
            opened[study.name] = made
        return opened[study.name]

    own = cubes.cached(request.own_runs, ledger_runs.run)
    other = cubes.cached(request.other_readings, readings.run)
    found = ledger.entries(open_cube, ledger_runs.read_own(own))
    tested = ledger_power.power(lambda name: open_cube(STUDIES[name]()), claims.read_claims())
    return ledger_cube.as_cube(found, other.merge(tested))


def error_table(cube: xr.Dataset) -> Markdown:
    """Errors by setting and mode: trial 0, median, 5–95 % band, law of rounding."""
    table = cubes.summary(cube).set_index(["error", "mode"])
    columns = {}
    for mode in cube["mode"].values.tolist():
        for error, (_, plane) in cubes.ERRORS.items():
            if (error, mode) not in table.index or error == "max_point_error":
                continue
            law = cubes.predicted(cube, error).sel(mode=mode)
            rows = table.loc[[(error, mode)]].to_dict("records")
            columns[f"mode {mode}" + (f", {plane}" if plane else "")] = [
                _of_larger(cube, number, mode, plane) if np.isnan(row["trial_0"]) else
                f"{cubes.percent_text(row['trial_0'])} · "
                f"{cubes.band_text(row['median'], row['low'], row['high'])}"
                f" · {cubes.percent_text(value)}"
                for number, (row, value) in enumerate(zip(rows, law.values, strict=True))
            ]  # fmt: skip
    cases, labels = cube["case"].values.tolist(), cube["label"].values.tolist()
    shares = [f"{share:.0%}" for share in cube["in_view"].values]
    rows_ = [list(row) for row in zip(cases, labels, *columns.values(), shares, strict=True)]
    study = STUDIES[cube.attrs["figure_set"]]
    reference = "pressure of the plane" if "plane_error" in cube else "deflection"
    notes = [
        f"Each cell: {study.first} · median (5–95 %) of the trials · {cubes.predicts(cube)}, in % "
        f"of the largest reference {reference}."
    ]
    if "plane_error" in cube:
        notes.append(
            "*Nodal*: the plane has no reference pressure; in brackets the median of its error in "
            "% of the other plane's."
        )
    cut = [
        escape(f"{row[0]}, {row[1]} ({row[-1]})")
        for row, share in zip(rows_, cube["in_view"].values, strict=True)
        if share < 1
    ]
    if cut:
        notes.append(
            "Markers leave the sensor, and are computed all the same, in: " + "; ".join(cut) + "."
        )
    if "missing" in cube and float(cube["missing"].max()) > 0:
        rare = [
            escape(f"{row[0]}, {row[1]} ({share:.0%})")
            for row, share in zip(rows_, cube["missing"].values[:, 0, 0], strict=True)
            if share > 0
        ]
        notes.append("Markers that no two cameras see are left out, in: " + "; ".join(rare) + ".")
    if "piston_size" in cube and float(cube["piston_size"].max()) > 1:
        notes.append(
            "The pistons are large against the wavelength (wavenumber times size up to "
            f"{float(cube['piston_size'].max()):.2f}): above 1 take a finer grid."
        )
    return markdown_table(["case", "setting", *columns, "in view"], rows_, "\n\n".join(notes))


def _of_larger(cube: xr.Dataset, setting: int, mode: int, plane: str | None) -> str:
    """The error on a nodal plane, of the other plane's pressure, which is not NaN as a rule."""
    values = cube["plane_error_of_larger"].isel(setting=setting).sel(mode=mode, plane=plane)
    drawn = values.values[1:] if values.size > 1 else values.values
    return "nodal" if np.isnan(drawn).any() else f"nodal [{np.median(drawn):.1f}]"


def tracking_table(cube: xr.Dataset) -> Markdown:
    """How tracking fares at every width: missing, taken for another, and how exact the rest is."""
    rows = [
        [
            f"{width}×{round(width * 9 / 16)}",
            f"{missing:.1%}",
            "—" if np.isnan(wrong) else f"{wrong:.1%}",
            "—" if np.isnan(error) else f"{error:.3f}",
        ]
        for width, missing, wrong, error in zip(
            *(cube[f"tracked_{name}" if name == "width" else f"tracking_{name}"].values
              for name in ("width", "missing", "wrong", "error")), strict=True)
    ]  # fmt: skip
    header = ["frames", "missing", "of those found, off by more than 1 px",
              "rms error of the rest, px"]  # fmt: skip
    note = "All marker images of all cameras and frames."
    if "shots_used" in cube:
        used = ", ".join(f"{int(n)}" for n in cube["shots_used"].values)
        note += f" Pictures of the board that calibration could use, by camera: {used}."
    return markdown_table(header, rows, note)


def harmonic_table(cube: xr.Dataset, case: str = "harmonic") -> Markdown:
    """Amplitude, phase and standard error of some markers, and the drive-point mobility."""
    part = cube.isel(setting=np.flatnonzero(cube["case"].values == case), mode=0)
    if part.sizes["setting"] == 0:
        return Markdown("The harmonic fit was not asked for.")
    last = part.isel(setting=-1)
    reference = cube["reference_deflection"].values[0] * 1000
    rows = [
        [
            f"{1000 * float(last['x'][i]):.1f}",
            f"{1000 * float(last['amplitude'][i]):.4f}",
            f"{1e6 * float(last['standard_error'][i]):.2f}",
            f"{abs(reference[i]):.4f}",
            f"{float(last['phase'][i]):.2f}",
        ]
        for i in (*range(0, last.sizes["point"], 4),)
    ]
    model = complex(*cube["mobility_reference"].values)
    found = complex(float(last["mobility_real"]), float(last["mobility_imag"]))
    note = (
        f"{last['label'].item()}. Drive-point mobility: {1000 * found.real:.3f} "
        f"{1000 * found.imag:+.3f}j mm/(N s), of the model {1000 * model.real:.3f} "
        f"{1000 * model.imag:+.3f}j: {100 * abs(found / model - 1):.2f} % apart."
    )
    header = ["x, mm", "amplitude, mm", "standard error, µm", "true, mm", "phase to the force, °"]
    return markdown_table(header, rows, note)


def claims_table(cube: xr.Dataset, only_misses: bool = True) -> Markdown:
    """The thesis's stated figures beside the band of the trials."""
    if cube.sizes["trial"] == 1:
        return Markdown("Without trials there is no band to hold the stated figures against.")
    checks = claims.check(cube, claims.claims_of(cube.attrs["figure_set"]))
    if not checks:
        return Markdown("The thesis states no figure for these settings.")
    counts = []
    for quantity, word in cubes.SHORT.items():
        of_kind = [check for check in checks if check.claim.quantity == quantity]
        if of_kind:
            met = sum(check.inside for check in of_kind)
            counts.append(f"{met} of {len(of_kind)} stated {word} errors")
    shown = [check for check in checks if not (only_misses and check.inside)]
    rows = [
        [
            check.claim.figure, check.claim.case, str(check.claim.mode),
            ", ".join(f"{value:g}" for value in check.claim.values) or "all",
            cubes.SHORT[check.claim.quantity] + (" but one" if check.claim.excepted else ""),
            check.claim.stated, cubes.percent_text(check.literal),
            f"{cubes.percent_text(check.low)}–{cubes.percent_text(check.high)}",
            "yes" if check.inside else "no",
        ]
        for check in shown
    ]  # fmt: skip
    text = " and ".join(counts) + " meet the band of the trials."
    if only_misses and rows:
        text += " Those that do not:"
    header = ["figure", "case", "mode", "setting", "error", "thesis", "literal", "5–95 %", "met"]
    if any(not check.claim.values for check in shown):
        text += (
            " A claim about all settings must hold for each; the row shows the one farthest off."
        )
    return markdown_table(header, rows, text, above=True) if rows else Markdown(text)


def viewer(cube: xr.Dataset) -> Viewer:
    """The interactive viewer, in a live notebook and in the static page alike."""
    data = viewer_data(cube)
    return Viewer(data=data, case=data["cases"][0]["name"], mode=data["modes"][0]["mode"])


def figure(cube: xr.Dataset, case: str, mode: int) -> SVG | None:
    """The four-panel figure of a case and mode, or nothing if it was not run."""
    if not figures.has(cube, case, mode):
        return None
    return SVG(figures.as_svg(cube, case, mode), metadata={"case": case, "mode": mode})


def other_figures(cube: xr.Dataset, shown: Iterable[str], modes: Iterable[int] = (1, 2, 3)) -> None:
    """Display the figures of cases, layouts and modes that have no cell of their own."""
    own = {(case, mode) for case in shown for mode in modes}
    for case in dict.fromkeys(cube["case"].values.tolist()):
        for mode in cube["mode"].values.tolist():
            if (case, mode) not in own:
                display(Markdown(f"**{escape(case)}, mode {mode}**"))
                picture = base64.b64encode(figures.as_svg(cube, case, mode).encode()).decode()
                words = html.escape(f"The figure of {case} in mode {mode}, with the same panels")
                picture = f'<img alt="{words}" src="data:image/svg+xml;base64,{picture}">'
                display(HTML(picture, metadata={"case": case, "mode": mode}))
