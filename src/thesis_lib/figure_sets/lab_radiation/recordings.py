"""Recordings of structures that sound, measured from end to end: amplitudes and their errors.

For every recording the cameras are aimed anew and calibrated from pictures of a board. Markers are
followed from corners that are marked to a pixel; harmonics are fitted and triangulated by the
cameras as calibrated. Only the clocks are known. What is kept of a recording is what its sound is
made of: amplitudes of the markers, how they scatter, and what errors of the calibration do to all
of them together.
"""

from __future__ import annotations

from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.arrays import ComplexArray
from thesis_lib.figure_sets.lab_radiation.parameters import Radiation
from thesis_lib.figure_sets.lab_radiation.structures import Driven, driven
from thesis_lib.files import code, workplace
from thesis_lib.laboratory import direct, outlined
from thesis_lib.laboratory.recordings import film_seed, sensor, settled
from thesis_lib.laboratory.rig import Rig, default_rig
from thesis_lib.measure.calibration.jackknife import of_cameras
from thesis_lib.measure.calibration.rig import alike
from thesis_lib.measure.calibration.zhang import CalibrationError
from thesis_lib.measure.fitting.calibration_error import common_errors
from thesis_lib.measure.fitting.consistency import excess, in_plane
from thesis_lib.measure.fitting.harmonics import amplitude, deviation
from thesis_lib.studies import reach
from thesis_lib.studies.cache import kept
from thesis_lib.studies.parallel import abreast
from thesis_lib.studies.variables import declared, labelled

ROWS = 2  # of what errors of the calibration do, the largest ones
VARIABLES = declared("""
    amplitude_real(point) [m] complex amplitude against the force, real part
    amplitude_imag(point) [m] the same, imaginary part
    scatter(point) [m] standard deviation of either part by the scatter of the centres
    shared_real(row, point) [m] what independent errors of the calibration, of one standard
        deviation each, add to all markers together, real part
    shared_imag(row, point) [m] the same, imaginary part
    shared_kept() [1] share of the variance by the calibration that these rows have
    excess() [1] rms motion in the plane over what scatter explains
    centre_scatter() [px] scatter of the centres about their harmonics
    missing() [1] share of the marker images that are missing
    board_views() [1] pictures of the board that were used, of all
""")


def rig_of(film: Radiation, case: str, recording: int) -> Rig:
    """What sees one recording: cameras, the board's poses, the structure with its tone."""
    own, distance = driven(case), film.distance_mm(case) / 1000
    seed = film_seed(film.seed, case, recording)
    draw = np.random.default_rng([seed, 7])
    rig = default_rig(
        own.structure,  # type: ignore[arg-type]  # any with modes
        film.directions,
        focal_length=film.focal_length_mm / 1000,
        sensor_width=film.sensor_width_mm / 1000,
        distance=distance,
        size=film.size,
        sensor=sensor(film),  # type: ignore[arg-type]  # it has all that is asked for
        frame_rate=film.frame_rate_hz,
        components=own.components(film.amplitude_mm / 1000),
        lens_k1=film.lens_k1,
        seed=seed,
        markers=own.markers,
    )
    rig = outlined.aimed(rig, distance, draw)
    return settled(rig, draw.random(len(film.directions)).tolist(), film.frames)


def measured(film: Radiation, case: str, recording: int) -> xr.Dataset:
    """One recording, rendered and measured; NaN where cameras or markers are not found."""
    rig, own = rig_of(film, case, recording), driven(case)
    sizes = {"row": ROWS, "point": most_markers(film)}
    values = {
        name: np.full([sizes[dim] for dim in one.dims], np.nan) for name, one in VARIABLES.items()
    }
    try:
        found = _measured(film, rig, own)
    except (CalibrationError, ValueError):  # a result, too: these cameras tell nothing
        found = {}
    for name, given in found.items():
        each = values[name][..., : np.shape(given)[-1]] if np.ndim(given) else values[name]
        each[...] = given
    return xr.Dataset(labelled(values, VARIABLES))


def most_markers(film: Radiation) -> int:
    """Of any of the structures."""
    return max(driven(case).markers.count for case in film.cases)


def _measured(film: Radiation, rig: Rig, own: Driven) -> dict[str, Any]:
    """What one recording tells."""
    omega, exposure = 2 * np.pi * own.frequency, film.exposure_ms / 1000
    calibration = outlined.calibrated(rig)
    rig, cameras = outlined.cropped(rig, calibration.cameras)
    views = outlined.marked(rig, cameras, own.corners)
    seen = [outlined.followed(rig, index, view, own.corners) for index, view in enumerate(views)]
    fit = direct.fit_of(outlined.seen_by(rig, cameras), seen, omega)
    exposures = np.full(len(cameras), exposure)
    thickness = own.structure.thickness
    moved, allowed = in_plane(fit, omega, exposures, own.markers.centres, thickness)
    wide = excess(moved, allowed)
    shared = common_errors([fit], own.markers, [omega], exposures, of_cameras(calibration))[:, 0]
    force = np.exp(-1j * (omega * rig.motion.start + np.pi / 2))
    found, rows = amplitude(fit, omega, exposures) / force, shared[:ROWS] / force
    return {
        "amplitude_real": found.real,
        "amplitude_imag": found.imag,
        "scatter": max(wide, 1.0) * deviation(fit, omega, exposures),
        "shared_real": rows.real,
        "shared_imag": rows.imag,
        "shared_kept": _power(rows) / _power(shared),
        "excess": wide,
        "centre_scatter": np.sqrt(np.nanmean(fit.sigma**2)),
        "missing": np.mean([one.missing for one in seen]),
        "board_views": np.isfinite(calibration.residuals[:, :, 0, 0]).mean(),
    }


def _power(rows: ComplexArray) -> float:
    return float(np.sum(np.abs(rows) ** 2))


def made(film: Radiation, case: str, recording: int) -> xr.Dataset:
    """What :func:`measured` finds, kept in ``build/cache`` so that a run can go on after a stop."""
    rests_on = b"".join(code(file) for file in sorted(reach.reached(Path(__file__))))
    folder = workplace() / "build" / "cache" / f"{film.name}-{film.digest}"
    path = folder / f"{case}-{recording}.nc"
    return kept(path, partial(measured, film, case, recording), sha256(rests_on).hexdigest())


def run(film: Radiation) -> xr.Dataset:
    """All recordings: the first of every structure, then the second, and so on.

    Returns
    -------
    xarray.Dataset
        :data:`VARIABLES` along ``case``, in the order of ``film.cases``, and ``trial``.
    """
    trials = range(film.trials + 1)
    jobs = [(case, recording) for recording in trials for case in film.cases]
    with alike():
        done = iter(abreast(lambda job: made(film, *job), jobs))
    rows = [xr.concat([next(done) for _ in film.cases], "case") for _ in trials]
    data = xr.concat(rows, "trial").transpose("case", "trial", "row", "point")
    return data.astype("float32").drop_attrs(deep=False)
