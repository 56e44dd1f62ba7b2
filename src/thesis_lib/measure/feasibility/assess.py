"""Feasibility check of a manifest before the measurement: predicted performance and warnings.

Values missing in the manifest are NaN; no warning follows from them. Limits and texts of the
warnings are in ``messages.toml``.
"""

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from thesis_lib.arrays import Array, Mask
from thesis_lib.measure import messages
from thesis_lib.measure.feasibility import prediction
from thesis_lib.measure.feasibility.prediction import CameraPrediction, PredictedView, RigPrediction
from thesis_lib.measure.fitting.result import model_of
from thesis_lib.measure.messages import CHECK_LIMITS, format_message
from thesis_lib.measure.recordings.manifest import CameraFiles, Manifest
from thesis_lib.studies.fields import format_limit
from thesis_lib.templates import join_words, render
from thesis_lib.text import format_share
from thesis_lib.vibration.motion import fold_frequency
from thesis_lib.web.html import render_lines

CENTRE_NOISE_PX = 0.03  # rendered recordings scatter 0.016 px lossless to 0.03 px in H.264
#: Rms error of image motion for the worst motion, px: in H.264 with x264's defaults, which
#: represent a phone's, and lossless; the book's benchmarks measure both
COMPRESSED_ERROR_PX, LOSSLESS_ERROR_PX = 0.0783, 0.00414
#: Acceptable shape error over the largest deflection: of compressed video at the least motion
MAX_SHAPE_ERROR = COMPRESSED_ERROR_PX / CHECK_LIMITS["small-motion"]
MIN_VISIBLE_FRACTION = 0.5  # share of markers seen by two cameras that a shape needs
MAX_HIGHER_MODES = 3  # natural frequencies above the driven one: those that ring longest
MAX_MODES = 100  # natural frequencies searched for these
MIN_MODE_RATIO = 1.2  # of the driven frequency; natural ones above it are of other modes
TEXT_COLUMNS = 100
COLUMNS = {  # of the table, with their meanings
    "camera": "",
    "mm/px": "length that a pixel spans on the structure",
    "size px": "axes of a marker's image",
    "gap px": "least room between two",
    "motion px": "largest motion of an image",
    "blur px": "largest motion in an exposure",
    "lost": "amplitude that exposure takes",
    "sharp mm": "depths in focus",
    "depths mm": "those of the markers",
    "view": "markers that stay in the image",
    "spacings": "largest motion of a marker from frame to frame, in spacings of markers",
}
UNKNOWN = "-"


@dataclass(frozen=True)
class Warning:
    """A violated limit: a stable code, the field of the manifest, one line of text."""

    code: str
    where: str
    text: str


@dataclass(frozen=True)
class Verdict:
    """Predicted errors of the shape over its largest deflection, and deflections that suffice.

    NaN where the manifest lacks values, too few markers are seen, or no shape is measured.
    """

    result: str  #: Kind of result, see :class:`.Behaviour`
    compressed: float  #: Error with a phone's compressed video
    lossless: float
    whole_pixels: float
    #: Least peak deflections at which compressed and lossless video suffice, mm
    compressed_from_mm: float
    lossless_from_mm: float
    seen: float  #: Share of the markers that at least two cameras see

    @property
    def outcome(self) -> str:
        """Return which video suffices: compressed, lossless, none, or why it is unknown."""
        outcomes = {  # the first that applies
            "unseen": self.seen < MIN_VISIBLE_FRACTION,
            "response": self.result == "response",
            "unknown": np.isnan(self.compressed_from_mm),
            "amplitude unknown": np.isnan(self.compressed),
            "compressed": self.compressed <= MAX_SHAPE_ERROR,
            "lossless": self.lossless <= MAX_SHAPE_ERROR,
            "none": True,
        }
        return next(name for name, applies in outcomes.items() if applies)


@dataclass(frozen=True)
class Assessment:
    """Warnings, unknowns, and predicted performance of each camera and of the rig."""

    warnings: tuple[Warning, ...]
    unknown: tuple[str, ...]
    table: tuple[CameraPrediction, ...]
    rig: RigPrediction
    verdict: Verdict


def assess_manifest(manifest: Manifest) -> Assessment:
    """Predict the performance of a manifest's recordings, with warnings and unknowns.

    No file is read. The standard errors assume a scatter of the centres of :data:`CENTRE_NOISE_PX`.

    Parameters
    ----------
    manifest : Manifest
        Structure, cameras with positions and lenses, board and excitation.

    Returns
    -------
    Assessment
        Each camera's view, errors in mm and relative to the amplitude, warnings, a verdict.
    """
    amplitude = float(manifest.excitation.amplitude_mm or np.nan) / 1000
    steady, slowest = prediction.steady_seconds(manifest), min(c.rate_hz for c in manifest.cameras)
    with np.errstate(all="ignore"):  # missing values are NaN
        view = prediction.view_markers(manifest, float(np.nan_to_num(amplitude)))
        errors = prediction.predict_errors(manifest, view, amplitude, CENTRE_NOISE_PX)
        if (result := manifest.excitation.behaviour.result) == "response":
            errors[1] = np.full_like(errors[1], np.nan)  # no harmonics are fitted
        one, fit, rounding = map(prediction.reduce_errors, errors)
        rig = RigPrediction(
            located=int(view.located.sum()),
            noise_px=CENTRE_NOISE_PX,
            steady_interval_s=steady,
            frames=int(steady * slowest + 1e-9),
            one_frame=one,
            fit=fit,
            rounding=rounding,
            smallest_mm=CHECK_LIMITS["below-noise"] * fit[1],
        )
        table, warnings = [], list(_check_times(manifest))
        for i, camera in enumerate(manifest.cameras):
            row, where = prediction.predict_camera(manifest, view, i, amplitude), f"cameras[{i}]"
            table.append(row)
            warnings += _check_rate(manifest, camera.rate_hz, f"{where}.frame_rate_hz")
            warnings += _check_camera(manifest, camera, row, where, view.corners[i])
        warnings += _check_rig(manifest, view, rig, errors[0])
        verdict = _predict_shape_errors(view, rig, 1000 * amplitude, result)
    return Assessment(tuple(warnings), tuple(list_unknowns(manifest)), tuple(table), rig, verdict)


def _predict_shape_errors(
    view: PredictedView, rig: RigPrediction, amplitude_mm: float, result: str
) -> Verdict:
    """Predict the errors of the shape, for a largest deflection in mm.

    Compression that reduces image motion reduces the shape, too, for any number of cameras: at most
    by the share in the camera with the least image motion. Errors that are independent between
    cameras exceed this only where all cameras look from nearly the same side.
    """
    rises = np.linalg.norm(view.J[view.located, :, 2], axis=1) / 1000
    least_px_mm = np.fmax.reduce(rises, axis=1).min() if rig.located > 1 else np.nan
    compressed, lossless = (
        np.fmax(px / least_px_mm, px / np.sqrt(2) * rig.one_frame[1] / rig.noise_px)
        for px in (COMPRESSED_ERROR_PX, LOSSLESS_ERROR_PX)
    )
    shares = np.array([compressed, lossless, rig.rounding[1]]) / amplitude_mm
    needed_mm = np.array([compressed, lossless]) / MAX_SHAPE_ERROR
    seen = np.mean(view.seen[view.located].sum(axis=0) > 1) if rig.located > 1 else np.nan
    numbers = np.array([*shares, *needed_mm])
    if result == "response" or seen < MIN_VISIBLE_FRACTION:
        numbers[:] = np.nan
    return Verdict(result, *map(float, (*numbers, seen)))


def _warn(code: str, where: str, variant: str = "", /, **values: object) -> Warning:
    return Warning(code, where, format_message(messages.ALL_MESSAGES[code], variant, **values))


def _format_least(value: float, digits: int = 3) -> str:
    return format_limit(value, upper=False, digits=digits)


def _check_times(manifest: Manifest) -> Iterator[Warning]:
    """Check rest and steady-state intervals, for the slowest camera."""
    rate, f = min(c.rate_hz for c in manifest.cameras), manifest.excitation.frequency_hz or np.nan
    rest, given = manifest.excitation.rest_duration_s, manifest.excitation.steady_interval_s
    steady = np.float64(given[1] - given[0] if given else np.nan)
    rest_field, steady_field = "excitation.rest_duration_s", "excitation.steady_interval_s"
    checks = {  # code: field, available amount, amount per second
        "short-rest": (rest_field, rest, 1.0),
        "few-rest-frames": (rest_field, rest * rate, rate),
        "few-frames": (steady_field, steady * rate, rate),
        "few-periods": (steady_field, steady * f, f),
    }
    for code, (where, amount, in_second) in checks.items():
        least = CHECK_LIMITS[code]
        if amount < least - 1e-9:  # tolerance for rounding
            known = {"rest": rest, "steady": steady, "rate": rate}
            known |= {"frames": amount, "periods": amount}
            yield _warn(code, where, seconds=_format_least(least / in_second), **known)
    if given and rest - given[0] > CHECK_LIMITS["steady-at-rest"]:
        yield _warn("steady-at-rest", steady_field, begin=given[0], rest=rest)


def _check_rate(manifest: Manifest, rate: float, where: str) -> Iterator[Warning]:
    """Check one frame rate against the vibration and the structure's natural frequencies."""
    steady, f = prediction.steady_seconds(manifest), manifest.excitation.frequency_hz
    if f is None:
        return
    seen, limits = float(fold_frequency(f, rate)), CHECK_LIMITS
    folded, declared = f >= limits["undersampled"] * rate, manifest.excitation.undersampled
    near = not folded and f > limits["near-nyquist"] * rate
    coarse = not folded and not near and rate < limits["few-samples"] * f
    edge, least_edge = min(seen, rate / 2 - seen), limits["alias-edge"] / steady
    off = limits["alias"] / steady
    known: dict[str, Any] = {
        "given": f"the frame rate is {rate:g} Hz, {rate / f:.3g} frames a period of {f:.6g} Hz",
        "seen": seen, "steady": steady, "off": off, "share": off / f, "edge": edge, "rate": rate,
    }  # fmt: skip
    checks = {  # code: if violated, what suffices
        "undersampled": (folded and not declared, _format_least(2 * f, 6)),
        "alias": (folded and declared, ""),
        "alias-edge": (folded and declared and edge < least_edge, _format_least(least_edge)),
        "near-nyquist": (near, _format_least(f / limits["near-nyquist"], 6)),
        "few-samples": (coarse, _format_least(limits["few-samples"] * f, 6)),
    }
    for code, (wrong, least) in checks.items():
        if wrong:
            yield _warn(code, where, least=least, **known)
    model = model_of(manifest.structure)
    many = model.angular_frequencies(MAX_MODES) / (2 * np.pi) if model else np.empty(0)
    for k, own in enumerate(many[many > MIN_MODE_RATIO * f][:MAX_HIGHER_MODES]):
        rings = float(fold_frequency(own, rate))
        near = abs(rings - seen) * steady < limits["higher-modes"]
        if own >= rate / 2 and (k == 0 or near):
            least = _format_least(2 * own, 4)
            yield _warn("higher-modes", where, own=own, rings=rings, least=least, **known)
            return


def _check_camera(
    manifest: Manifest, camera: CameraFiles, row: CameraPrediction, where: str, corners: Mask
) -> Iterator[Warning]:
    """Check exposure, lens and position of one camera, and its view of markers and corners."""
    f, limits = np.float64(manifest.excitation.frequency_hz or np.nan), CHECK_LIMITS
    distance, elevation = camera.distance_mm or np.nan, camera.elevation_deg or np.nan
    focal, stop = camera.focal_length_mm or np.nan, camera.f_number or np.nan
    blur_px = limits["motion-blur"] * np.float64(row.across_px)
    count = manifest.structure.marker_points.shape[1]
    sharper = row.defocus_px / limits["depth-of-field"]
    # The predicted blur min(2πfT, 2) A is constant for exposures T above 1 / (πf).
    blurring_s = np.fmin(camera.exposure_s, 1 / (np.pi * f))
    checks: list[tuple[str, str, Any, float]] = [  # code, field, if violated, what suffices
        ("long-exposure", "exposure_s", f * camera.exposure_s > limits["long-exposure"],
         limits["long-exposure"] / f),
        ("motion-blur", "exposure_s", row.blur_px > blur_px,
         blurring_s * blur_px / row.blur_px),
        ("too-near", "distance_mm", distance <= limits["too-near"] * focal, np.nan),
        ("depth-of-field", "f_number", sharper > 1, stop * sharper),
        ("coarse", "distance_mm", row.along_px < limits["coarse"],
         distance * row.along_px / limits["coarse"]),
        ("foreshortened", "elevation_deg", row.across_px < limits["foreshortened"], np.nan),
        ("shallow-view", "elevation_deg", elevation < limits["shallow-view"], np.nan),
        ("steep-view", "elevation_deg", elevation > limits["steep-view"], np.nan),
        ("crowded-markers", "elevation_deg", row.gap_px < limits["crowded-markers"],
         manifest.structure.markers.diameter_mm),
        ("small-motion", "distance_mm", row.motion_px < limits["small-motion"],
         distance * row.motion_px / limits["small-motion"]),
        ("out-of-view", "distance_mm", row.in_view < limits["out-of-view"], np.nan),
        ("large-move", "frame_rate_hz", row.move_spacings > limits["large-move"], np.nan),
    ]  # fmt: skip
    for code, field, wrong, allowed in checks:
        if wrong:
            bound = format_limit(allowed, upper=field != "f_number", digits=3)
            known = {"camera": camera, "row": row, "allowed": bound, "blur_px": blur_px}
            known |= {"count": count, "stay": round(count * np.nan_to_num(row.in_view))}
            yield _warn(code, f"{where}.{field}", **known)
    if camera.corners_px is None and not np.isnan(row.in_view) and not corners.all():
        cut = 4 - np.count_nonzero(corners)
        yield _warn("out-of-view", f"{where}.corners_px", "corners", count=cut)


def _check_rig(
    manifest: Manifest, view: PredictedView, rig: RigPrediction, errors: Array
) -> Iterator[Warning]:
    """Check all cameras together."""
    on = np.flatnonzero(view.located)
    for i, j in combinations(on, 2):
        angle = np.degrees(np.arccos(min(abs(view.directions[i] @ view.directions[j]), 1.0)))
        if angle < CHECK_LIMITS["same-line"]:
            azimuth = manifest.cameras[j].azimuth_deg
            where = f"cameras[{j}].azimuth_deg"
            yield _warn("same-line", where, azimuth=azimuth, angle=angle, other=i)
    if len(on) < max(len(view.located), 2):  # unlocated cameras may see more
        return
    if lost := int(np.isnan(errors).sum()):
        yield _warn("lost-markers", "cameras", lost=lost, count=len(errors))
    best = np.fmin.reduce(errors)
    if weak := np.count_nonzero(errors > CHECK_LIMITS["weak-markers"] * best):
        ratio = rig.one_frame[1] / best
        yield _warn("weak-markers", "cameras", weak=weak, count=len(errors), ratio=ratio)
    amplitude = manifest.excitation.amplitude_mm or np.nan
    if amplitude < rig.smallest_mm < np.inf:
        known = {"least": _format_least(rig.smallest_mm, 2), "steady": rig.steady_interval_s}
        yield _warn("below-noise", "excitation.amplitude_mm", amplitude=amplitude, **known)


def list_unknowns(manifest: Manifest) -> Iterator[str]:
    """Yield the checks that could not be made, and the fields that they need."""
    needs = {
        "ground sample distance": prediction.OPTICS_FIELDS[:3],
        "view": prediction.OPTICS_FIELDS,
        "errors": prediction.OPTICS_FIELDS,
        "depth of field": (*prediction.OPTICS_FIELDS, "f_number"),
    }
    groups: dict[tuple[str, ...], list[str]] = {}
    for camera in manifest.cameras:
        fields = (name for name in needs["depth of field"] if getattr(camera, name) is None)
        groups.setdefault(tuple(fields), []).append(camera.name)
    groups.pop((), None)
    for missing, names in groups.items():
        what = join_words(what for what, fields in needs.items() if {*fields} & {*missing})
        known = {"names": f"{'s' * (len(names) > 1)} {join_words(names)}", "what": what}
        message = messages.UNCHECKED_MESSAGES["cameras"]
        yield format_message(message, fields=join_words(missing), **known)
    excitation = manifest.excitation
    is_response = excitation.behaviour.result == "response"
    open_fields = {
        "frequency": excitation.frequency_hz is None and excitation.behaviour.has_one_frequency,
        "amplitude": excitation.amplitude_mm is None,
        "steady": excitation.steady_interval_s is None and not is_response,
        "response": is_response,
        "clap": excitation.sound == "room",
        "model": manifest.structure.kind == "flat",
    }
    for code, is_open in open_fields.items():
        if is_open:
            message = messages.UNCHECKED_MESSAGES[code]
            yield format_message(message, steady=prediction.DEFAULT_STEADY_S)


def describe_assessment(assessment: Assessment) -> list[str]:
    """Format an assessment as lines: what is known of the tables, then warnings, then unknowns."""
    rows = [
        [
            one.name,
            _format_known(one.ground_sample_mm),
            _format_pair(one.along_px, one.across_px, "x", ".1f"),
            _format_known(one.gap_px),
            _format_known(one.motion_px),
            _format_known(one.blur_px),
            _format_known(one.lost, ".1%"),
            _format_pair(one.near_mm, one.far_mm),
            _format_pair(one.nearest_mm, one.farthest_mm),
            _format_known(np.floor(100 * one.in_view + 1e-9) / 100, ".0%"),  # 100% only if all stay
            _format_known(one.move_spacings),
        ]
        for one in assessment.table
    ]
    columns = [own for own in zip(COLUMNS, *rows, strict=True) if {*own[1:]} != {UNKNOWN}]
    names, *others = ([cell.rjust(max(map(len, own))) for cell in own] for own in columns)
    left = [name.strip().ljust(len(name)) for name in names]
    wrapper = textwrap.TextWrapper(TEXT_COLUMNS, subsequent_indent="  ", break_on_hyphens=False)
    text = render(
        __file__,
        "assessment.txt.j2",
        table=["  ".join(line) for line in zip(left, *others, strict=True)] if others else [],
        legend="; ".join(f"{name.split()[0]}: {COLUMNS[name]}" for name, *_ in columns[1:]),
        rig=assessment.rig,
        has_fit=assessment.verdict.result != "response",
        warnings=_group_warnings(assessment).items(),
        unknown=assessment.unknown,
        wrapped=wrapper.fill,
    )
    return text.splitlines()


def _group_warnings(assessment: Assessment) -> dict[tuple[str, ...], list[str]]:
    """Group the fields of equal warnings by text, code and name of the field."""
    same: dict[tuple[str, ...], list[str]] = {}
    for warning in assessment.warnings:
        key = warning.text, warning.code, warning.where.split("]")[-1]
        same.setdefault(key, []).append(warning.where)
    return same


def describe_verdict(assessment: Assessment) -> list[str]:
    """Format the verdict as lines: predicted errors of the shape, and whether they suffice."""
    lines = render_lines(
        "measure/report/templates/verdict.txt.j2",
        verdict=assessment.verdict,
        limit=MAX_SHAPE_ERROR,
        share=format_error_share,
        least=_format_least,
        warnings=len(_group_warnings(assessment)),
    )
    return textwrap.wrap(" ".join(lines), TEXT_COLUMNS)


def format_error_share(share: float) -> str:
    """Format an error as a share of the largest deflection in percent."""
    return format_share(share) if share < 1 else "all of it"


def _format_known(value: float, form: str = ".3g") -> str:
    return UNKNOWN if np.isnan(value) else format(value, form)


def _format_pair(low: float, high: float, between: str = "-", form: str = ".0f") -> str:
    return between.join(format(v, form) for v in (low, high) if not np.isnan(v)) or UNKNOWN
