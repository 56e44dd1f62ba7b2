"""Chapter 3 as it may have been computed: one function from what was done to all its errors.

The chain of ``parametric``, with every step open: cameras, motion,
rounding, estimator, and what is called an error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.facts.claims import Claim, read_claims
from thesis_lib.facts.readings import reading
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.misses.changes import PEAK_MM
from thesis_lib.figure_sets.parametric.parameters import camera_study
from thesis_lib.vibration.structure import deflection_shape, peak_deflection, world_points
from thesis_lib.vision.pinhole import CameraArray, hemisphere_cameras, pixelate, project
from thesis_lib.vision.rounding import grid_shifts
from thesis_lib.vision.triangulation import triangulate

MODES = (1, 2, 3)
STUDIES = ("beam-distance", "beam-aperture", "beam-resolution", "beam-arrays")
SENSOR_MM = 36.0
OTHER = {"printed": "reversed", "reversed": "printed"}
WHOLE = 1e-9  # px below a whole pixel that count as it, as in ``pixelate``


@dataclass(frozen=True)
class Model:
    """What may have been done; the defaults are what this book takes."""

    # Simulated:
    rounding: str | float = "nearest"  #: ``nearest``, another rule, or a step in px
    rest: str = "rebuilt"  #: ``rebuilt`` or ``known``
    frames: int = 1  #: Frames of a period: the largest deflection, both, or an even fit
    steps: int = 3  #: Of refinement after the linear equations
    peaks_mm: tuple[float, ...] | str = (PEAK_MM,) * 3  #: By mode, or ``force``: by 1 N
    focal_length_mm: float = 24.0  #: Of the lens, on a sensor 36 mm wide
    first_marker_mm: float = 11.5  #: From the clamp
    aim: str = "centre"  #: Where all cameras look: ``centre``, ``clamp`` or ``tip``
    distance: str = "slant"  #: What is given: ``slant``, along the ``ground``, or ``height``
    azimuth_zero: str = "Y"  #: ``Y`` or ``X``
    elevation_zero: str = "plane"  #: From the ``plane`` or its ``normal``
    # Summed up:
    deflection: str = "height"  #: ``height``, ``length`` of the way, or ``place``
    reference: str = "marker"  #: What errors are a percentage of
    mean: str = "rms"  #: ``rms``, ``absolute``, ``median`` or ``std``
    largest: str = "absolute"  #: ``absolute``, ``over``, ``under``, ``second`` or ``peak``
    turned: tuple[str, ...] = ()  #: Cases whose pairs are added in the other order

    def changed(self, *values: Mapping[str, Any]) -> Model:
        """The model with other values of some fields."""
        return replace(self, **{name: value for some in values for name, value in some.items()})

    @property
    def simulated(self) -> Model:
        """The same as far as images are concerned."""
        own = Model()
        return replace(
            self,
            deflection=own.deflection,
            reference=own.reference,
            mean=own.mean,
            largest=own.largest,
            turned=own.turned,
        )


@cache
def claims() -> tuple[Claim, ...]:
    """The stated values of chapter 3."""
    return tuple(claim for claim in read_claims() if claim.figure_set in STUDIES)


@cache
def _order(case: str) -> str:
    """In which order this book adds the pairs of a case."""
    return str(reading("beam")["pair_order"].get(case, "printed"))


@cache
def settings() -> tuple[tuple[str, Setting], ...]:
    """The settings that they speak of, each with its figure set, first pairs in both orders."""
    cases = list(setups.pairs())
    every = [(name, one) for name in STUDIES for one in camera_study(name).settings()]
    turned = camera_study("beam-arrays", {"pair_order": {c: OTHER[_order(c)] for c in cases}})
    every += [("beam-arrays", one) for one in turned.settings() if not _whole(one)]
    every = [  # all cameras of a case are the same in any order
        (name, replace(one, pair_order="") if _whole(one) else one) for name, one in every
    ]
    spoken = {(c.figure_set, c.case, value) for c in claims() for value in c.values or (None,)}
    return tuple(
        (name, one)
        for name, one in every
        if spoken & {(name, one.case, one.value), (name, one.case, None)}
    )


def _whole(setting: Setting) -> bool:
    """Whether all cameras of a case are there."""
    return setting.value == 2 * len(setups.pairs().get(setting.case, ()))


def cameras(model: Model, setting: Setting) -> CameraArray:
    """The cameras of a setting where the model has them."""
    azimuth, elevation = np.radians(setting.directions_deg).T
    if model.azimuth_zero == "X":
        azimuth = np.pi / 2 - azimuth
    if model.elevation_zero == "normal":
        elevation = np.pi / 2 - elevation
    by = {"slant": 1.0, "ground": np.cos(elevation), "height": np.sin(elevation)}[model.distance]
    width = setting.resolution_px[0]
    made = hemisphere_cameras(
        setting.distance_mm / 1000 / by,
        azimuth,
        elevation,
        model.focal_length_mm * width / SENSOR_MM,
        setting.resolution_px,
    )
    half = setups.beam().length / 2
    aim = {"centre": 0.0, "clamp": -half, "tip": half}[model.aim]
    return replace(made, centres=made.centres + np.array([aim, 0.0, 0.0]))


def rounded(how: str | float, uv: Array, shift: Array, middle: Array) -> Array:
    """Images (cameras, 2, ...) in px rounded on shifted grids."""
    if isinstance(how, float):
        return pixelate((uv + shift) / how) * how - shift
    if how == "towards the middle":
        off = uv + shift - middle
        return np.sign(off) * np.floor(np.abs(off) + WHOLE) + middle - shift
    if how == "down":
        return np.floor(uv + shift + WHOLE) - shift
    whole = pixelate(uv + shift) - shift
    if how in ("u", "v"):  # the other coordinate is exact
        exact = 1 if how == "u" else 0
        whole[:, exact] = uv[:, exact]
    return whole


def _phases(frames: int) -> tuple[Array, Array]:
    """Deflection over its largest in the frames of a period that are measured; weights of its fit.

    Frames of one deflection show the same pixels, and are taken once; the fit leaves out those
    without any.
    """
    numbers = np.arange(frames // 2 + 1)
    phases, alike = np.cos(2 * np.pi * numbers / frames), 2 - (2 * numbers % frames == 0)
    kept = np.abs(phases) > WHOLE
    return phases[kept], (alike * phases)[kept] / np.sum(alike * phases**2)


def simulate(model: Model, seed: int, trials: int, first: int = 0) -> tuple[Array, Array]:
    """Deflection shapes and what is measured of them, in m.

    Returns
    -------
    reference : ndarray, shape (modes, markers)
        Deflection at its largest.
    measured : ndarray, shape (settings, 3, modes, trials + 1 - first, markers)
        Displacements in space.
    """
    beam = setups.beam(model.first_marker_mm / 1000)
    reference = np.array(
        [
            deflection_shape(beam, mode, beam.markers, peak)
            for mode, peak in zip(MODES, _peaks(model), strict=True)
        ]
    )
    phases, weights = _phases(model.frames)
    shapes = (phases[:, None, None] * reference).reshape(-1, reference.shape[1])
    fitted = model.frames > 1  # which needs no rest position
    if not fitted:
        shapes = np.concatenate([0 * reference[:1], shapes])
    points = world_points(beam, shapes)
    found = []
    for _, setting in settings():
        rig = cameras(model, setting)
        shift = np.moveaxis(grid_shifts(seed, trials, len(rig), first), 0, 2)[:, :, None, :, None]
        middle = np.array(setting.resolution_px).reshape(1, 2, 1, 1, 1) / 2
        images = project(rig.P, points)[:, :, :, None]
        place = triangulate(rig.P, rounded(model.rounding, images, shift, middle), model.steps)
        if fitted:
            place = place.reshape(3, len(phases), len(MODES), *place.shape[2:])
            found.append(np.einsum("f,cf...->c...", weights, place))
        else:
            rest = points[:, :1, None] if model.rest == "known" else place[:, :1]
            found.append(place[:, 1:] - rest)
    return reference, np.array(found)


def errors(model: Model, reference: Array, measured: Array) -> Array:
    """What the model calls mean and largest error, and largest but one, in %.

    Of `reference` and `measured` as of :func:`simulate`: shape (errors, settings, modes, trials).
    """
    true = reference[:, None]
    if model.deflection == "height":
        wrong = measured[:, 2] - true
    elif model.deflection == "length":
        wrong = np.linalg.norm(measured, axis=1) - np.abs(true)
    else:
        wrong = np.sqrt(np.sum(measured[:, :2] ** 2, axis=1) + (measured[:, 2] - true) ** 2)
    whole = {
        "marker": lambda: np.abs(true).max(-1, keepdims=True),
        "tip": lambda: _peaks(model)[:, None, None],
        "measured": lambda: np.abs(measured[:, 2]).max(-1, keepdims=True),
        "peak to peak": lambda: np.ptp(np.pad(true, ((0, 0), (0, 0), (1, 0))), -1, keepdims=True),
        "rms": lambda: np.sqrt(np.mean(true**2, axis=-1, keepdims=True)),
    }[model.reference]()
    with np.errstate(divide="ignore"):
        wrong = 100 * wrong / whole
    size = np.abs(wrong)
    mean = {
        "rms": lambda: np.sqrt(np.mean(size**2, axis=-1)),
        "absolute": lambda: size.mean(-1),
        "median": lambda: np.median(size, axis=-1),
        "std": lambda: size.std(-1),
    }[model.mean]()
    signed = {
        "over": wrong * np.sign(true),
        "under": -wrong * np.sign(true),
        "peak": np.where(np.abs(true) == np.abs(true).max(-1, keepdims=True), size, 0),
    }
    ordered = np.sort(signed.get(model.largest, size), axis=-1)
    if model.largest == "second":
        ordered = ordered[..., :-1]
    return np.stack([mean, ordered[..., -1], ordered[..., -2]])


def _peaks(model: Model) -> Array:
    """Largest deflection of each mode in m, at the tip."""
    beam = setups.beam()
    if isinstance(model.peaks_mm, str):
        return np.array([peak_deflection(beam, mode) for mode in MODES])
    return np.array(model.peaks_mm) / 1000


@cache
def _place(claim: Claim, turned: bool) -> list[int]:
    """Which settings a claim speaks of."""
    order = OTHER[_order(claim.case)] if turned else _order(claim.case)
    return [
        index
        for index, (name, one) in enumerate(settings())
        if name == claim.figure_set
        and one.pair_order in ("", order)
        and claim.speaks_of(one.case, one.value, one.pair_order)
    ]


def of_claim(claim: Claim, found: Array, turned: tuple[str, ...] = ()) -> Array:
    """Errors that a claim speaks of, of all :func:`errors`: shape (settings, trials)."""
    which = 0 if claim.quantity == "mean_error" else 1 + claim.excepted
    here = _place(claim, claim.case in turned)
    return np.asarray(found[which][here, MODES.index(claim.mode)])
