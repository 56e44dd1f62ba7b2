"""Evidence on trends: the figure sets, and runs of layouts that the thesis only mentions.

A *source* is one or more studies whose errors become :class:`thesis_lib.ledger.verdicts.Series`.
Besides the figure sets there are, for beam and plate: pairs added in the other order, arcs tilted
to the side, cameras added one by one, the aperture at other distances and elevations, and layouts
that are near or far, low or high, wide or narrow, of few or many cameras.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.figure_sets.claims.figure_set import OwnRuns
from thesis_lib.figure_sets.parametric import compute as studies
from thesis_lib.figure_sets.parametric.camera_study import CameraStudy
from thesis_lib.figure_sets.parametric.figure_set import camera_study
from thesis_lib.ledger.verdicts import Series, series_of
from thesis_lib.studies.request import Study, study_command
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.vibration.structure import deflection_shape, world_points
from thesis_lib.vision import rounding
from thesis_lib.vision.simulation import measure_deflections, percent_errors

TILTS_DEG = (0, 15, 30, 45)
WIDE_DEG, NARROW_DEG = (30, 40, 50, 60, 70, 80), (3, 5, 7, 9, 11, 13)  # half apertures, of pairs
LOW_DEG, HIGH_DEG, FAR_RATIO = 10, 60, 2
ASKEW_PLATE = "plate-askew"
ASKEW_MODES = (1, 2, 3)  # plate modes whose sum has no plane of symmetry

VARIABLES = read_variables(__file__, "own_runs")


@dataclass(frozen=True)
class Source:
    """Studies to run, and how their errors are read."""

    requests: tuple[Study, ...]  #: What to run
    #: From the cubes, in the order of the requests, to series
    read: Callable[[Sequence[xr.Dataset]], list[Series]]

    @property
    def commands(self) -> list[str]:
        """Commands that build the same cubes."""
        return [study_command(study) for study in self.requests]


def _read_one(name: Callable[[str], str], made: Sequence[xr.Dataset]) -> list[Series]:
    return [series for cube in made for series in series_of(cube, name)]


def _across(values: Sequence[float], made: Sequence[xr.Dataset]) -> list[Series]:
    """Return one series for each setting, over the studies that differ in one value."""
    runs = [series_of(cube) for cube in made]
    return [
        Series(
            first[0].quantity,
            f"{first[0].case} {label:g}",
            first[0].mode,
            np.array(values, float),
            np.array([one.errors[number] for one in first]),
        )
        for first in zip(*runs, strict=True)
        for number, label in enumerate(first[0].values)
    ]


def _at_each(values: Sequence[float], made: Sequence[xr.Dataset]) -> list[Series]:
    """Return the series of studies that differ in one value, each named after it."""
    return [
        replace(series, case=f"{series.case} at {value:g}")
        for value, cube in zip(values, made, strict=True)
        for series in series_of(cube)
    ]


def _by_layout(values: Sequence[float], made: Sequence[xr.Dataset]) -> list[Series]:
    """Return one series over the layouts of one study, each of which has one set of cameras."""
    by: dict[tuple[str, int], list[Array]] = {}
    for series in series_of(made[0]):
        by.setdefault((series.quantity, series.mode), []).append(series.errors[0])
    return [
        Series(quantity, "layouts", mode, np.array(values, float), np.array(errors))
        for (quantity, mode), errors in by.items()
    ]


def tilt_directions(
    directions_deg: Iterable[tuple[float, float]], tilt_deg: float
) -> list[list[float]]:
    """Turn the directions of an arc about the X axis, as [azimuth, elevation] in degrees.

    Examples
    --------
    >>> tilt_directions([(90.0, 60.0)], 30.0)  # cos 60°, sin 60° sin 30°, sin 60° cos 30°
    [[49.106605, 48.590378]]
    """
    turned = []
    turn = np.radians(tilt_deg)
    for azimuth, elevation in np.radians(list(directions_deg)):
        x = np.cos(elevation) * np.sin(azimuth)
        y = np.cos(elevation) * np.cos(azimuth)
        z = np.sin(elevation)
        y, z = y * np.cos(turn) + z * np.sin(turn), z * np.cos(turn) - y * np.sin(turn)
        turned.append(np.degrees([np.arctan2(x, y), np.arcsin(min(z, 1.0))]).round(6).tolist())
    return turned


def _layouts(structure: str, layouts: dict[str, Any], **more: Any) -> CameraStudy:
    return camera_study(f"{structure}-arrays", {"cases": [], "layouts": layouts, **more})


def _corners(structure: str) -> Source:
    """Return sixteen layouts: few or many, low or high, wide or narrow, near or far."""
    near = setups.setup_table(structure, "arrays")["distance_mm"]
    layouts: dict[str, Any] = {}
    for n, phi, half in product(("few", "many"), ("low", "high"), ("wide", "narrow")):
        halves = WIDE_DEG if half == "wide" else NARROW_DEG
        middle = [(halves[2] + halves[3]) / 2]
        elevation = LOW_DEG if phi == "low" else HIGH_DEG
        pairs = halves if n == "many" else middle
        cameras = [[side * azimuth, elevation] for azimuth in pairs for side in (1, -1)]
        layouts[f"{n} {phi} {half}"] = [cameras]
    runs = [_layouts(structure, layouts, distance_mm=d) for d in (near, FAR_RATIO * near)]

    def read(made: Sequence[xr.Dataset]) -> list[Series]:
        near_, far = made
        close = series_of(near_, lambda case: f"{case} near")
        return close + series_of(far, lambda case: f"{case} far")

    return Source(tuple(runs), read)


def _structure_sources(structure: str) -> dict[str, Source]:
    """Return the ledger's own runs for beam or plate."""
    order = camera_study(
        f"{structure}-arrays",
        {"cases": ["4b", "4d"], "pair_order": {"4b": "reversed", "4d": "printed"}},
    )
    pairs = setups.camera_pairs()
    arc = [camera for pair in pairs["4b"] for camera in pair]
    tilts = {f"tilt {tilt}": [tilt_directions(arc, tilt)] for tilt in TILTS_DEG}
    grown = [list(camera) for pair in pairs["4a"] for camera in pair]
    singly = {"4a-singly": [grown[:n] for n in range(2, len(grown) + 1)]}
    distances = setups.setup_table(structure, "distance")["distances_mm"]
    aperture = partial(camera_study, f"{structure}-aperture")
    elevations = setups.setup_table(structure, "aperture")["elevations_deg"]
    low = [aperture({"cases": ["2a", "2c"], "elevation_deg": phi}) for phi in elevations]
    other = {"4b": "4b-reversed", "4d": "4d-printed"}
    return {
        f"{structure}-other-order": Source((order,), partial(_read_one, other.__getitem__)),
        f"{structure}-tilted": Source(
            (_layouts(structure, tilts),), partial(_by_layout, TILTS_DEG)
        ),
        f"{structure}-singly": Source((_layouts(structure, singly),), partial(_read_one, str)),
        f"{structure}-apart": Source(
            tuple(aperture({"distance_mm": d}) for d in distances), partial(_at_each, distances)
        ),
        f"{structure}-elevation": Source(tuple(low), partial(_across, elevations)),
    }


def _askew(study: CameraStudy) -> list[Series]:
    """Measure a plate's first mode, and a sum of modes without symmetry, by cameras of 4a."""
    plate, peak = study.structure, study.peaks_m[0]
    plain = deflection_shape(plate, 1, plate.markers, peak)
    askew = np.sum(
        [deflection_shape(plate, mode, plate.markers, peak) for mode in ASKEW_MODES], axis=0
    )
    shapes = np.stack([0 * plain, plain, askew * (np.abs(plain).max() / np.abs(askew).max())])
    points = world_points(plate, shapes)
    mean, largest = [], []
    settings = study.settings()
    for setting in settings:
        cameras = setting.cameras(study.focal_length_mm, study.sensor_width_mm)
        shifts = rounding.grid_shifts(study.seed, study.trials, len(cameras))
        measured = measure_deflections(cameras, points, shifts)
        _, rms, most = percent_errors(measured, shapes[1:])
        mean.append(rms[:, 1:])
        largest.append(most[:, 1:])
    varied = np.array([float(setting.value) for setting in settings])
    return [
        Series(quantity, case, 1, varied, np.array(errors)[:, number])
        for quantity, errors in (("mean_error", mean), ("max_point_error", largest))
        for number, case in enumerate(("plain", "askew"))
    ]


def own_sources() -> dict[str, Source]:
    """Return the ledger's own runs, by name, without ``ASKEW_PLATE``."""
    return {
        **_structure_sources("beam"),
        **_structure_sources("plate"),
        "beam-corners": _corners("beam"),
    }


def run(study: OwnRuns) -> xr.Dataset:
    """Compute all own runs as one dataset: ``errors(series, setting, trial)``, padded with NaN."""
    draws = {"trials": study.trials, "seed": study.seed}
    found: list[tuple[str, Series]] = []
    for name, source in own_sources().items():
        requests = [camera_study(one.name, {**one.request, **draws}) for one in source.requests]
        cubes = [studies.run(one).assign_attrs(figure_set=one.name) for one in requests]
        found += [(name, series) for series in source.read(cubes)]
    askew = camera_study("plate-arrays", {"cases": ["4a"], **draws})
    found += [(ASKEW_PLATE, series) for series in _askew(askew)]
    most = max(len(series.values) for _, series in found)
    values = np.full((len(found), most), np.nan)
    errors = np.full((len(found), most, study.trials), np.nan, "float32")
    for row, (_, series) in enumerate(found):
        values[row, : len(series.values)] = series.values
        errors[row, : len(series.values)] = series.errors
    coords = {
        "source": [name for name, _ in found],
        "quantity": [series.quantity for _, series in found],
        "case": [series.case for _, series in found],
        "mode": [series.mode for _, series in found],
    }
    made = {"errors": errors, "values": values}
    return xr.Dataset(label_values(made, VARIABLES), label_values(coords, VARIABLES))


def read_own(made: xr.Dataset) -> dict[str, list[Series]]:
    """Read the series back from a dataset of :func:`run`, by the name of the run."""
    by: dict[str, list[Series]] = {}
    columns = (made[name].values for name in ("source", "quantity", "case", "mode"))
    kept = np.isfinite(made["values"].values)
    for row, (source, quantity, case, mode) in enumerate(zip(*columns, strict=True)):
        here = kept[row]
        errors = made["errors"].values[row, here].astype(float)
        series = Series(quantity, case, int(mode), made["values"].values[row, here], errors)
        by.setdefault(str(source), []).append(series)
    return by
